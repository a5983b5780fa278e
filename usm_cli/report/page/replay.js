"use strict";

/** An episode to be played: the scene, the error magnified, and curves over time. */
class Replay {
  constructor(host) {
    const data = JSON.parse(document.getElementById(`${host.dataset.replay}-data`).textContent);
    this.host = host;
    this.data = data;
    this.path = unpacked(data.path);
    this.current = data.current && unpacked(data.current);
    this.reference = data.reference && unpacked(data.reference);
    this.dots = this.pathDots();
    this.known = {};
    this.find = (name) => host.querySelector(name);
    this.time = data.shifts.length ? Math.min(data.shifts[0] + 0.6, data.duration) : 0;
    this.makeCharts();
    this.listen();
    this.choose();
  }

  /** The episode of a policy, unpacked when it is first asked for. */
  episode(name) {
    if (!name) return null;
    if (!this.known[name]) {
      const { theta, thrust, error, effort, lost } = this.data.episodes[name];
      this.known[name] = {
        name,
        lost,
        theta: unpacked(theta),
        thrust: thrust && unpacked(thrust),
        error: unpacked(error),
        effort: unpacked(effort),
      };
    }
    return this.known[name];
  }

  pathDots() {
    const dots = [this.path[0]];
    for (const point of this.path) {
      const last = dots[dots.length - 1];
      if (Math.hypot(point[0] - last[0], point[1] - last[1]) >= DOTS) dots.push(point);
    }
    return dots;
  }

  listen() {
    const slider = this.find(".time");
    slider.addEventListener("input", () => this.goTo(Number(slider.value)));
    this.find(".play").addEventListener("click", () => this.play(!this.playing));
    for (const name of [".pick-a", ".pick-b"]) {
      this.find(name).addEventListener("change", () => this.choose());
    }
    new ResizeObserver(() => this.draw()).observe(this.host);
  }

  choose() {
    this.a = this.episode(this.find(".pick-a").value);
    this.b = this.episode(this.find(".pick-b").value);
    this.shown = [this.a, this.b].filter(Boolean);
    const late = (_, k) => this.sampleTime(k) >= this.data.settle;
    const largest = Math.max(...this.shown.flatMap(({ error }) =>
      error.filter(late).map(([x, y]) => Math.hypot(x, y))), 1e-7);
    this.scale = roundScale(largest);
    this.fillCharts();
    this.goTo(this.time);
  }

  sampleTime(index) {
    return this.data.start + index * this.data.period;
  }

  /** Place in the samples of errors at a time. */
  sample(time) {
    return (time - this.data.start) / this.data.period;
  }

  goTo(time) {
    this.time = clamp(time, 0, this.data.duration);
    const slider = this.find(".time");
    slider.value = this.time;
    const clock = `${this.time.toFixed(2)} s`;
    slider.setAttribute("aria-valuetext", clock);
    this.find(".clock").textContent = clock;
    this.draw();
  }

  play(on) {
    const button = this.find(".play");
    this.playing = on;
    button.textContent = on ? "Pause" : "Play";
    button.setAttribute("aria-pressed", on);
    this.readout.setAttribute("aria-live", on ? "off" : "polite");
    if (!on) return;
    if (this.time >= this.data.duration) this.goTo(0);
    let last = performance.now();
    const next = (now) => {
      if (!this.playing) return;
      const speed = Number(this.find(".speed").value);
      this.goTo(this.time + (speed * (now - last)) / 1000);
      last = now;
      if (this.time >= this.data.duration) this.play(false);
      else requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  draw() {
    this.drawScene();
    this.drawLens();
    this.writeErrors();
    this.writeReadout();
    this.movePlayheads();
  }

  lostAt(episode, time) {
    return episode.lost && this.sample(time) >= episode.error.length - 1;
  }

  drawScene() {
    const { context, width, height } = fitted(this.find(".scene"), 0.43);
    if (!width) return;
    const place = this.time / this.data.frame;
    const here = rowAt(this.path, place, true);
    const metre = width / METRES;
    const at = ([x, y]) => [width / 2 + (x - here[0]) * metre, height / 2 - (y - here[1]) * metre];
    this.drawGrid(context, here, at, width / metre / 2, height / metre / 2);
    const error = rowAt(this.a.error, this.sample(this.time), true);
    const position = [here[0] + error[0], here[1] + error[1]];
    const { length } = this.data.robot;
    if (this.reference) {
      const theta = rowAt(this.reference, place, true);
      this.outlines(theta, linkCentres(theta, length, here)).forEach((link) =>
        shape(context, link.map(at), null, style("--reference"), 1.5));
    }
    const theta = rowAt(this.a.theta, place, true);
    const centres = linkCentres(theta, length, position);
    if (this.a.thrust) this.drawJets(context, theta, centres, rowAt(this.a.thrust, place, false), metre, at);
    this.drawBody(context, theta, centres, metre, at);
    this.dots.forEach((dot) => disc(context, at(dot), 1.3, style("--ink")));
    const trail = this.path.slice(0, Math.floor(place) + 1).map((point, k) => {
      const past = rowAt(this.a.error, this.sample(k * this.data.frame), true);
      return at([point[0] + past[0], point[1] + past[1]]);
    });
    line(context, [...trail, at(position)], style("--track"), 2.2);
    centreOfMass(context, at(position), 6, style("--ink"), style("--surface"));
    this.drawMeasures(context, width, height, metre, place);
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

  drawMeasures(context, width, height, metre, place) {
    const [right, bottom] = [width - 14, height - 10];
    line(context, [[right - GRID * metre, bottom], [right, bottom]], style("--quiet"), 1.5);
    context.fillStyle = style("--quiet");
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillText(`${GRID} m`, right, bottom - 5);
    context.textAlign = "left";
    if (this.current) {
      const [x, y] = rowAt(this.current, place, true);
      const speed = Math.hypot(x, y);
      context.fillText(speed ? `current ${three(100 * speed)} cm/s` : "still water", speed ? 42 : 14, 22);
      if (speed) this.drawArrow(context, [24, 18], [x / speed, -y / speed]);
    }
    if (this.lostAt(this.a, this.time)) {
      context.fillStyle = style("--alarm");
      context.font = "bold 14px system-ui, sans-serif";
      context.fillText(`${this.a.name}: robot lost`, 14, 44);
    }
  }

  drawArrow(context, [x, y], [aheadX, aheadY]) {
    const at = (ahead, across) => [x + ahead * aheadX - across * aheadY, y + ahead * aheadY + across * aheadX];
    line(context, [at(-10, 0), at(2, 0)], style("--current"), 2);
    shape(context, [at(10, 0), at(1, 4.5), at(1, -4.5)], style("--current"));
  }

  /** The error of the centre of mass, magnified; the reference is in the middle. */
  drawLens() {
    const { context, width } = fitted(this.find(".lens"), 1);
    if (!width) return;
    const middle = [width / 2, width / 2];
    const reach = 0.42 * width;
    for (const share of [1, 0.5]) {
      context.beginPath();
      context.arc(...middle, share * reach, 0, 2 * Math.PI);
      context.strokeStyle = style("--rule");
      context.lineWidth = 1;
      context.stroke();
    }
    line(context, [[middle[0] - reach, middle[1]], [middle[0] + reach, middle[1]]], style("--rule"), 1);
    line(context, [[middle[0], middle[1] - reach], [middle[0], middle[1] + reach]], style("--rule"), 1);
    const mark = ([x, y]) => {
      const size = Math.max(Math.hypot(x, y) / this.scale, 1);
      return [middle[0] + (reach * x) / this.scale / size, middle[1] - (reach * y) / this.scale / size];
    };
    disc(context, middle, 2.5, style("--reference"));
    for (const [episode, colour] of [[this.b, "--b"], [this.a, "--a"]]) {
      if (!episode) continue;
      const last = clamp(Math.round(this.sample(this.time)), 0, episode.error.length - 1);
      const first = Math.max(0, last - Math.round(LENS_PAST / this.data.period));
      line(context, episode.error.slice(first, last + 1).map(mark), style(colour), 1.5);
      centreOfMass(context, mark(episode.error[last]), 5, style(colour), style("--surface"));
    }
    const metre = this.find(".scene").clientWidth / METRES;
    const times = three(reach / this.scale / metre);
    this.find(".lens-scale").textContent =
      `Error, ${times} times as large; the outer ring is ${three(1e3 * this.scale)} mm away.`;
  }

  writeErrors() {
    for (const [name, episode] of [["a", this.a], ["b", this.b]]) {
      const row = this.find(`.now tr.${name}`);
      row.hidden = !episode;
      if (!episode) continue;
      const lost = this.lostAt(episode, this.time);
      const error = rowAt(episode.error, Math.round(this.sample(this.time)), false);
      row.cells[0].textContent = episode.name;
      [0, 1].forEach((axis) => {
        row.cells[axis + 1].textContent = lost ? "lost" : (1e3 * error[axis]).toFixed(3);
      });
    }
  }

  makeCharts() {
    const host = this.find(".charts");
    const tools = element("p", "bar tools");
    this.readout = element("output", "readout");
    host.append(tools);
    const key = this.host.dataset.replay;
    const hooks = {
      drawClear: [(chart) => this.shade(chart)],
      draw: [() => this.movePlayheads()],
      setCursor: [(chart) => this.read(chart)],
    };
    const pair = [
      { stroke: () => style("--b"), width: 1.5, points: { show: false } },
      { stroke: () => style("--a"), width: 1.5, points: { show: false } },
    ]; // the controller itself is drawn on top of the other
    const parts = [["error in x, mm", 1], ["error in y, mm", 2], ["mean thrust, N", 3]];
    this.charts = parts.map(([label]) => {
      const panel = element("figure", "panel");
      panel.append(element("figcaption", "caption", label));
      host.append(panel);
      const chart = makeChart(panel, {
        label: `${label} against time`,
        data: [[0], [0], [0]],
        series: pair.map((each) => ({ ...each })),
        log: { x: false, y: false },
        xLabel: label.endsWith("N") ? "time, s" : undefined,
        height: label.endsWith("N") ? 190 : 170,
        zooms: ["x"],
        more: { hooks, cursor: { sync: { key, scales: ["x", null] } } },
      });
      chart.playhead = element("div", "playhead");
      chart.over.append(chart.playhead);
      chart.over.addEventListener("click", () => {
        if (chart.select.width === 0) this.goTo(chart.posToVal(chart.cursor.left, "x"));
      });
      return chart;
    });
    this.charts.forEach((chart) => { chart.group = this.charts; });
    tools.append(element("span", "note", "Drag to zoom, click to go there."), makeZoomButtons(this.charts[0], "curves"), this.readout);
  }

  fillCharts() {
    const length = Math.max(...this.shown.map(({ error }) => error.length));
    const time = Array.from({ length }, (_, k) => this.sampleTime(k));
    const column = (episode, value) =>
      time.map((_, k) => (episode && k < episode.error.length ? value(episode, k) : null));
    const values = [
      (episode, k) => 1e3 * episode.error[k][0],
      (episode, k) => 1e3 * episode.error[k][1],
      (episode, k) => episode.effort[k]?.[0] ?? null,
    ];
    this.charts.forEach((chart, k) =>
      chart.setData([time, column(this.b, values[k]), column(this.a, values[k])], true));
  }

  /** The time before settling, and the motions of the joints. */
  shade(chart) {
    const { ctx, bbox } = chart;
    const pixel = (time) => clamp(chart.valToPos(time, "x", true), bbox.left, bbox.left + bbox.width);
    ctx.save();
    ctx.fillStyle = style("--grid");
    ctx.fillRect(pixel(0), bbox.top, pixel(this.data.settle) - pixel(0), bbox.height);
    ctx.strokeStyle = style("--head");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([4 * devicePixelRatio, 4 * devicePixelRatio]);
    for (const shift of this.data.shifts) {
      const { min, max } = chart.scales.x;
      if (shift < min || shift > max) continue;
      ctx.beginPath();
      ctx.moveTo(pixel(shift), bbox.top);
      ctx.lineTo(pixel(shift), bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  movePlayheads() {
    for (const chart of this.charts ?? []) {
      const left = chart.valToPos(this.time, "x");
      chart.playhead.hidden = !(left >= 0 && left <= chart.over.clientWidth);
      chart.playhead.style.transform = `translateX(${left}px)`;
    }
  }

  /** Say what is under the cursor, or else what is now. */
  read(chart) {
    const { idx, left } = chart.cursor;
    this.pointed = idx != null && left >= 0 ? idx : null;
    this.writeReadout();
  }

  writeReadout() {
    const index = this.pointed ?? Math.max(Math.round(this.sample(this.time)), 0);
    const said = this.shown.filter(({ error }) => index < error.length).map((episode) => {
      const [x, y] = episode.error[index].map((error) => three(1e3 * error));
      const thrust = episode.effort[index];
      return `${episode.name} ${x}, ${y} mm${thrust ? `, ${three(thrust[0])} N` : ""}`;
    });
    this.readout.textContent = [`${this.sampleTime(index).toFixed(2)} s`, ...said].join(" · ");
  }
}
