"use strict";
/* What stands around the pair: the gallery, the numbers at a pixel, what is known of the left picture, the legend. */

const ABOUT = {
  picture: "What the camera sees: direct and indirect light, sRGB, at the exposure of the scene.",
  indirect: "Indirect irradiance alone, as on white surfaces; one exposure for all.",
  error: "Luminance of the indirect irradiance less that of the reference. Of the references: their standard error.",
  relative: "The same over the reference’s luminance at each pixel.",
  false: "Luminance of the indirect irradiance, logarithmic.",
};

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function buildGallery(viewer) {
  const { width, height, items } = viewer.scene;
  for (const item of items) {
    const canvas = element("canvas", { role: "img", "aria-label": `${item.label}. ${item.said}`, width, height });
    const view = element("div", { class: "view", tabindex: 0, role: "group", "aria-label": item.label }, canvas, element("i", { class: "spot" }));
    view.style.aspectRatio = `${width}/${height}`;
    const names = item.findings?.map((one) => element("em", { title: one.about }, one.name)) ?? [];
    const choose = element("button", { type: "button", class: "choose" }, item.label);
    choose.addEventListener("click", () => viewer.show(item.name));
    viewer.root.querySelector(".gallery").append(element("figure", { "data-name": item.name }, view,
      element("figcaption", {}, choose, " ", element("span", {}, item.said), ...names)));
    viewer.add(canvas, item);
  }
}

/* One row a picture, by picture. */
function readoutRows(viewer) {
  const body = viewer.root.querySelector(".readout tbody");
  const rows = new Map();
  for (const item of viewer.scene.items) {
    const row = element("tr", { "data-name": item.name }, element("th", { scope: "row" }, item.label));
    for (let i = 0; i < 8; i++) row.append(element("td"));
    row.addEventListener("click", () => viewer.show(item.name));
    body.append(row);
    rows.set(item, row);
  }
  return rows;
}

/* The numbers of every picture at the pixel. */
function showPixel(viewer) {
  const { scene, pixel, key, rows, root } = viewer;
  if (!pixel || !scene.covered) return;
  const [x, y] = pixel;
  const ids = scene.idsAt(x, y).map(([name, id]) => `${name} ${id}`);
  const what = scene.isCovered(x, y) ? ids : ["no surface"];
  root.querySelector(".pixel").textContent = [`Pixel ${x}, ${y}`, ...what].join(" · ");
  for (const [item, row] of rows) {
    if (!item.ready) continue;
    const rgb = [0, 1, 2];
    const error = scene.errorOf(item, key)(x, y);
    const relative = scene.relativeErrorOf(item, key)(x, y);
    const sign = item.key ? "±" : error > 0 ? "+" : "";
    const percent = `${short(100 * relative)} %`;
    const numbers = [...rgb.map((c) => short(scene.irradiance(item, c, x, y))),
      ...rgb.map((c) => short(scene.radiance(item, c, x, y))), sign + short(error), sign + percent];
    numbers.forEach((text, i) => { row.cells[i + 1].textContent = text; });
  }
}

/* What is known of a picture: figures, findings, how coarse it is, and its worst places. */
function describe(viewer, item) {
  const find = (selector) => viewer.root.querySelector(`aside ${selector}`);
  find(".name").textContent = item.label;
  const level = viewer.scene.facts[item.irradiance].level;
  const side = 2 ** level;
  const coarse = level ? ` To keep this file small it holds means over ${side} × ${side} pixels of this picture.` : "";
  find(".said").textContent = `${item.said}.${coarse}`;
  find(".findings").replaceChildren(...(item.findings ?? []).map(
    (one) => element("li", {}, element("strong", {}, one.name), ` ${one.about}`)));
  find(".crops").replaceChildren(...(item.crops ?? []).map((crop) => cropButton(viewer, crop)));
  viewer.crops = item.crops ?? [];
}

function cropButton(viewer, crop) {
  const share = `${Math.round(100 * crop.share)} %`;
  const said = `${share} of the squared error in ${crop.side} × ${crop.side} pixels at ${crop.x}, ${crop.y}`;
  const canvases = ["left", "right"].map((side) => element("canvas", { class: side, width: crop.side, height: crop.side }));
  const button = element("button", { type: "button", "aria-label": `Show ${said}`, title: said }, ...canvases, element("span", {}, share));
  button.addEventListener("click", () => viewer.goTo(crop));
  return button;
}

/* The worst places, cut out of both pictures of the pair. */
function showCrops(viewer) {
  const pair = viewer.pair.querySelectorAll("canvas");
  viewer.root.querySelectorAll(".crops button").forEach((button, i) => {
    const { x, y, side } = viewer.crops[i];
    button.querySelectorAll("canvas").forEach((canvas, which) => {
      const source = pair[which];
      if (source.width === viewer.scene.width) {
        canvas.getContext("2d").drawImage(source, x, y, side, side, 0, 0, side, side);
      }
    });
  });
}

function showLegend(viewer, quantity, largest) {
  const ramp = viewer.root.querySelector(".ramp");
  viewer.root.querySelector(".explained").textContent = ABOUT[viewer.quantity];
  ramp.hidden = !quantity.unit;
  if (ramp.hidden) return;
  const colours = [0, 32, 64, 96, 128, 160, 192, 224, 255].map((i) => `rgb(${quantity.colours[i].join(",")})`);
  const ticks = quantity.ticks(largest).map(short);
  ramp.querySelector(".bar").style.background = `linear-gradient(90deg,${colours.join(",")})`;
  ramp.querySelector(".ticks").replaceChildren(...ticks.map((text) => element("span", {}, text)));
  ramp.querySelector(".unit").textContent = quantity.unit;
  ramp.setAttribute("aria-label", `Colours from ${ticks[0]} to ${ticks.at(-1)}, ${quantity.unit}`);
}
