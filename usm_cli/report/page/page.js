"use strict";

document.querySelectorAll("main table:not(.now)").forEach(makeSortable);
document.querySelectorAll("[role=tablist]").forEach(makeTabs);
document.querySelectorAll(".scroll").forEach(makeHint);
document.querySelectorAll("[data-plot]").forEach(makePlot);
const replays = [...document.querySelectorAll("[data-replay]")].map((host) => new Replay(host));

// Paper is light whatever the screen is.
for (const query of ["(prefers-color-scheme: dark)", "print"]) {
  matchMedia(query).addEventListener("change", () => {
    colours.clear();
    redrawCharts();
    replays.forEach((replay) => replay.draw());
  });
}
