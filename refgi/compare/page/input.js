"use strict";
/* Pointer, wheel, keys and controls of a viewer. */

function place(view, event) {
  const box = view.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height, box];
}

function listen(viewer) {
  const { root, pair, divide } = viewer;
  for (const input of root.querySelectorAll(".tabs input")) {
    input.addEventListener("change", () => { viewer.quantity = input.value; viewer.showQuantity(); });
    if (input.checked) viewer.quantity = input.value;
  }
  for (const button of root.querySelectorAll("[data-zoom]")) {
    button.addEventListener("click", () => viewer.zoom(Number(button.dataset.zoom)));
  }
  viewer.judge.addEventListener("change", () => { viewer.key = viewer.judge.value; viewer.changed(); });
  viewer.slider.addEventListener("input", () => viewer.setStops(Number(viewer.slider.value)));
  root.querySelector(".fit").addEventListener("click", () => viewer.fit());
  for (const select of [viewer.left, viewer.right]) select.addEventListener("change", () => viewer.showPair());
  const showDivide = () => root.style.setProperty("--divide", `${divide.value}%`);
  divide.addEventListener("input", showDivide);
  pair.querySelector(".view").addEventListener("pointermove", (event) => {
    if (event.pointerType !== "mouse" || event.buttons) return;
    divide.value = 100 * place(event.currentTarget, event)[0];
    showDivide();
  });
  root.addEventListener("pointerenter", () => { Viewer.active = viewer; });
  root.addEventListener("focusin", () => { Viewer.active = viewer; });
  root.querySelectorAll(".view").forEach((view) => watch(viewer, view));
  showDivide();
}

function watch(viewer, view) {
  const held = new Map();
  view.addEventListener("wheel", (event) => {
    if (document.activeElement !== view && !event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    viewer.zoom(Math.exp(-0.002 * event.deltaY), ...place(view, event));
  }, { passive: false });
  view.addEventListener("dblclick", (event) => viewer.zoom(2, ...place(view, event)));
  view.addEventListener("pointerdown", (event) => {
    held.set(event.pointerId, event);
    view.focus({ preventScroll: true });
    if (viewer.s > 1) view.setPointerCapture(event.pointerId);
    readAt(viewer, view, event);
  });
  view.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return readAt(viewer, view, event);
    const [u, v, box] = place(view, event);
    if (held.size === 2) {
      const other = [...held.values()].find((e) => e.pointerId !== event.pointerId);
      const span = (e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY) || 1;
      viewer.zoom(span(event) / span(before), u, v);
    } else {
      viewer.x += (event.clientX - before.clientX) / box.width;
      viewer.y += (event.clientY - before.clientY) / box.height;
      viewer.moved();
    }
    held.set(event.pointerId, event);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    view.addEventListener(end, (event) => held.delete(event.pointerId));
  }
  view.addEventListener("dragstart", (event) => event.preventDefault());
  view.addEventListener("keydown", (event) => { if (viewKey(viewer, event)) event.preventDefault(); });
}

function readAt(viewer, view, event) {
  const [u, v] = place(view, event);
  viewer.read((u - viewer.x) / viewer.s * viewer.scene.width, (v - viewer.y) / viewer.s * viewer.scene.height);
}

/* Keys of a picture that has the focus: pan, zoom, and the pixel that is read. */
function viewKey(viewer, event) {
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const move = moves[event.key];
  if (move && event.shiftKey) {
    const [x, y] = viewer.pixel ?? [viewer.scene.width >> 1, viewer.scene.height >> 1];
    viewer.read(x + move[0], y + move[1]);
  } else if (move && viewer.s > 1) {
    viewer.x -= 0.1 * move[0];
    viewer.y -= 0.1 * move[1];
    viewer.moved();
  } else if (event.key === "+" || event.key === "=") viewer.zoom(1.5);
  else if (event.key === "-") viewer.zoom(1 / 1.5);
  else if (event.key === "0") viewer.zoom(0);
  else return false;
  return true;
}

/* Keys that work wherever the focus is, but where one types or chooses. */
function pageKey(viewer, event) {
  if (/^(SELECT|INPUT)$/.test(event.target.tagName) || event.ctrlKey || event.metaKey || event.altKey) return;
  const digit = "123456789".indexOf(event.key);
  if (event.key === "f" || event.key === "F") viewer.swap();
  else if (event.key === ".") viewer.step(1);
  else if (event.key === ",") viewer.step(-1);
  else if (digit >= 0 && digit < viewer.scene.items.length) viewer.show(viewer.scene.items[digit].name);
}
