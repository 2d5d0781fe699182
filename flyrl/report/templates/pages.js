"use strict";
// Tables that sort by a click on a heading.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  table.querySelectorAll("th").forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    const value = (row) => {
      const cell = row.cells[column];
      const text = cell.dataset.value ?? cell.textContent.trim();
      const number = Number(text);
      return text === "" ? null : Number.isNaN(number) ? text : number;
    };
    button.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") !== "descending";
      table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows].sort((a, b) => {
        const [x, y] = [value(a), value(b)];
        if (x === null || y === null) return (x === null) - (y === null); // missing: last, always
        const order = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y));
        return down ? -order : order;
      });
      body.append(...rows);
    });
  });
}

// One page at a time: the one that the address names, or that holds what it names.
const pages = [...document.querySelectorAll("main > .page")];

function showPage() {
  const [name] = decodeURIComponent(location.hash.slice(1)).split("=");
  const target = document.getElementById(name === "episode" ? "episodes" : name);
  const page = target?.closest("main > .page") ?? pages[0];
  const isOther = page.hidden;
  for (const each of pages) each.hidden = each !== page;
  for (const link of document.querySelectorAll(".pages a")) {
    if (link.hash === `#${page.id}`) {
      link.setAttribute("aria-current", "page");
      link.parentElement.scrollLeft = link.offsetLeft; // on a phone not all are in sight
    } else link.removeAttribute("aria-current");
  }
  if (target && target !== page) target.scrollIntoView();
  else if (isOther && page.getBoundingClientRect().top < 0) page.scrollIntoView({ behavior: "instant" });
}

window.addEventListener("hashchange", showPage);
showPage();
