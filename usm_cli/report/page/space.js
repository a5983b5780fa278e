"use strict";

// The look of the films (usm_gym/rendering/space/scene.py). Over the robot's length: depth of the
// floor below the deepest point of the path, how far its lines reach, half an arm of the goal's cross.
const [FLOOR, REACH, ARM] = [0.16, 2.6, 0.045];
const AXES = ["--c0", "--c1", "--c2"];

/** The robot in space, seen by a camera that can be moved: what a replay asks of a view. */
VIEWS.space = class {
  constructor(replay) {
    this.replay = replay;
    this.data = replay.data;
    this.canvas = replay.find(".scene");
    this.seen = "Error as seen from here";
    this.length = this.data.robot.lengths.reduce((sum, each) => sum + each, 0);
    this.grid = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5].filter((mark) => mark <= this.length / 6).pop() ?? 0.01;
    const heights = replay.path.flatMap((point) => [point[2], MIDDLES[this.data.follower](point)[2]]);
    this.floor = Math.min(...heights) - FLOOR * this.length;
    this.dots = this.pathDots(replay.path);
    this.camera = new Camera(replay.find(".water"), this.length, () => replay.draw());
    const solid = replay.find(".solid");
    // Asked of another canvas, as three.js writes to the console where there is none.
    this.solid = document.createElement("canvas").getContext("webgl2") && new SolidScene(solid, this);
    solid.hidden = !this.solid;
    replay.find(".plain").hidden = Boolean(this.solid);
    this.listen();
  }

  listen() {
    const { replay, camera } = this;
    const side = replay.find(".side-seen");
    const look = () => { camera.reset(side.value); replay.draw(); };
    side.addEventListener("change", look);
    replay.find(".look-again").addEventListener("click", look);
    for (const [name, factor] of [[".nearer", ZOOM ** 2], [".further", ZOOM ** -2]]) {
      replay.find(name).addEventListener("click", () => camera.zoom(factor));
    }
  }

  /** Pixels in a metre in the middle. */
  get metre() {
    return this.camera.metre;
  }

  /** An error as the camera sees it: to the right and up. */
  flat(error) {
    return this.camera.flat(error);
  }

  /** Points on a path, twelve along a square of the grid. */
  pathDots(path) {
    const dots = [path[0]];
    for (const point of path) {
      const last = dots[dots.length - 1];
      if (Math.hypot(...point.map((part, axis) => part - last[axis])) >= this.grid / 12) dots.push(point);
    }
    return dots;
  }

  draw(episode, time) {
    const { context, width, height } = fitted(this.canvas, this.canvas.clientWidth < 560 ? 0.85 : 0.52);
    if (!width) return;
    const place = time / this.data.frame;
    const { reference, middle, position } = this.replay.placeAt(episode, time);
    this.camera.aim([...middle], width, height);
    const { robot, follower } = this.data;
    const asked = this.replay.reference;
    const now = {
      reference, middle, position, place,
      ...linkPoses(robot, rowAt(episode.posture, place, true), position, follower),
      wanted: asked && linkPoses(robot, rowAt(asked, place, true), reference, follower).poses,
      thrust: rowAt(episode.thrust, place, false),
    };
    if (this.solid) this.solid.draw(now, width, height);
    else this.drawPlainly(context, now);
    this.drawMarks(context, now, this.replay.trail(episode, time));
    this.drawAxes(context, height);
    this.drawBar(context, width, height);
    drawCurrent(context, this.replay, (velocity) => this.flat(velocity));
    drawLoss(context, this.replay);
  }

  /** Path, track, what follows the path, its goal and the centre of mass, over everything. */
  drawMarks(context, { reference, position, mass }, trail) {
    const { camera } = this;
    for (const dot of this.dots) {
      const [x, y, depth] = camera.see(dot);
      if (depth > camera.near && depth < 3 * this.length) disc(context, [x, y], 1.3, style("--ink"));
    }
    for (const part of camera.seeLine(trail)) line(context, part, style("--track"), 2.2);
    for (const axis of [0, 1, 2]) {
      const ends = [-1, 1].map((side) => {
        const end = [...reference];
        end[axis] += side * ARM * this.length;
        return end;
      });
      for (const part of camera.seeLine(ends)) line(context, part, style("--reference"), 2);
    }
    // The larger sign of the centre of mass hides the spot where that is what follows the path.
    for (const [mark, point, ink] of [[spot, position, "--track"], [centreOfMass, mass, "--ink"]]) {
      const [x, y, depth] = camera.see(point);
      if (depth > camera.near) mark(context, [x, y], 6, style(ink), style("--surface"));
    }
  }

  /** The directions of the axes in a corner. */
  drawAxes(context, height) {
    const origin = [46, height - 46];
    context.font = "13px system-ui, sans-serif";
    context.textAlign = "center";
    this.data.axes.forEach((name, axis) => {
      const direction = [0, 0, 0];
      direction[axis] = 1;
      const [right, up] = this.flat(direction);
      // One that leads to the eye has no room for its name.
      if (Math.hypot(right, up) < 0.2) return;
      arrow(context, origin, [origin[0] + 28 * right, origin[1] - 28 * up], style(AXES[axis]), 1.6);
      context.fillStyle = style(AXES[axis]);
      context.fillText(name, origin[0] + 38 * right, origin[1] - 38 * up + 4);
    });
  }

  drawBar(context, width, height) {
    const length = this.grid * this.metre;
    if (length > width / 2) return;
    const [right, bottom] = [width - 14, height - 10];
    line(context, [[right - length, bottom], [right, bottom]], style("--quiet"), 1.5);
    context.fillStyle = style("--quiet");
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillText(`${this.grid} m`, right, bottom - 5);
  }

  /** The robot and the floor as lines, where there is no WebGL. */
  drawPlainly(context, { middle, poses }) {
    const { camera, grid, floor } = this;
    const [x, y] = [0, 1].map((axis) => Math.round(middle[axis] / grid) * grid);
    const reach = Math.round(this.length / grid) * grid;
    for (let k = -reach; k <= reach + grid / 2; k += grid) {
      const lines = [[[x + k, y - reach, floor], [x + k, y + reach, floor]], [[x - reach, y + k, floor], [x + reach, y + k, floor]]];
      lines.flatMap((ends) => camera.seeLine(ends)).forEach((part) => line(context, part, style("--floor-line"), 1));
    }
    const { lengths, solids } = this.data.robot;
    const far = ({ centre }) => -camera.see(centre)[2];
    const order = poses.map((pose, k) => [far(pose), k]).sort((a, b) => a[0] - b[0]);
    for (const [, k] of order) {
      const { turn, centre } = poses[k];
      const ends = [-0.46, 0.46].map((share) => turned(turn, [share * lengths[k], 0, 0]).map((part, axis) => part + centre[axis]));
      const widest = Math.max(...solids.filter(({ link }) => link === k).flatMap(({ profile }) => profile.map(([, r]) => r)));
      const name = k === 0 ? "--tail" : k === poses.length - 1 ? "--head" : "--body";
      for (const part of camera.seeLine(ends)) line(context, part, style(name), Math.max(2, 2 * widest * this.metre));
    }
  }
};
