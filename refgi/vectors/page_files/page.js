"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const $ = id => document.getElementById(id);
const state = {array: null, show: "difference", plane: "all"};

function floats(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

const number = x => x === null || x === undefined ? "" : Number.isInteger(x) ? String(x) : x.toPrecision(9).replace(/\.?0+($|e)/, "$1");

function openStage(key) {
  const stage = data.stages[key];
  if (!stage) return;
  document.querySelectorAll("[data-stage]").forEach(b => b.setAttribute("aria-pressed", b.dataset.stage === key));
  $("detail").hidden = false;
  $("title").textContent = `${key}: ${stage.verdict}`;
  $("what").textContent = [stage.what, stage.paper].filter(Boolean).join(". ");
  $("causes").replaceChildren(...stage.causes.map(c => {
    const item = document.createElement("li");
    item.textContent = `likely: ${c.cause} (${Math.round(100 * c.share)} % of what differs${c.paper ? "; " + c.paper : ""})`;
    return item;
  }));
  $("arrays").replaceChildren(...stage.arrays.map(a => {
    const row = document.createElement("tr");
    const cells = [a.name, a.verdict, a.worst === null ? "" : a.worst.toPrecision(3), a.element ? a.element.join(", ") : "",
      number(a.expected_value), number(a.got_value), a.bound === null ? "" : a.bound.toPrecision(2), a.outside, a.said];
    cells.forEach((text, k) => {
      const cell = document.createElement("td");
      if (k === 0 && a.got) {
        const button = document.createElement("button");
        button.type = "button"; button.textContent = text; button.onclick = () => openArray(a);
        cell.append(button);
      } else cell.textContent = text;
      if (k === 1) cell.className = a.verdict;
      row.append(cell);
    });
    return row;
  }));
  $("viewer").hidden = true;
  const first = stage.arrays.find(a => a.got && a.verdict === "out") || stage.arrays.find(a => a.got);
  if (first) openArray(first);
}

function openArray(a) {
  if (!a.values) {
    const [expected, got, bound] = [floats(a.expected), floats(a.got), floats(a.limit)];
    a.values = {expected, got, bound};
  }
  state.array = a;
  const shape = a.shape.length > 1 ? a.shape : [1, ...a.shape];
  a.rows = shape.at(-2); a.columns = shape.at(-1); a.planes = a.expectedCount === 0 ? 0 : a.values.expected.length / (a.rows * a.columns);
  $("viewer").hidden = false;
  $("name").textContent = a.name;
  $("axes").textContent = `[${a.axes}] ${a.shape.join(" x ")}, ${a.unit === "1" ? "" : a.unit + ", "}${a.what}`;
  const names = a.planes === 3 ? ["all", 0, 1, 2] : [...Array(a.planes).keys()];
  $("plane").replaceChildren(...names.map(k => new Option(k === "all" ? "all three as colour" : `${k}`, k)));
  state.plane = a.planes === 3 ? "all" : "0";
  draw();
}

function valueAt(kind, k) {
  const {expected, got, bound} = state.array.values;
  if (kind === "expected" || kind === "got") return state.array.values[kind][k];
  const off = Math.abs(got[k] - expected[k]);
  if (expected[k] === got[k]) return 0;
  if (!Number.isFinite(off)) return Infinity;
  return kind === "difference" ? off : off / Math.max(bound[k], 1e-30);
}

function draw() {
  const a = state.array, size = a.rows * a.columns;
  document.querySelectorAll("[data-show]").forEach(b => b.setAttribute("aria-pressed", b.dataset.show === state.show));
  const planes = state.plane === "all" ? [0, 1, 2] : [Number(state.plane)];
  let low = Infinity, high = -Infinity;
  const shared = state.show === "expected" || state.show === "got" ? ["expected"] : [state.show];
  for (const kind of shared) for (const p of planes) for (let k = 0; k < size; k++) {
    const v = valueAt(kind, p * size + k);
    if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
  }
  if (state.show === "over") { low = 0; high = 1; }
  if (state.show === "difference") low = 0;
  const span = high > low ? high - low : 1;
  const canvas = $("canvas"), context = canvas.getContext("2d");
  canvas.width = a.columns; canvas.height = a.rows;
  const scale = Math.max(1, Math.min(24, Math.floor(720 / a.columns), Math.floor(560 / a.rows) || 1));
  canvas.style.width = `${a.columns * scale}px`;
  if (!size) return;
  const image = context.createImageData(a.columns, a.rows);
  for (let k = 0; k < size; k++) {
    for (let c = 0; c < 3; c++) {
      const v = valueAt(state.show, (planes[c] ?? planes[0]) * size + k);
      image.data[4 * k + c] = Number.isFinite(v) ? 255 * Math.min(1, Math.max(0, (v - low) / span)) : (c === 1 ? 0 : 255);
    }
    image.data[4 * k + 3] = 255;
  }
  context.putImageData(image, 0, 0);
}

$("canvas").addEventListener("pointermove", event => {
  const a = state.array, box = event.target.getBoundingClientRect();
  const column = Math.min(a.columns - 1, Math.floor((event.clientX - box.left) / box.width * a.columns));
  const row = Math.min(a.rows - 1, Math.floor((event.clientY - box.top) / box.height * a.rows));
  const planes = state.plane === "all" ? [0, 1, 2] : [Number(state.plane)], at = p => p * a.rows * a.columns + row * a.columns + column;
  const told = kind => planes.map(p => number(valueAt(kind, at(p)))).join("  ");
  $("value").textContent = `row ${row}, column ${column}: expected ${told("expected")}; here ${told("got")}; ` +
    `difference ${planes.map(p => valueAt("difference", at(p)).toPrecision(3)).join("  ")}; bound ${planes.map(p => a.values.bound[at(p)].toPrecision(2)).join("  ")}`;
});
document.querySelectorAll("[data-stage]").forEach(b => b.addEventListener("click", () => { history.replaceState(null, "", "#" + b.dataset.stage); openStage(b.dataset.stage); $("detail").scrollIntoView(); }));
document.querySelectorAll("[data-show]").forEach(b => b.addEventListener("click", () => { state.show = b.dataset.show; draw(); }));
$("plane").addEventListener("change", event => { state.plane = event.target.value; draw(); });
addEventListener("keydown", event => {
  const show = {1: "expected", 2: "got", 3: "difference", 4: "over"}[event.key];
  if (show && state.array && event.target.tagName !== "SELECT") { state.show = show; draw(); }
});
addEventListener("hashchange", () => openStage(decodeURIComponent(location.hash.slice(1))));
openStage(location.hash ? decodeURIComponent(location.hash.slice(1)) : data.first);
