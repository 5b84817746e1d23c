"use strict";
/* One viewer a scene. Its state: scale s and offset x, y in units of a picture's width and height; what is shown of
   the pictures, on which scale; the two that are compared; the pixel that is read. */

const MOST = 64;
const SEEN_SHARE = 0.95; // of the pixels in sight that `Fit` brings onto the scale
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

class Viewer {
  constructor(root, album) {
    const find = (selector) => root.querySelector(selector);
    this.root = root;
    this.scene = new Scene(album.views[root.dataset.view], album.planes);
    this.quantities = album.quantities;
    Object.assign(this, { s: 1, x: 0, y: 0, quantity: "picture", key: "truth", stops: {}, pixel: null, stamp: 0 });
    this.pair = find(".pair");
    [this.left, this.right, this.judge] = [".left", ".right", ".judge"].map((name) => find(`select${name}`));
    [this.divide, this.slider] = [find(".divide input"), find(".stops")];
    this.canvases = new Map(); // canvas: what it shows
    this.sight = new IntersectionObserver((entries) => {
      for (const entry of entries) this.canvases.get(entry.target).inSight = entry.isIntersecting;
      this.redraw();
    }, { rootMargin: "200px" });
    this.rows = readoutRows(this);
    buildGallery(this);
    listen(this);
    for (const canvas of this.pair.querySelectorAll("canvas")) this.add(canvas, null);
    this.showPair();
    this.showQuantity();
    this.moved();
  }

  open() {
    this.opened ??= this.scene.open((item) => {
      this.rows.get(item).classList.toggle("coarse", item.light.level > 0);
      this.changed();
    }).catch((error) => {
      this.root.querySelector(".pixel").textContent = `The pictures cannot be unpacked: ${error.message}`;
      throw error;
    });
    return this.opened;
  }

  item(name) {
    return this.scene.items.find((one) => one.name === name);
  }

  add(canvas, item) {
    this.canvases.set(canvas, { item, stamp: -1, inSight: false });
    this.sight.observe(canvas);
  }

  /* All pictures look different now. */
  changed() {
    this.stamp++;
    this.redraw();
    showPixel(this);
  }

  redraw() {
    this.pending ??= requestAnimationFrame(() => {
      this.pending = undefined;
      for (const [canvas, shown] of this.canvases) {
        if (shown.inSight && shown.item.ready && shown.stamp !== this.stamp) {
          shown.stamp = this.stamp;
          paint(canvas, this.scene, this.painter(shown.item));
        }
      }
      showCrops(this);
    });
  }

  painter(item) {
    return this.quantities[this.quantity].painter(this.scene, item, this.key, this.stops[this.quantity] ?? 0);
  }

  /* Scale and offset changed. */
  moved() {
    this.s = clamp(this.s, 1, MOST);
    this.x = clamp(this.x, 1 - this.s, 0);
    this.y = clamp(this.y, 1 - this.s, 0);
    for (const key of ["s", "x", "y"]) this.root.style.setProperty(`--${key}`, this[key]);
    this.root.classList.toggle("zoomed", this.s > 1);
    this.root.classList.toggle("pixelated", this.s * this.pair.clientWidth > 1.5 * this.scene.width);
    this.root.querySelector(".zoom output").textContent = `${Math.round(100 * this.s)} %`;
  }

  /* Zoom by a factor about the point (u, v) of the view, both 0 to 1. */
  zoom(factor, u = 0.5, v = 0.5) {
    const s = clamp(this.s * factor, 1, MOST);
    this.x = u - (u - this.x) * s / this.s;
    this.y = v - (v - this.y) * s / this.s;
    this.s = s;
    this.moved();
  }

  goTo({ x, y, side }) {
    const { width, height } = this.scene;
    this.s = clamp(0.7 * Math.min(width, height) / side, 1, MOST);
    this.x = 0.5 - this.s * (x + side / 2) / width;
    this.y = 0.5 - this.s * (y + side / 2) / height;
    this.moved();
    this.read(x + side / 2, y + side / 2);
  }

  /* Read the pixel at a place in pixels. */
  read(x, y) {
    const { width, height } = this.scene;
    this.pixel = [clamp(Math.floor(x), 0, width - 1), clamp(Math.floor(y), 0, height - 1)];
    this.root.style.setProperty("--px", (this.pixel[0] + 0.5) / width);
    this.root.style.setProperty("--py", (this.pixel[1] + 0.5) / height);
    this.root.classList.add("reads");
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      showPixel(this);
    });
  }

  /* Show a picture on the left, and name it in the address. */
  show(name) {
    this.left.value = name;
    history.replaceState(null, "", `#${name}`);
    this.open();
    this.showPair();
  }

  swap() {
    [this.left.value, this.right.value] = [this.right.value, this.left.value];
    this.showPair();
  }

  step(by) {
    const count = this.scene.items.length;
    this.left.selectedIndex = (this.left.selectedIndex + by + count) % count;
    this.showPair();
  }

  showPair() {
    const canvases = this.pair.querySelectorAll("canvas");
    for (const [i, select, tag] of [[0, this.left, ".left"], [1, this.right, ".right"]]) {
      const shown = this.canvases.get(canvases[i]);
      Object.assign(shown, { item: this.item(select.value), stamp: -1 });
      canvases[i].setAttribute("aria-label", `${shown.item.label}. ${shown.item.said}`);
      this.pair.querySelector(`.tag${tag}`).textContent = shown.item.label;
    }
    for (const [item, row] of this.rows) row.classList.toggle("chosen", item.name === this.left.value);
    describe(this, this.item(this.left.value));
    this.redraw();
  }

  showQuantity() {
    const quantity = this.quantities[this.quantity];
    const stops = this.stops[this.quantity] ?? 0;
    this.root.dataset.quantity = this.quantity;
    this.slider.value = stops;
    this.root.querySelector(".slider-name").textContent = quantity.slider;
    this.root.querySelector(".exposure output").textContent = `${stops > 0 ? "+" : stops < 0 ? "−" : ""}${short(Math.abs(stops))} stops`;
    showLegend(this, quantity, quantity.base(this.scene) * 2 ** stops);
    this.changed();
  }

  setStops(stops) {
    this.stops[this.quantity] = clamp(Math.round(4 * stops) / 4, -12, 12);
    this.showQuantity();
  }

  /* Bring most pixels of the left picture that are in sight onto the scale. */
  fit() {
    const item = this.item(this.left.value);
    if (!item.ready) return;
    const quantity = this.quantities[this.quantity];
    const value = quantity.brightness(this.scene, item, this.key);
    const { width, height } = this.scene;
    const found = [];
    const [right, bottom] = [(1 - this.x) / this.s * width, (1 - this.y) / this.s * height].map(Math.floor);
    for (let y = Math.floor(-this.y / this.s * height); y < Math.min(bottom, height); y++) {
      for (let x = Math.floor(-this.x / this.s * width); x < Math.min(right, width); x++) {
        const v = value(x, y);
        if (v > 0 && Number.isFinite(v)) found.push(v);
      }
    }
    found.sort((a, b) => a - b);
    if (found.length) this.setStops(quantity.fitted(this.scene, found[Math.floor(SEEN_SHARE * (found.length - 1))]));
  }
}
