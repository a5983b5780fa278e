"use strict";

// The camera of the films (usm_gym/rendering/space/camera.py): what it sees from left to right, and
// over the robot's length how far off it is, how far below the reference it aims, what is too near.
const WIDE = (46 * Math.PI) / 180;
const [DISTANCE, LOWERED, NEAR] = [1.38, 0.035, 0.03];
const degrees = (angle) => (angle * Math.PI) / 180;
// Directions of the camera from the robot: about z from x towards y, and above the horizon.
const SIDES = {
  oblique: [degrees(-116), degrees(17)],
  right: [degrees(-90), 0],
  above: [degrees(-90), degrees(89)],
  behind: [degrees(180), degrees(8)],
  ahead: [0, degrees(8)],
};
const STEEPEST = degrees(89);
// How much larger and smaller than at first things may be seen.
const [NEAREST, FURTHEST] = [0.12, 6];
const TURN = degrees(5); // by a key
const SHIFT = 0.05; // by a key, over the distance
const ZOOM = 1.15; // by a key or a notch of the wheel

/** A camera that moves along with a target, and that mouse, fingers, keys and buttons move. */
class Camera {
  constructor(host, length, moved) {
    this.host = host;
    this.length = length;
    this.moved = moved;
    this.pointers = new Map();
    this.reset();
    this.listen();
  }

  /** Look from one of the sides. */
  reset(side = "oblique") {
    [this.azimuth, this.elevation] = SIDES[side];
    this.distance = DISTANCE * this.length;
    this.shift = [0, 0, -LOWERED * this.length];
  }

  /** Look at a point beside a target, m, on an area in pixels. */
  aim(target, width, height) {
    const level = Math.cos(this.elevation);
    const back = [level * Math.cos(this.azimuth), level * Math.sin(this.azimuth), Math.sin(this.elevation)];
    this.target = target.map((part, axis) => part + this.shift[axis]);
    this.position = this.target.map((part, axis) => part + this.distance * back[axis]);
    this.right = [-Math.sin(this.azimuth), Math.cos(this.azimuth), 0];
    this.ahead = back.map((part) => -part);
    this.up = cross(this.right, this.ahead);
    this.middle = [width / 2, height / 2];
    this.focus = width / 2 / Math.tan(WIDE / 2);
    this.near = NEAR * this.length;
  }

  /** Pixels in a metre across the view, at the target. */
  get metre() {
    return this.focus / this.distance;
  }

  /** A direction as it is seen: to the right and up. */
  flat(direction) {
    return [dot(direction, this.right), dot(direction, this.up)];
  }

  /** Place on the area of a point, and how far ahead it is, m. */
  see(point) {
    const way = point.map((part, axis) => part - this.position[axis]);
    const depth = dot(way, this.ahead);
    const scale = this.focus / Math.max(depth, this.near);
    const [right, up] = this.flat(way);
    return [this.middle[0] + scale * right, this.middle[1] - scale * up, depth];
  }

  /** Places of those points of a line that are not too near, in parts. */
  seeLine(points) {
    const parts = [[]];
    for (const point of points) {
      const place = this.see(point);
      if (place[2] > this.near) parts[parts.length - 1].push(place);
      else if (parts[parts.length - 1].length) parts.push([]);
    }
    return parts.filter((part) => part.length > 1);
  }

  /** Turn about the target, by angles to the right and up. */
  turn(right, up) {
    this.azimuth -= right;
    this.elevation = clamp(this.elevation + up, -STEEPEST, STEEPEST);
    this.moved();
  }

  /** Move sideways, m. */
  pan(right, up) {
    this.shift = this.shift.map((part, axis) => part - right * this.right[axis] - up * this.up[axis]);
    this.moved();
  }

  /** Come nearer by a factor. */
  zoom(factor) {
    const whole = DISTANCE * this.length;
    this.distance = clamp(this.distance / factor, NEAREST * whole, FURTHEST * whole);
    this.moved();
  }

  listen() {
    const { host, pointers } = this;
    host.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, event);
      host.setPointerCapture(event.pointerId);
    });
    host.addEventListener("pointermove", (event) => this.drag(event));
    for (const end of ["pointerup", "pointercancel"]) {
      host.addEventListener(end, (event) => pointers.delete(event.pointerId));
    }
    host.addEventListener("contextmenu", (event) => event.preventDefault());
    host.addEventListener("wheel", (event) => {
      // A page that is being scrolled shall not be held up by what it scrolls over.
      if (!event.ctrlKey && document.activeElement !== host) return;
      event.preventDefault();
      this.zoom(ZOOM ** clamp(-event.deltaY / 100, -2, 2));
    }, { passive: false });
    host.addEventListener("keydown", (event) => this.press(event));
  }

  /** One pointer turns, with shift or the right button it moves; two move and zoom. */
  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const [right, down] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const other = [...this.pointers.values()].find((each) => each.pointerId !== event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (other) {
      const apart = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY);
      this.pan(right / 2 / this.metre, -down / 2 / this.metre);
      this.zoom(apart(event) / Math.max(apart(before), 1));
    } else if (event.shiftKey || event.buttons & 6) {
      this.pan(right / this.metre, -down / this.metre);
    } else {
      this.turn(right / 150, down / 150);
    }
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const way = ways[event.key];
    if (way && event.shiftKey) this.pan(...way.map((part) => SHIFT * this.distance * part));
    else if (way) this.turn(...way.map((part) => TURN * part));
    else if (event.key === "+") this.zoom(ZOOM);
    else if (event.key === "-") this.zoom(1 / ZOOM);
    else if (event.key === "0") { this.reset(); this.moved(); }
    else return;
    event.preventDefault();
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
