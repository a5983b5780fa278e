"use strict";

// The look of the films (usm_gym/rendering.py).
const METRES = { "centre of mass": 2.78, head: 3.14 }; // width of the scene, by what follows the path
const JET_LENGTH = 0.36; // of a jet at the thruster's limit, m
const LENS_PAST = 2; // how much of the past the lens shows, s
const GRID = 0.5;
const JETS = ["--jet", "--jet-core"];
const DOTS = 0.04; // between the dots of the path, m
const LINK = Array.from({ length: 28 }, (_, k) => {
  const turn = (2 * Math.PI * k) / 28;
  const root = (value, power) => Math.sign(value) * Math.abs(value) ** power;
  return [root(Math.cos(turn), 0.45), root(Math.sin(turn), 0.6)];
});
const HEAD = LINK.map(([x, y], k) => {
  const turn = (2 * Math.PI * k) / 28;
  return Math.cos(turn) > 0 ? [1.35 * Math.cos(turn), Math.sin(turn)] : [x, y];
});

/** What `packed` of replay.py made: rows of numbers. */
function unpacked({ shape, scale, data }) {
  const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const width = shape[1] ?? 1;
  const value = (i) => scale * view.getInt16(2 * i, true);
  return Array.from({ length: shape[0] }, (_, row) =>
    Float64Array.from({ length: width }, (_, column) => value(row * width + column)));
}

/** Row of a table at a time, between two of them where `smooth`. */
function rowAt(rows, place, smooth) {
  const last = rows.length - 1;
  const at = clamp(place, 0, last);
  const before = Math.floor(at);
  if (!smooth || before === last) return rows[before];
  return rows[before].map((value, k) => value + (at - before) * (rows[before + 1][k] - value));
}

// Where a view is centred, by what follows the path: at its reference, or at the station.
const MIDDLES = { "centre of mass": (reference) => reference, head: (reference) => reference.map(() => 0) };
// How what follows the path is marked.
const MARKS = { "centre of mass": centreOfMass, head: spot };

/** Centres of the links and of mass, m; what follows the path is at a place. */
function linkCentres(theta, length, place, follower) {
  const centres = [];
  let [alongX, alongY] = [0, 0];
  for (const angle of theta) {
    const [dx, dy] = [Math.cos(angle) * length, Math.sin(angle) * length];
    centres.push([alongX + dx / 2, alongY + dy / 2]);
    [alongX, alongY] = [alongX + dx, alongY + dy];
  }
  const mean = [0, 1].map((k) => centres.reduce((sum, each) => sum + each[k], 0) / centres.length);
  const at = { "centre of mass": mean, head: [alongX, alongY] }[follower];
  const moved = (point) => point.map((part, axis) => part - at[axis] + place[axis]);
  return { centres: centres.map(moved), mass: moved(mean) };
}

/** A round number, m, that errors up to `largest` fit into. */
function roundScale(largest) {
  const power = 10 ** Math.floor(Math.log10(largest || 1e-6));
  return [1, 2, 5, 10].map((digit) => digit * power).find((scale) => scale >= 1.02 * largest) ?? 20 * power;
}

/** Fit a canvas to its place on the page; gives a context in CSS pixels. */
function fitted(canvas, ratio) {
  const width = canvas.clientWidth;
  const height = Math.round(width * ratio);
  const unit = devicePixelRatio;
  if (canvas.width !== Math.round(width * unit) || canvas.height !== Math.round(height * unit)) {
    canvas.width = Math.round(width * unit);
    canvas.height = Math.round(height * unit);
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d");
  context.setTransform(unit, 0, 0, unit, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function shape(context, points, fill, edge, width = 1) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.closePath();
  if (fill) { context.fillStyle = fill; context.fill(); }
  if (edge) { context.strokeStyle = edge; context.lineWidth = width; context.stroke(); }
}

function line(context, points, colour, width) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
}

function disc(context, [x, y], radius, colour) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
}

/** The usual sign: a disc in quarters. */
function centreOfMass(context, [x, y], radius, ink, paper) {
  disc(context, [x, y], radius + 1.2, ink);
  disc(context, [x, y], radius, paper);
  context.fillStyle = ink;
  for (const start of [-0.5, 0.5]) {
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, radius, start * Math.PI, (start + 0.5) * Math.PI);
    context.fill();
  }
}

/** A disc that stands out from a line or a body of its colour. */
function spot(context, at, radius, ink, paper) {
  disc(context, at, 0.8 * radius, paper);
  disc(context, at, 0.6 * radius, ink);
}

/** The goal of what follows the path. */
function crossHair(context, [x, y], arm, colour) {
  line(context, [[x - arm, y], [x + arm, y]], colour, 2);
  line(context, [[x, y - arm], [x, y + arm]], colour, 2);
}

/** A jet; a flow of length one is that at the thruster's limit. */
function jet(context, [x, y], [flowX, flowY], breadth, metre) {
  const strength = Math.hypot(flowX, flowY);
  if (strength < 0.01) return;
  const [aheadX, aheadY] = [JET_LENGTH * metre * flowX, JET_LENGTH * metre * flowY];
  const half = (0.023 * metre * breadth) / strength;
  const [acrossX, acrossY] = [-flowY * half, flowX * half];
  [[1, 1], [0.7, 0.5]].forEach(([share, width], k) => {
    const at = (ahead, across) =>
      [x + ahead * share * aheadX + across * width * acrossX, y + ahead * share * aheadY + across * width * acrossY];
    shape(context, [at(0, -0.5), at(0.9, -1), at(1, 0), at(0.9, 1), at(0, 0.5)], style(JETS[k]));
  });
}

/** How fast the water moves, and whereto as the view sees it: `seen` gives right and up. */
function drawCurrent(context, { current, data, time }, seen) {
  if (!current) return;
  const velocity = rowAt(current, time / data.frame, true);
  const speed = Math.hypot(...velocity);
  context.fillStyle = style("--quiet");
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "left";
  context.fillText(speed ? `current ${three(100 * speed)} cm/s` : "still water", speed ? 42 : 14, 22);
  if (!speed) return;
  const [right, up] = seen(velocity).map((part) => part / speed);
  arrow(context, [24 - 10 * right, 18 + 10 * up], [24 + 10 * right, 18 - 10 * up], style("--current"), 2);
}

/** Say that the robot is lost. */
function drawLoss(context, replay) {
  if (!replay.lostAt(replay.a, replay.time)) return;
  context.fillStyle = style("--alarm");
  context.font = "bold 14px system-ui, sans-serif";
  context.textAlign = "left";
  context.fillText(`${replay.a.name}: robot lost`, 14, 44);
}

/** A straight arrow, without a shaft if it is short. */
function arrow(context, [x, y], tip, colour, width) {
  const length = Math.hypot(tip[0] - x, tip[1] - y);
  const head = 4.5 * width;
  if (length < 0.4 * head) return;
  const [aheadX, aheadY] = [(tip[0] - x) / length, (tip[1] - y) / length];
  const at = (back, across) => [tip[0] - back * aheadX - across * aheadY, tip[1] - back * aheadY + across * aheadX];
  if (length > head) line(context, [[x, y], at(0.9 * head, 0)], colour, width);
  shape(context, [tip, at(head, 0.5 * head), at(head, -0.5 * head)], colour);
}
