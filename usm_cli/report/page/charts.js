"use strict";

// Colours by the name of their CSS property, kept until the colour scheme changes.
const colours = new Map();
function style(name) {
  if (!colours.has(name)) {
    colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  }
  return colours.get(name);
}

const three = (value) => Number(value.toPrecision(3)).toString();
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

const charts = [];
const redrawCharts = () => charts.forEach((chart) => chart.redraw());

/** The limits of some data with room around them, on a linear or logarithmic scale. */
function padded(low, high, log, share) {
  if (low === null || high === null) return log ? [0.1, 1] : [0, 1];
  if (log) {
    const factor = Math.max((high / low) ** share, 1.1);
    return [low / factor, high * factor];
  }
  const room = high > low ? (high - low) * share : Math.abs(high) || 1;
  return [low - room, high + room];
}

const onScale = (scale) => (scale.distr === 3 ? [Math.log10, (power) => 10 ** power] : [Number, Number]);

/** Marks of a logarithmic axis: the fewer decades are seen, the more. */
function decadeMarks(low, high) {
  const digits = high / low > 30 ? [1, 2, 5] : [1, 2, 3, 4, 5, 6, 7, 8, 9];
  const marks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
    digits.forEach((digit) => marks.push(Number(`${digit}e${power}`)));
  }
  return marks.filter((mark) => mark >= low && mark <= high);
}

/** Which of these marks are labelled. */
function decadeLabels(marks) {
  const decades = Math.log10(marks[marks.length - 1] / marks[0]);
  const digits = decades > 2 ? "1" : decades > 0.9 ? "125" : "123456789";
  return marks.map((mark) => (digits.includes(mark.toExponential()[0]) ? three(mark) : ""));
}

/** Zoom a chart, and those that share its x axis, about its cursor or middle; Infinity shows all. */
function zoom(chart, factor) {
  if (factor === Infinity) {
    chart.group.forEach((each) => each.setData(each.data, true));
    return;
  }
  const { left, top } = chart.cursor;
  for (const key of chart.zooms) {
    const scale = chart.scales[key];
    const [to, from] = onScale(scale);
    const [low, high] = [to(scale.min), to(scale.max)];
    const place = key === "x" ? left : top;
    const centre = place >= 0 ? to(chart.posToVal(place, key)) : (low + high) / 2;
    const limits = {
      min: from(centre - (centre - low) * factor),
      max: from(centre + (high - centre) * factor),
    };
    chart.group.forEach((each) => each.setScale(key, limits));
  }
}

/** Move the cursor to the next datum in x that is seen. */
function step(chart, by) {
  const [x, ...series] = chart.data;
  const seen = (i) =>
    x[i] >= chart.scales.x.min && x[i] <= chart.scales.x.max && series.some((y) => y[i] != null);
  let index = chart.cursor.idx ?? (by > 0 ? -1 : x.length);
  do index += by; while (index >= 0 && index < x.length && !seen(index));
  if (index < 0 || index >= x.length) return;
  for (const each of chart.group) {
    const y = each.data.slice(1).map((values) => values[index]).find((value) => value != null);
    each.setCursor({ left: each.valToPos(x[index], "x"), top: each.valToPos(y, "y") });
  }
}

const KEYS = {
  ArrowLeft: (chart, fast) => step(chart, fast ? -25 : -1),
  ArrowRight: (chart, fast) => step(chart, fast ? 25 : 1),
  "+": (chart) => zoom(chart, 0.5),
  "-": (chart) => zoom(chart, 2),
  0: (chart) => zoom(chart, Infinity),
};

/**
 * A chart with zoom and a cursor, for mouse, keys and buttons.
 *
 * host: where it goes; label: what it shows; data, series: as uPlot has them;
 * log: {x, y}; xLabel; height; zooms: scales that zoom; more: options and hooks besides.
 */
function makeChart(host, { label, data, series, log, xLabel, height, zooms, more = {} }) {
  const frame = document.createElement("div");
  frame.className = "chart";
  frame.tabIndex = 0;
  frame.setAttribute("role", "group");
  frame.setAttribute(
    "aria-label", `${label}. Arrow keys move the cursor, plus and minus zoom, 0 shows all.`
  );
  host.append(frame);
  const limits = (key, share) => (chart, low, high) => {
    const all = chart.data[0];
    const whole = key === "y" || (low === all[0] && high === all[all.length - 1]);
    return whole ? padded(low, high, log[key], share) : [low, high];
  };
  const axis = (key) => ({
    stroke: () => style("--quiet"),
    grid: { stroke: () => style("--rule"), width: 1 },
    ticks: { show: false },
    font: "12px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    values: (_, marks) => (log[key] ? decadeLabels(marks) : marks.map(three)),
    ...(log[key] && { splits: (_, __, low, high) => decadeMarks(low, high), filter: (_, marks) => marks }),
    ...(key === "y" ? { size: 52, space: 26 } : { size: 30, label: xLabel, labelSize: 20 }),
  });
  const chart = new uPlot(
    {
      width: Math.max(host.clientWidth, 200),
      height,
      legend: { show: false },
      scales: {
        x: { time: false, distr: log.x ? 3 : 1, range: limits("x", zooms.length > 1 ? 0.06 : 0) },
        y: { distr: log.y ? 3 : 1, range: limits("y", 0.08) },
      },
      axes: [axis("x"), axis("y")],
      series: [{}, ...series],
      ...more,
      cursor: {
        drag: { x: true, y: zooms.length > 1, uni: 20 },
        points: { size: 11, width: 2, stroke: () => style("--ink"), fill: "transparent" },
        ...more.cursor,
      },
    },
    data,
    frame
  );
  chart.zooms = zooms;
  chart.group = [chart];
  frame.addEventListener("keydown", (event) => {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(chart, event.shiftKey);
  });
  frame.addEventListener("blur", () =>
    chart.group.forEach((each) => each.setCursor({ left: -10, top: -10 })));
  new ResizeObserver(() => {
    if (host.clientWidth > 0) chart.setSize({ width: host.clientWidth, height });
  }).observe(host);
  charts.push(chart);
  return chart;
}

/** Buttons that zoom a chart, for those without a mouse. */
function makeZoomButtons(chart, label) {
  const bar = document.createElement("span");
  bar.className = "zoom";
  const actions = [["+", "Zoom in", 0.5], ["−", "Zoom out", 2], ["All", "Show all", Infinity]];
  for (const [text, name, factor] of actions) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.setAttribute("aria-label", `${name}: ${label}`);
    button.addEventListener("click", () => zoom(chart, factor));
    bar.append(button);
  }
  return bar;
}

/** An element with a class and, maybe, text. */
function element(tag, name, text = "") {
  const made = document.createElement(tag);
  made.className = name;
  made.textContent = text;
  return made;
}
