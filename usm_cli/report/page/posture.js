"use strict";

// Quaternions are (w, x, y, z).
function product([a, b, c, d], [e, f, g, h]) {
  return [
    a * e - b * f - c * g - d * h,
    a * f + b * e + c * h - d * g,
    a * g - b * h + c * e + d * f,
    a * h + b * g - c * f + d * e,
  ];
}

/** A vector turned by a quaternion of length one. */
function turned([w, ...axis], vector) {
  const twice = cross(axis, vector).map((part) => 2 * part);
  const again = cross(axis, twice);
  return vector.map((part, k) => part + w * twice[k] + again[k]);
}

/** The turn by an angle about a unit vector. */
function turnAbout(axis, angle) {
  return [Math.cos(angle / 2), ...axis.map((part) => Math.sin(angle / 2) * part)];
}

/**
 * Turns and centres of the links, m, as `link_poses` has them, and the centre of mass.
 *
 * What follows the path is at a place.
 */
function linkPoses({ lengths, masses, keels, jointAxes }, posture, place, follower) {
  const root = lengths.length >> 1;
  const size = Math.hypot(...posture.slice(0, 4));
  const turns = [];
  turns[root] = [...posture.slice(0, 4)].map((part) => part / size);
  for (let k = root; k < lengths.length - 1; k += 1) {
    turns[k + 1] = product(turns[k], turnAbout(jointAxes[k], posture[4 + k]));
  }
  for (let k = root; k > 0; k -= 1) {
    turns[k - 1] = product(turns[k], turnAbout(jointAxes[k - 1], -posture[3 + k]));
  }
  const centres = [];
  let end = [0, 0, 0];
  lengths.forEach((length, k) => {
    const half = turned(turns[k], [length / 2, 0, 0]);
    centres.push(end.map((part, axis) => part + half[axis]));
    end = end.map((part, axis) => part + 2 * half[axis]);
  });
  const total = masses.reduce((sum, each) => sum + each, 0);
  const middle = [0, 0, 0];
  centres.forEach((centre, k) => {
    const keel = turned(turns[k], [0, 0, -keels[k]]);
    centre.forEach((part, axis) => { middle[axis] += (masses[k] / total) * (part + keel[axis]); });
  });
  const at = { "centre of mass": middle, head: end }[follower];
  const moved = (point) => point.map((part, axis) => part - at[axis] + place[axis]);
  return { poses: turns.map((turn, k) => ({ turn, centre: moved(centres[k]) })), mass: moved(middle) };
}
