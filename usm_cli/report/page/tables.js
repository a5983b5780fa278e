"use strict";

const VERDICTS = { y: "yes", n: "no", u: "undecided", f: "too few" };

/** Let the buttons in a table's head sort its rows; a second press turns the order round. */
function makeSortable(table) {
  const heads = [...table.tHead.rows[0].cells].filter((head) => head.querySelector("button"));
  const body = table.tBodies[0];
  const first = [...body.rows];
  const showRival = makeRivals(table, first);
  const value = (row, column) => {
    const text = row.cells[column].dataset.value;
    const number = Number(text);
    return Number.isNaN(number) ? text : number;
  };
  const compare = (a, b) =>
    typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b));
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const rising = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach((each) => each.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", rising ? "ascending" : "descending");
      const sign = rising ? 1 : -1;
      const rows = [...body.rows];
      rows.sort((a, b) => sign * compare(value(a, column), value(b, column)));
      body.append(...rows);
      showRival(rows.every((row, k) => row === first[k]));
    });
  });
}

/**
 * Fill the column that says whether a row beats another, chosen in its head.
 *
 * Gives a function that shows it, or hides it where the next row is not the next in rank.
 */
function makeRivals(table, rows) {
  const select = table.querySelector("[data-rivals]");
  if (!select) return () => {};
  const data = JSON.parse(document.getElementById(select.dataset.rivals).textContent);
  const place = new Map(data.names.map((name, k) => [name, k]));
  let inOrder = true;
  const show = () => {
    const shown = inOrder || select.value !== "";
    table.closest(".choice").classList.toggle("no-beats", !shown);
    rows.forEach((row) => {
      const own = place.get(row.cells[0].dataset.name);
      const rival = select.value ? place.get(select.value) : own + 1 < data.competing ? own + 1 : own;
      row.cells[row.cells.length - 1].textContent =
        rival === own ? "" : `${VERDICTS[data.verdicts[own][rival]]}, ${data.chances[own][rival]} %`;
    });
  };
  select.addEventListener("change", show);
  show();
  return (ordered) => { inOrder = ordered; show(); };
}

/** Show the table whose tab is selected, and hide the others; arrow keys go from tab to tab. */
function makeTabs(list) {
  const tabs = [...list.children];
  const choose = (chosen) => tabs.forEach((tab) => {
    const on = tab === chosen;
    tab.setAttribute("aria-selected", on);
    tab.tabIndex = on ? 0 : -1;
    document.getElementById(tab.getAttribute("aria-controls")).hidden = !on;
  });
  const keys = { ArrowLeft: -1, ArrowRight: 1 };
  tabs.forEach((tab, k) => {
    tab.addEventListener("click", () => choose(tab));
    tab.addEventListener("keydown", ({ key }) => {
      if (!(key in keys)) return;
      const next = tabs[(k + keys[key] + tabs.length) % tabs.length];
      choose(next);
      next.focus();
    });
  });
  choose(tabs[0]);
}

/** Say that a table goes on to the right where it does. */
function makeHint(scroll) {
  const hint = scroll.previousElementSibling;
  const show = () => { hint.hidden = scroll.scrollWidth <= scroll.clientWidth; };
  const watch = new ResizeObserver(show);
  watch.observe(scroll);
  watch.observe(scroll.firstElementChild);
}
