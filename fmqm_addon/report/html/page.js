"use strict";
// Sorts the table by the column whose button is pressed; again turns it around. Cells without a value stay last.
const table = document.querySelector(".scores");
const heads = [...table.tHead.rows[0].cells];
const numbers = new Intl.Collator(undefined, { numeric: true });

function compare(a, b, turned) {
  if (a === "" || b === "") return (a === "") - (b === "");
  const order = isNaN(a) || isNaN(b) ? numbers.compare(a, b) : a - b;
  return turned ? -order : order;
}

heads.forEach((head, column) => {
  head.querySelector("button").addEventListener("click", () => {
    const turned = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", turned ? "descending" : "ascending");
    const body = table.tBodies[0];
    const value = (row) => row.cells[column].dataset.value;
    body.append(...[...body.rows].sort((a, b) => compare(value(a), value(b), turned)));
  });
});
