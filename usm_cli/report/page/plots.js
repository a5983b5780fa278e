"use strict";

// Line styles go round with the colours, so that any number of curves can be told apart.
const COLOURS = ["--c0", "--c1", "--c2", "--c3", "--c4", "--c5", "--c6"];
const DASHES = [[], [6, 3], [2, 3]];
const colourOf = (number) => () => style(COLOURS[number % COLOURS.length]);

/** Caption, readout and zoom buttons of a panel; gives where its chart goes, and the readout. */
function makePanel(host, label) {
  const panel = element("figure", "panel");
  const caption = element("figcaption", "caption", label);
  const readout = element("output", "readout");
  panel.append(caption, readout);
  host.append(panel);
  return { panel, caption, readout };
}

/** Points with names, and lines between some. */
function drawPoints(host, data, { label, points, lines }) {
  const { panel, caption, readout } = makePanel(host, label);
  const all = [
    ...points.map((point) => ({ ...point, series: point.front ? 1 : 2 })),
    ...lines.flatMap((line, k) =>
      line.x.map((x, i) => ({ name: line.name, x, y: line.y[i], series: 3 + k }))),
  ].sort((a, b) => a.x - b.x);
  const column = (k) => all.map((point) => (point.series === k ? point.y : null));
  const values = [all.map((point) => point.x), column(1), column(2), ...lines.map((_, k) => column(3 + k))];
  const dots = (size, fill, stroke) => ({
    show: true, size, width: 1.5, fill: () => style(fill), stroke: () => style(stroke),
  });
  const nearest = (chart) => {
    const { left, top } = chart.cursor;
    const distance = ({ x, y }) =>
      Math.hypot(chart.valToPos(x, "x") - left, chart.valToPos(y, "y") - top);
    return all.reduce((best, _, i) => (distance(all[i]) < distance(all[best]) ? i : best), 0);
  };
  const chart = makeChart(panel, {
    label: `${label} against ${data.x.label}`,
    data: values,
    series: [
      { stroke: () => style("--a"), width: 1.5, dash: [4, 4], spanGaps: true, points: dots(9, "--a", "--a") },
      { paths: () => null, points: dots(8, "--surface", "--quiet") },
      ...lines.map(() => ({
        stroke: () => style("--b"), width: 1.2, spanGaps: true, points: dots(5, "--b", "--b"),
      })),
    ],
    log: { x: data.x.log, y: data.y.log },
    xLabel: data.x.label,
    height: 380,
    zooms: ["x", "y"],
    more: {
      cursor: { dataIdx: (chart, series) => { const i = nearest(chart); return all[i].series === series || series === 0 ? i : null; } },
      hooks: {
        setCursor: [(chart) => {
          const index = chart.cursor.idxs?.[0];
          const point = chart.cursor.left >= 0 && index != null ? all[index] : null;
          readout.textContent = point
            ? `${point.name}: ${three(point.x)} N/s, ${three(point.y)} mm` : "";
        }],
        draw: [(chart) => nameDots(chart, points)],
      },
    },
  });
  caption.append(makeZoomButtons(chart, label));
}

/** Write the names of points where there is room; those on the front come first. */
function nameDots(chart, points) {
  const { ctx, bbox } = chart;
  const unit = devicePixelRatio;
  ctx.save();
  ctx.font = `${11.5 * unit}px system-ui, sans-serif`;
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  const place = ({ x, y }) => [chart.valToPos(x, "x", true), chart.valToPos(y, "y", true)];
  const dot = 6 * unit;
  const taken = points.map(place).map(([x, y]) => [x - dot, y - dot, x + dot, y + dot]);
  const free = (box) =>
    box[0] >= bbox.left && box[2] <= bbox.left + bbox.width &&
    box[1] >= bbox.top && box[3] <= bbox.top + bbox.height &&
    !taken.some((other) => box[0] < other[2] && box[2] > other[0] && box[1] < other[3] && box[3] > other[1]);
  for (const point of [...points].sort((a, b) => b.front - a.front)) {
    const [x, y] = place(point);
    const width = ctx.measureText(point.name).width;
    const half = 7 * unit;
    const spots = [[x + dot + 2 * unit, y], [x - dot - 2 * unit - width, y], [x - width / 2, y - 2 * half], [x - width / 2, y + 2 * half]];
    const spot = spots.find(([left, middle]) => free([left, middle - half, left + width, middle + half]));
    if (!spot) continue;
    const [left, middle] = spot;
    taken.push([left, middle - half, left + width, middle + half]);
    ctx.fillStyle = style(point.front ? "--ink" : "--quiet");
    ctx.fillText(point.name, left, middle);
  }
  ctx.restore();
}

/** Curves with their intervals. */
function drawCurves(host, data, { label, series }, legend) {
  const { panel, caption, readout } = makePanel(host, label);
  const values = [series[0].x, ...series.flatMap((each) => [each.y, each.low, each.high])];
  const chart = makeChart(panel, {
    label: `${label} against ${data.x.label}`,
    data: values,
    series: series.flatMap((_, k) => [
      { stroke: colourOf(k), width: 2, dash: DASHES[Math.floor(k / COLOURS.length) % DASHES.length], points: { show: true, size: 6, fill: colourOf(k) } },
      { paths: uPlot.paths.linear(), width: 0, points: { show: false } },
      { paths: uPlot.paths.linear(), width: 0, points: { show: false } },
    ]),
    log: { x: data.x.log, y: data.y.log },
    xLabel: data.x.label,
    height: 340,
    zooms: ["x", "y"],
    more: {
      bands: series.map((_, k) => ({ series: [3 * k + 3, 3 * k + 2], fill: () => `color-mix(in srgb, ${style(COLOURS[k % COLOURS.length])} 18%, transparent)` })),
      hooks: {
        setCursor: [(chart) => {
          const index = chart.cursor.left >= 0 ? chart.cursor.idx : null;
          readout.textContent = index == null ? "" : [
            `${three(values[0][index])}`,
            ...series.map((each, k) => [each, k])
              .filter(([each, k]) => chart.series[3 * k + 1].show && each.y[index] != null)
              .map(([each]) => `${each.name} ${three(each.y[index])}`),
          ].join(" · ");
        }],
      },
    },
  });
  caption.append(makeZoomButtons(chart, label));
  legend.forEach((box, k) => box.addEventListener("change", () => {
    chart.batch(() => [1, 2, 3].forEach((part) => chart.setSeries(3 * k + part, { show: box.checked })));
  }));
}

/** Boxes that show and hide the curves of all panels. */
function makeLegend(host, series) {
  const legend = element("p", "bar legend");
  const boxes = series.map(({ name }, k) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    const swatch = element("span", `swatch dash-${Math.floor(k / COLOURS.length) % DASHES.length}`);
    swatch.style.setProperty("--swatch", `var(${COLOURS[k % COLOURS.length]})`);
    label.append(box, swatch, name);
    legend.append(label);
    return box;
  });
  host.before(legend);
  return boxes;
}

function makePlot(host) {
  const data = JSON.parse(document.getElementById(`${host.dataset.plot}-data`).textContent);
  if (data.kind === "points") {
    data.panels.forEach((panel) => drawPoints(host, data, panel));
    return;
  }
  const legend = makeLegend(host, data.panels[0].series);
  data.panels.forEach((panel) => drawCurves(host, data, panel, legend));
}
