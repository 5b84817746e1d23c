"use strict";
/* The page: its viewers, links that open pictures, tables that sort. */

function sortBy(table, column, button) {
  const header = button.closest("th");
  const turn = header.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  const body = table.tBodies[0];
  const value = (row) => row.cells[column].dataset.sort ?? row.cells[column].textContent.trim();
  const compare = (a, b) => {
    const [p, q] = [value(a), value(b)];
    if (p === "" || q === "") return (p === "") - (q === ""); // what is not known stands last either way
    const numbers = !Number.isNaN(Number(p)) && !Number.isNaN(Number(q));
    return turn * (numbers ? p - q : p.localeCompare(q));
  };
  body.append(...[...body.rows].sort(compare));
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", turn === 1 ? "ascending" : "descending");
}

function makeSortable(table) {
  [...table.tHead.rows[0].cells].forEach((header, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...header.childNodes);
    button.addEventListener("click", () => sortBy(table, column, button));
    header.append(button);
  });
}

/* Read the page again every so often, but not while somebody uses it. */
function refresh(seconds) {
  let touched = Date.now();
  for (const kind of ["pointermove", "keydown", "wheel"]) document.addEventListener(kind, () => { touched = Date.now(); });
  setInterval(() => { if (Date.now() - touched > 1000 * seconds) location.reload(); }, 1000 * seconds);
}

(() => {
  document.querySelectorAll("table.sortable").forEach(makeSortable);
  if (document.body.dataset.refresh) refresh(Number(document.body.dataset.refresh));
  const source = document.getElementById("album");
  if (!source) return;
  const album = JSON.parse(source.textContent);
  album.quantities = quantitiesOf(album);
  const viewers = [...document.querySelectorAll(".viewer")].map((root) => new Viewer(root, album));
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) viewers.find((one) => one.root === entry.target).open();
  }, { rootMargin: "400px" });
  viewers.forEach((one) => near.observe(one.root));
  Viewer.active = viewers[0];

  function openPicture(name) {
    const viewer = viewers.find((one) => one.item(name));
    if (!viewer) return false;
    Viewer.active = viewer;
    viewer.show(name);
    viewer.root.scrollIntoView({ block: "start" });
    return true;
  }

  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("[data-picture]");
    if (link && openPicture(link.dataset.picture)) event.preventDefault();
  });
  document.addEventListener("keydown", (event) => { if (Viewer.active) pageKey(Viewer.active, event); });
  if (location.hash) openPicture(location.hash.slice(1));
})();
