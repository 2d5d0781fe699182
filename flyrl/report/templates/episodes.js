// The table of all episodes: unpacked when it is first shown.
const episodesPage = document.getElementById("episodes");
const rowsAtOnce = 10000; // few enough for the page to answer in between
let episodesTable = null; // the promise of it, with all its rows

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

// DataTables takes text for HTML
const escaped = (value) => (typeof value === "string" ? value.replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`) : value);

async function makeTable() {
  const [data, script, style] = await Promise.all(["rows-data", "table-script", "table-style"].map(unpacked));
  const sheet = document.createElement("style");
  sheet.textContent = style;
  document.head.prepend(sheet); // the report's own style has the last word
  const { jQuery } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const { keys, labels, rows } = JSON.parse(data);
  const isMissing = (value) => typeof value !== "number"; // then it is what is shown instead
  const missingLast = (way) => (a, b) => (isMissing(a) || isMissing(b) ? isMissing(a) - isMissing(b) : way * (a - b));
  jQuery.fn.dataTable.type("number", { order: { asc: missingLast(1), desc: missingLast(-1) } });
  const headings = document.getElementById("rows").createTHead().insertRow();
  for (const label of labels) {
    const heading = document.createElement("th");
    heading.scope = "col";
    heading.textContent = label;
    headings.append(heading);
  }
  const table = jQuery("#rows").DataTable({
    autoWidth: false, // it would measure every cell
    columns: keys.map((key, column) => {
      const isText = typeof rows[0][column] === "string";
      const names = isText ? [...new Set(rows.map((row) => row[column]))] : [];
      const list = { extend: "searchList", options: names.map((name) => ({ label: escaped(name), value: name })) };
      return {
        name: key,
        type: isText ? "string" : "number",
        className: isText ? "text" : "number",
        render: (value, kind) => (kind === "display" ? escaped(value) : value),
        defaultContent: "–",
        columnControl: ["order", isText ? { extend: "dropdown", icon: "search", content: [list] } : "searchDropdown"],
      };
    }),
    order: [],
    ordering: { indicators: false, handler: true },
    pageLength: 25,
    layout: { topStart: "info", topEnd: null, bottomStart: "pageLength", bottomEnd: "paging" },
  });
  for (let from = 0; from < rows.length; from += rowsAtOnce) {
    table.rows.add(rows.slice(from, from + rowsAtOnce)).draw(false);
    await new Promise((done) => setTimeout(done));
  }
  return table;
}

async function showEpisodes() {
  if (episodesPage.hidden) return;
  const state = episodesPage.querySelector(".state");
  try {
    state.textContent = "Unpacking the table …";
    const table = await (episodesTable ??= makeTable());
    state.textContent = "";
    showEpisode(table, /^#episode=(.*)\/(\d+)$/.exec(decodeURIComponent(location.hash)));
  } catch (error) {
    state.textContent = `The table cannot be shown (${error}); episodes.csv beside this file has the same rows.`;
  }
}

function showEpisode(table, asked) {
  const [, terrain, episode] = asked ?? [];
  const only = (name, wanted) => {
    const column = table.column(`${name}:name`);
    const place = column.index();
    column.search.fixed("asked", asked ? (_, row) => `${row[place]}` === wanted : null);
  };
  only("terrain", terrain);
  only("episode", episode);
  table.draw();
  const note = document.getElementById("episode");
  note.hidden = !asked;
  if (!asked) return;
  const row = table.row({ search: "applied" });
  const seed = row.any() ? table.cell(row.index(), "seed:name").data() : null;
  const which = note.querySelector(".which");
  which.textContent = seed === null
    ? `There is no episode ${episode} on ${terrain}.`
    : `Episode ${episode} on ${terrain}, drawn from seed ${seed}. `;
  if (seed === null) return;
  const filmed = episodesPage.dataset.filmed.split(" ").includes(`${terrain}/${episode}`);
  const watch = document.createElement(filmed ? "a" : "span");
  if (filmed) watch.href = `#videos-${terrain}-${episode}`;
  watch.textContent = filmed ? "Watch it" : `Not filmed: evaluate.py with film=[${episode}] films it.`;
  which.append(watch);
}

// Dots of figures: hundreds of them, not to be walked through with the keyboard
for (const link of document.querySelectorAll('svg a[href^="#episode="]')) {
  const title = document.createElementNS("http://www.w3.org/2000/svg", "title");
  title.textContent = decodeURIComponent(link.getAttribute("href").split("=")[1]).replace(/\/(\d+)$/, ", episode $1");
  link.append(title);
  link.setAttribute("tabindex", "-1");
}
const night = matchMedia("screen and (prefers-color-scheme: dark)");
// DataTables' style follows this class
const followNight = () => document.documentElement.classList.toggle("dark", night.matches);
night.addEventListener("change", followNight);
followNight();
window.addEventListener("hashchange", showEpisodes);
showEpisodes();
