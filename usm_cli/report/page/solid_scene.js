"use strict";

// How the light falls: from above, and how dark what faces away from it is.
const LIGHT = [-0.25, 0.25, 0.94];
const [BRIGHTNESS, DARKEST] = [1.15 * Math.PI, 0.17];
const [SHADE, GHOST, JET] = [0.3, 0.34, 0.72]; // opacities
// The water's arrows, over the robot's length: their distances, how far from the middle they are,
// the longest one and their width; how far the water moves along an arrow, s.
const [APART, AROUND_MIDDLE, LONGEST, BREADTH] = [[0.3, 0.3, 0.22], 0.9, 0.09, 0.006];
const SECONDS = 4;
const ARROW = [[-0.5, 0], [-0.5, 0.3], [0.1, 0.3], [0.1, 1], [0.5, 0]]; // over its length and width
const MOST_ARROWS = 400;
const CORE = [0.7, 0.5]; // length and width of a jet's core over the jet's

/** The solid part of a scene in space, drawn by three.js. */
class SolidScene {
  constructor(canvas, view) {
    this.view = view;
    this.canvas = canvas;
    // Kept, so that it is printed.
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true, stencil: true, preserveDrawingBuffer: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    const light = new THREE.HemisphereLight(0xffffff, 0xffffff, BRIGHTNESS);
    light.groundColor.setScalar(DARKEST);
    light.position.set(...LIGHT);
    this.scene.add(light);
    this.materials = {
      body: new THREE.MeshLambertMaterial({ vertexColors: true, ...marking(2) }),
      contour: new THREE.MeshBasicMaterial({ side: THREE.BackSide, ...marking(2) }),
      // What is flat has no front.
      shadow: veil(SHADE, 1, { side: THREE.DoubleSide }),
      // Behind the body wherever it is.
      ghost: veil(GHOST, 2, { depthTest: false }),
      jet: new THREE.MeshBasicMaterial({ transparent: true, opacity: JET, depthWrite: false }),
      core: new THREE.MeshBasicMaterial({ transparent: true, opacity: JET, depthWrite: false }),
      stream: new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.5 }),
      floor: new THREE.LineBasicMaterial({ vertexColors: true, transparent: true }),
      fallen: new THREE.LineBasicMaterial(),
    };
    this.addRobot();
    this.addJets();
    this.addFloor();
    this.addStream();
  }

  /** A group for each link: body, contour, shadow, and the reference. */
  addRobot() {
    const { solids, lengths } = this.view.data.robot;
    const { body, contour, shadow, ghost } = this.materials;
    this.shadow = new THREE.Group();
    this.shadow.matrixAutoUpdate = false;
    this.shadow.matrix.makeScale(1, 1, 0).setPosition(0, 0, this.view.floor + 0.002 * this.view.length);
    this.scene.add(this.shadow);
    this.geometries = [];
    this.links = lengths.map((_, k) => {
      const own = solids.filter(({ link }) => link === k);
      const facets = facetsOf(own);
      const geometry = facets.geometry();
      this.geometries.push(geometry);
      const hull = own.filter(isHull);
      const groups = {
        body: new THREE.Group(),
        shadow: new THREE.Mesh(facetsOf(hull.map((solid) => closed(solid))).geometry(), shadow),
        ghost: new THREE.Mesh(facetsOf(hull.map((solid) => closed(solid, THIN))).geometry(), ghost),
      };
      groups.body.add(new THREE.Mesh(geometry, body), new THREE.Mesh(facetsOf(own.filter(({ inside }) => !inside)).contour(), contour));
      this.scene.add(groups.body, groups.ghost);
      this.shadow.add(groups.shadow);
      return groups;
    });
  }

  addJets() {
    const { jets, jetLength } = this.view.data.robot;
    this.jets = jets.map((jet) => {
      const mesh = new THREE.Group();
      const geometry = jetGeometry(jetLength, jet.width);
      const core = new THREE.Mesh(geometry, this.materials.core);
      core.scale.set(CORE[0], CORE[1], CORE[1]);
      mesh.add(new THREE.Mesh(geometry, this.materials.jet), core);
      this.links[jet.link].body.add(mesh);
      return mesh;
    });
  }

  /** Lines that fade away from the middle, and the path on the floor. */
  addFloor() {
    const { grid, length, replay, floor } = this.view;
    const reach = REACH * length;
    const corners = [];
    const shares = [];
    const count = Math.ceil(reach / grid);
    const fade = (x, y) => Math.max(0, 1 - Math.hypot(x, y) / reach);
    for (let a = -count; a <= count; a += 1) {
      for (let b = -count; b < count; b += 1) {
        for (const swap of [false, true]) {
          for (const end of [b, b + 1]) {
            const [x, y] = swap ? [end * grid, a * grid] : [a * grid, end * grid];
            corners.push(x, y, 0);
            shares.push(fade(x, y));
          }
        }
      }
    }
    const lines = new THREE.BufferGeometry();
    lines.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
    lines.setAttribute("color", new THREE.BufferAttribute(new Float32Array(4 * shares.length), 4));
    this.floor = new THREE.LineSegments(lines, this.materials.floor);
    this.floor.userData.shares = shares;
    const path = replay.path.flatMap(([x, y]) => [x, y, floor]);
    this.fallen = new THREE.Line(new THREE.BufferGeometry(), this.materials.fallen);
    this.fallen.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(path), 3));
    this.drop = new THREE.Line(new THREE.BufferGeometry(), this.materials.fallen);
    this.drop.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    for (const each of [this.floor, this.fallen, this.drop]) {
      each.frustumCulled = false;
      this.scene.add(each);
    }
  }

  /** Arrows that drift with the water. */
  addStream() {
    const { replay, data } = this.view;
    const solid = {
      profile: ARROW, colours: ["", "", "", ""], edge: "", at: [0, 0, 0], axis: [1, 0, 0], stripe: [0, 0],
    };
    this.stream = new THREE.InstancedMesh(facetsOf([solid]).geometry(), this.materials.stream, MOST_ARROWS);
    this.stream.frustumCulled = false;
    this.scene.add(this.stream);
    const moved = [0, 0, 0];
    this.drifts = replay.current.map((velocity) => {
      const here = [...moved];
      velocity.forEach((part, axis) => { moved[axis] += part * data.frame; });
      return here;
    });
  }

  draw(now, width, height) {
    this.colour();
    const { camera } = this.view;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.canvas.style.height = `${height}px`;
    this.camera.fov = (2 * Math.atan((height / width) * Math.tan(WIDE / 2)) * 180) / Math.PI;
    this.camera.aspect = width / height;
    this.camera.near = camera.near;
    this.camera.far = 40 * this.view.length;
    this.camera.position.set(...camera.position);
    this.camera.lookAt(...camera.target);
    this.camera.updateProjectionMatrix();
    this.pose(now);
    this.placeStream(now);
    this.renderer.render(this.scene, this.camera);
  }

  pose({ poses, wanted, thrust, middle, position }) {
    const put = (thing, { turn: [w, x, y, z], centre }) => {
      thing.quaternion.set(x, y, z, w);
      thing.position.set(...centre);
    };
    this.links.forEach(({ body, shadow, ghost }, k) => {
      put(body, poses[k]);
      put(shadow, poses[k]);
      ghost.visible = Boolean(wanted);
      if (wanted) put(ghost, wanted[k]);
    });
    this.view.data.robot.jets.forEach(({ at, direction, mouth }, k) => {
      const flow = direction.map((part) => -Math.sign(thrust[k]) * part);
      const jet = this.jets[k];
      jet.visible = Math.abs(thrust[k]) > 0.03;
      jet.position.set(...at.map((part, axis) => part + mouth * flow[axis]));
      jet.quaternion.setFromUnitVectors(new THREE.Vector3(1, 0, 0), new THREE.Vector3(...flow));
      jet.scale.set(Math.abs(thrust[k]) || 1, 1, 1);
    });
    const { grid, floor } = this.view;
    this.floor.position.set(Math.round(middle[0] / grid) * grid, Math.round(middle[1] / grid) * grid, floor);
    const ends = this.drop.geometry.getAttribute("position");
    ends.set([...position, position[0], position[1], floor]);
    ends.needsUpdate = true;
  }

  placeStream({ middle, place }) {
    const { length, floor, replay } = this.view;
    const velocity = rowAt(replay.current, place, true);
    const drift = rowAt(this.drifts, place, true);
    const speed = Math.hypot(...velocity);
    const long = Math.min(LONGEST * length, SECONDS * speed);
    const ahead = new THREE.Quaternion().setFromUnitVectors(
      new THREE.Vector3(1, 0, 0), new THREE.Vector3(...velocity).normalize());
    const broad = Math.min(BREADTH * length, 0.25 * long);
    const step = APART.map((part) => part * length);
    const reach = AROUND_MIDDLE * length;
    const range = [0, 1, 2].map((axis) => [-1, 1].map((side) =>
      Math.round((middle[axis] - drift[axis] + side * reach) / step[axis])));
    let count = 0;
    const each = (axis, act) => { for (let k = range[axis][0]; k <= range[axis][1]; k += 1) act(k); };
    each(0, (i) => each(1, (j) => each(2, (k) => {
      // Every second row and layer is shifted, so that the arrows do not stand in ranks.
      const cell = [i + 0.5 * Math.abs(j % 2), j + 0.5 * Math.abs(k % 2), k];
      const at = cell.map((part, axis) => part * step[axis] + drift[axis]);
      const far = Math.hypot(...at.map((part, axis) => part - middle[axis])) / reach;
      if (far >= 1 || at[2] < floor || count === MOST_ARROWS || speed === 0) return;
      const wide = broad * (1 - far ** 2);
      this.stream.setMatrixAt(count, new THREE.Matrix4().compose(
        new THREE.Vector3(...at), ahead, new THREE.Vector3(long, wide, wide)));
      count += 1;
    })));
    this.stream.count = count;
    this.stream.instanceMatrix.needsUpdate = true;
  }

  /** Take the colours of the page, once for each colour scheme. */
  colour() {
    const names = { contour: "--contour", shadow: "--shadow", ghost: "--reference", jet: "--jet-3d", core: "--jet-core", stream: "--current", fallen: "--fallen" };
    const scheme = Object.values(names).map(style).join();
    if (scheme === this.scheme) return;
    this.scheme = scheme;
    Object.entries(names).forEach(([material, name]) => this.materials[material].color.set(style(name)));
    for (const geometry of this.geometries) {
      const colours = geometry.getAttribute("color");
      const shown = new Map();
      geometry.userData.names.forEach((name, k) => {
        if (!shown.has(name)) shown.set(name, new THREE.Color(style(name)));
        colours.setXYZ(k, ...shown.get(name));
      });
      colours.needsUpdate = true;
    }
    const lines = this.floor.geometry.getAttribute("color");
    const line = new THREE.Color(style("--floor-line"));
    this.floor.userData.shares.forEach((share, k) => lines.setXYZW(k, ...line, share));
    lines.needsUpdate = true;
  }
}
