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
