"use strict";

document.querySelectorAll("main table:not(.now)").forEach(makeSortable);
document.querySelectorAll("select[data-chooses]").forEach(makeChoice);
document.querySelectorAll("[data-plot]").forEach(makePlot);
const replays = [...document.querySelectorAll("[data-replay]")].map((host) => new Replay(host));

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  colours.clear();
  redrawCharts();
  replays.forEach((replay) => replay.draw());
});
