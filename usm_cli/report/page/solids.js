"use strict";

const AROUND = 32; // facets around a solid
const CONTOUR = 0.0045; // width of the dark edge around the robot, m
const STRIPE = 0.13; // half the width of the stripe along the top, rad
const THIN = 0.95; // the reference's width over the robot's, within which it is hidden
const OVERLAP = 0.4; // how far the hulls of links reach into each other, over their radius
const JET_SHAPE = [[0, 0], [0, 0.55], [0.85, 1], [1, 0]]; // along it over its length, and radius over its width

/** A frame whose first axis is a direction, and whose third is as upright as can be. */
function frameOf(direction) {
  const size = Math.hypot(...direction);
  const along = direction.map((part) => part / size);
  const left = cross(Math.abs(along[2]) < 0.99 ? [0, 0, 1] : [1, 0, 0], along);
  const width = Math.hypot(...left);
  const across = left.map((part) => part / width);
  return [along, across, cross(along, across)];
}

/** Normals of the slices of a profile, (along, outwards), at their start and end; soft where it bends little. */
function sliceNormals(profile) {
  const flat = profile.slice(1).map(([x, r], k) => {
    const [dx, dr] = [x - profile[k][0], r - profile[k][1]];
    const size = Math.hypot(dx, dr) || 1;
    return [-dr / size, dx / size];
  });
  const mixed = (own, other) => {
    if (!other || own[0] * other[0] + own[1] * other[1] < 0.6) return own;
    const sum = [own[0] + other[0], own[1] + other[1]];
    return sum.map((part) => part / Math.hypot(...sum));
  };
  return flat.map((own, k) => [mixed(own, flat[k - 1]), mixed(own, flat[k + 1])]);
}

/** The facets of solids of revolution: corners, normals, names of colours. */
class Facets {
  constructor() {
    Object.assign(this, { corners: [], normals: [], names: [] });
  }

  add({ profile, colours, edge, at, axis, stripe }) {
    const frame = frameOf(axis);
    const place = (x, r, turn) => {
      const parts = [x, r * Math.sin(turn), r * Math.cos(turn)];
      return [0, 1, 2].map((k) => parts[0] * frame[0][k] + parts[1] * frame[1][k] + parts[2] * frame[2][k]);
    };
    const normals = sliceNormals(profile);
    colours.forEach((colour, s) => {
      const striped = s >= stripe[0] && s < stripe[1];
      const turns = striped ? [-STRIPE, STRIPE] : [];
      const first = striped ? STRIPE : 0;
      const rest = 2 * Math.PI - 2 * first;
      for (let k = striped ? 1 : 0; k <= AROUND; k += 1) turns.push(first + (rest * k) / AROUND);
      turns.slice(1).forEach((turn, k) => {
        const name = striped && k === 0 ? edge : colour;
        const corners = [[0, turns[k]], [1, turns[k]], [1, turn], [0, turns[k]], [1, turn], [0, turn]];
        for (const [end, angle] of corners) {
          const [x, r] = profile[s + end];
          this.corners.push(...place(x, r, angle).map((part, axis) => part + at[axis]));
          this.normals.push(...place(...normals[s][end], angle));
          this.names.push(name);
        }
      });
    });
  }

  geometry() {
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.BufferAttribute(new Float32Array(this.corners), 3));
    made.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(this.normals), 3));
    made.setAttribute("color", new THREE.BufferAttribute(new Float32Array(this.corners.length), 3));
    made.userData.names = this.names;
    return made;
  }

  /** The same a little larger, for the dark edge around it. */
  contour() {
    const made = new THREE.BufferGeometry();
    const corners = this.corners.map((part, k) => part + CONTOUR * this.normals[k]);
    made.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
    return made;
  }
}

/** Solids of one link as facets. */
function facetsOf(solids) {
  const facets = new Facets();
  solids.forEach((solid) => facets.add(solid));
  return facets;
}

/** Whether a solid is the hull of a link, which has a stripe. */
const isHull = ({ stripe }) => stripe[1] > stripe[0];

/** A hull that reaches into those beside it, and is as wide or thinner. */
function closed({ profile, ...solid }, width = 1) {
  const half = Math.max(...profile.map(([x]) => Math.abs(x)));
  const radius = Math.max(...profile.map(([, r]) => r));
  const longer = (half + OVERLAP * radius) / half;
  return { ...solid, profile: profile.map(([x, r]) => [longer * x, width * r]) };
}

/** A jet of length and width one along x. */
function jetGeometry(length, width) {
  const profile = JET_SHAPE.map(([x, r]) => [length * x, width * r]);
  return facetsOf([{
    profile, colours: ["", "", ""], edge: "", at: [0, 0, 0], axis: [1, 0, 0], stripe: [0, 0],
  }]).geometry();
}

/** A material of one colour that covers each pixel once, where no mark is, and leaves a mark. */
function veil(opacity, mark, more) {
  return new THREE.MeshBasicMaterial({
    transparent: true, opacity, depthWrite: false, ...marking(mark), stencilFunc: THREE.NotEqualStencilFunc, ...more,
  });
}

/** Have a material leave a mark on the pixels that it covers. */
const marking = (mark) => ({ stencilWrite: true, stencilRef: mark, stencilZPass: THREE.ReplaceStencilOp });
