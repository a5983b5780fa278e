"use strict";

// What draws the robots of a world, by its name.
const VIEWS = {};

/** An episode to be played: the scene, the error magnified, and curves over time. */
class Replay {
  constructor(host) {
    const data = JSON.parse(document.getElementById(`${host.dataset.replay}-data`).textContent);
    this.host = host;
    this.data = data;
    this.path = unpacked(data.path);
    this.current = data.current && unpacked(data.current);
    this.reference = data.reference && unpacked(data.reference);
    this.known = {};
    this.find = (name) => host.querySelector(name);
    this.view = new VIEWS[data.view](this);
    this.time = data.shifts.length ? Math.min(data.shifts[0] + 0.6, data.duration) : 0;
    this.makeCharts();
    this.listen();
    this.choose();
  }

  /** The episode of a policy, unpacked when it is first asked for. */
  episode(name) {
    if (!name) return null;
    if (!this.known[name]) {
      const { posture, thrust, error, effort, lost } = this.data.episodes[name];
      this.known[name] = {
        name,
        lost,
        posture: unpacked(posture),
        thrust: thrust && unpacked(thrust),
        error: unpacked(error),
        effort: unpacked(effort),
      };
    }
    return this.known[name];
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
    const scored = this.shown.flatMap(({ error }) => error.filter(late));
    // All may be lost before anything is scored.
    const seen = scored.length ? scored : this.shown.flatMap(({ error }) => error);
    const largest = seen.reduce((most, parts) => Math.max(most, Math.hypot(...parts)), 1e-7);
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
    this.view.draw(this.a, this.time);
    this.drawLens();
    this.writeErrors();
    this.writeReadout();
    this.movePlayheads();
  }

  /** Where the reference is, the middle of the view, and what follows the path, m. */
  placeAt(episode, time) {
    const reference = rowAt(this.path, time / this.data.frame, true);
    const error = rowAt(episode.error, this.sample(time), true);
    const middle = MIDDLES[this.data.follower](reference);
    return { reference, middle, position: reference.map((part, axis) => part + error[axis]) };
  }

  /** Where what follows the path has been up to a time, m. */
  trail(episode, time) {
    const past = this.path.slice(0, Math.floor(time / this.data.frame) + 1);
    return [...past.map((_, k) => this.placeAt(episode, k * this.data.frame).position), this.placeAt(episode, time).position];
  }

  lostAt(episode, time) {
    return episode.lost && this.sample(time) >= episode.error.length - 1;
  }

  /** The error of what follows the path, magnified; the reference is in the middle. */
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
    const mark = (error) => {
      const [x, y] = this.view.flat(error);
      const size = Math.max(Math.hypot(x, y) / this.scale, 1);
      return [middle[0] + (reach * x) / this.scale / size, middle[1] - (reach * y) / this.scale / size];
    };
    disc(context, middle, 2.5, style("--reference"));
    for (const [episode, colour] of [[this.b, "--b"], [this.a, "--a"]]) {
      if (!episode) continue;
      const last = clamp(Math.round(this.sample(this.time)), 0, episode.error.length - 1);
      const first = Math.max(0, last - Math.round(LENS_PAST / this.data.period));
      line(context, episode.error.slice(first, last + 1).map(mark), style(colour), 1.5);
      MARKS[this.data.follower](context, mark(episode.error[last]), 5, style(colour), style("--surface"));
    }
    const times = three(reach / this.scale / this.view.metre);
    this.find(".lens-scale").textContent =
      `${this.view.seen}, ${times} times as large; the outer ring is ${three(1e3 * this.scale)} mm away.`;
  }

  writeErrors() {
    for (const [name, episode] of [["a", this.a], ["b", this.b]]) {
      const row = this.find(`.now tr.${name}`);
      row.hidden = !episode;
      if (!episode) continue;
      const lost = this.lostAt(episode, this.time);
      const error = rowAt(episode.error, Math.round(this.sample(this.time)), false);
      row.cells[0].textContent = episode.name;
      this.data.axes.forEach((_, axis) => {
        row.cells[axis + 1].textContent = lost ? "lost" : (1e3 * error[axis]).toFixed(this.data.axes.length > 2 ? 2 : 3);
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
    const errors = this.data.axes.map((axis) => `error in ${axis}, mm`);
    this.charts = [...errors, "mean thrust, N"].map((label) => {
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
      ...this.data.axes.map((_, axis) => (episode, k) => 1e3 * episode.error[k][axis]),
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
      const error = [...episode.error[index]].map((part) => three(1e3 * part)).join(", ");
      const thrust = episode.effort[index];
      return `${episode.name} ${error} mm${thrust ? `, ${three(thrust[0])} N` : ""}`;
    });
    this.readout.textContent = [`${this.sampleTime(index).toFixed(2)} s`, ...said].join(" · ");
  }
}
