"use strict";

/** The robot in a plane, from above: what a replay asks of a view. */
VIEWS.plane = class {
  constructor(replay) {
    this.replay = replay;
    this.data = replay.data;
    this.canvas = replay.find(".scene");
    this.seen = "Error";
    this.dots = this.pathDots(replay.path);
  }

  /** Pixels in a metre. */
  get metre() {
    return this.canvas.clientWidth / METRES[this.data.follower];
  }

  /** An error as it is seen: to the right and up. */
  flat(error) {
    return error;
  }

  pathDots(path) {
    const dots = [path[0]];
    for (const point of path) {
      const last = dots[dots.length - 1];
      if (Math.hypot(point[0] - last[0], point[1] - last[1]) >= DOTS) dots.push(point);
    }
    return dots;
  }

  draw(episode, time) {
    const { context, width, height } = fitted(this.canvas, 0.43);
    if (!width) return;
    const place = time / this.data.frame;
    const { reference: here, middle, position } = this.replay.placeAt(episode, time);
    const metre = this.metre;
    const at = ([x, y]) => [width / 2 + (x - middle[0]) * metre, height / 2 - (y - middle[1]) * metre];
    this.drawGrid(context, middle, at, width / metre / 2, height / metre / 2);
    const { follower, robot: { length } } = this.data;
    if (this.replay.reference) {
      const theta = rowAt(this.replay.reference, place, true);
      this.outlines(theta, linkCentres(theta, length, here, follower).centres).forEach((link) =>
        shape(context, link.map(at), null, style("--reference"), 1.5));
    }
    const theta = rowAt(episode.posture, place, true);
    const { centres, mass } = linkCentres(theta, length, position, follower);
    if (episode.thrust) this.drawJets(context, theta, centres, rowAt(episode.thrust, place, false), metre, at);
    this.drawBody(context, theta, centres, metre, at);
    this.dots.forEach((dot) => disc(context, at(dot), 1.3, style("--ink")));
    line(context, this.replay.trail(episode, time).map(at), style("--track"), 2.2);
    if (follower === "head") crossHair(context, at(here), 15, style("--reference"));
    // The larger sign of the centre of mass hides the spot where that is what follows the path.
    spot(context, at(position), 6, style("--track"), style("--surface"));
    centreOfMass(context, at(mass), 6, style("--ink"), style("--surface"));
    this.drawMeasures(context, width, height, metre);
    drawLoss(context, this.replay);
  }

  outlines(theta, centres) {
    const { length, halfWidth } = this.data.robot;
    return centres.map((centre, k) => {
      const [cos, sin] = [Math.cos(theta[k]), Math.sin(theta[k])];
      return (k === centres.length - 1 ? HEAD : LINK).map(([x, y]) => {
        const [along, across] = [0.485 * length * x, halfWidth * y];
        return [centre[0] + along * cos - across * sin, centre[1] + along * sin + across * cos];
      });
    });
  }

  drawGrid(context, here, at, halfWidth, halfHeight) {
    const [low, high] = [[here[0] - halfWidth, here[1] - halfHeight], [here[0] + halfWidth, here[1] + halfHeight]];
    for (let x = Math.ceil(low[0] / GRID) * GRID; x < high[0]; x += GRID) {
      line(context, [at([x, low[1]]), at([x, high[1]])], style("--grid"), 1);
    }
    for (let y = Math.ceil(low[1] / GRID) * GRID; y < high[1]; y += GRID) {
      line(context, [at([low[0], y]), at([high[0], y])], style("--grid"), 1);
    }
  }

  drawBody(context, theta, centres, metre, at) {
    for (let k = 1; k < centres.length; k += 1) {
      const joint = [0, 1].map((axis) => (centres[k - 1][axis] + centres[k][axis]) / 2);
      disc(context, at(joint), 0.027 * metre, style("--body-edge"));
    }
    const links = this.outlines(theta, centres).map((link) => link.map(at));
    const last = links.length - 1;
    links.forEach((link, k) =>
      shape(context, link, style(k === 0 ? "--tail" : k === last ? "--head" : "--body"), style(k === last ? "--head-edge" : "--body-edge")));
    const [tip, neck] = [centres[last], centres[last - 1]];
    const eye = [tip[0] + 0.45 * (tip[0] - neck[0]), tip[1] + 0.45 * (tip[1] - neck[1])];
    disc(context, at(eye), 0.0136 * metre, style("--head-edge"));
  }

  /** Water leaves a thruster against its force, beside the body. */
  drawJets(context, theta, centres, thrust, metre, at) {
    this.data.robot.thrusters.forEach(({ link, normal }, k) => {
      const [cos, sin] = [Math.cos(theta[link]), Math.sin(theta[link])];
      const left = [-sin, cos];
      const flow = (normal ? left : [cos, sin]).map((part) => -thrust[k] * part);
      for (const side of normal ? [-Math.sign(thrust[k])] : [-1, 1]) {
        const out = 0.9 * side * this.data.robot.halfWidth;
        const start = [centres[link][0] + out * left[0], centres[link][1] + out * left[1]];
        jet(context, at(start), [flow[0], -flow[1]], normal ? 1 : 0.6, metre);
      }
    });
  }

  drawMeasures(context, width, height, metre) {
    const [right, bottom] = [width - 14, height - 10];
    line(context, [[right - GRID * metre, bottom], [right, bottom]], style("--quiet"), 1.5);
    context.fillStyle = style("--quiet");
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillText(`${GRID} m`, right, bottom - 5);
    drawCurrent(context, this.replay, (velocity) => velocity);
  }
};
