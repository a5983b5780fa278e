"use strict";

/** Let the buttons in a table's head sort its rows; a second press turns the order round. */
function makeSortable(table) {
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
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
    });
  });
}

/** Show the table that a select element names, and hide the others beside it. */
function makeChoice(select) {
  const choices = document.getElementById(select.dataset.chooses).querySelectorAll(".choice");
  const show = () => choices.forEach((each) => { each.hidden = each.dataset.choice !== select.value; });
  select.addEventListener("change", show);
  show();
}
