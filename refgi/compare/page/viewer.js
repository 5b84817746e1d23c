"use strict";
/* One view state for all pictures: scale s and offset x, y in units of a picture's width and height. */
(() => {
  const viewer = document.getElementById("viewer");
  const pair = viewer.querySelector(".pair");
  const figures = [...viewer.querySelectorAll(".gallery figure")];
  const [left, right] = ["left", "right"].map((id) => document.getElementById(id));
  const divide = document.getElementById("divide");
  const stops = document.getElementById("stops");
  const state = { s: 1, x: 0, y: 0, quantity: "picture" };
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
  const MOST = 64;

  function showView() {
    state.s = clamp(state.s, 1, MOST);
    state.x = clamp(state.x, 1 - state.s, 0);
    state.y = clamp(state.y, 1 - state.s, 0);
    for (const key of ["s", "x", "y"]) viewer.style.setProperty(`--${key}`, state[key]);
    viewer.classList.toggle("zoomed", state.s > 1);
    const first = figures[0].querySelector("img");
    viewer.classList.toggle("pixelated", state.s * first.clientWidth > 1.5 * first.naturalWidth);
    document.getElementById("zoom-said").textContent = `${Math.round(100 * state.s)} %`;
  }

  /* Zoom by a factor about the point (u, v) of the view, both 0 to 1. */
  function zoom(factor, u = 0.5, v = 0.5) {
    const s = clamp(state.s * factor, 1, MOST);
    state.x = u - (u - state.x) * s / state.s;
    state.y = v - (v - state.y) * s / state.s;
    state.s = s;
    showView();
  }

  function place(view, event) {
    const box = view.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height, box];
  }

  function watch(view) {
    const held = new Map();
    view.addEventListener("wheel", (event) => {
      if (document.activeElement !== view && !event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      const [u, v] = place(view, event);
      zoom(Math.exp(-0.002 * event.deltaY), u, v);
    }, { passive: false });
    view.addEventListener("dblclick", (event) => {
      const [u, v] = place(view, event);
      zoom(2, u, v);
    });
    view.addEventListener("pointerdown", (event) => {
      held.set(event.pointerId, event);
      view.focus({ preventScroll: true });
      if (state.s > 1) view.setPointerCapture(event.pointerId);
    });
    view.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const [u, v, box] = place(view, event);
      if (held.size === 2) {
        const other = [...held.values()].find((e) => e.pointerId !== event.pointerId);
        const span = (e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY) || 1;
        zoom(span(event) / span(before), u, v);
      } else {
        state.x += (event.clientX - before.clientX) / box.width;
        state.y += (event.clientY - before.clientY) / box.height;
        showView();
      }
      held.set(event.pointerId, event);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      view.addEventListener(end, (event) => held.delete(event.pointerId));
    }
    view.addEventListener("dragstart", (event) => event.preventDefault());
    view.addEventListener("keydown", (event) => {
      const step = 0.1;
      const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
      if (event.key in moves && state.s > 1) {
        state.x += moves[event.key][0];
        state.y += moves[event.key][1];
        showView();
      } else if (event.key === "+" || event.key === "=") zoom(1.5);
      else if (event.key === "-") zoom(1 / 1.5);
      else if (event.key === "0") zoom(0);
      else return;
      event.preventDefault();
    });
  }

  function imageOf(name) {
    const figure = figures.find((f) => f.dataset.name === name);
    return figure.querySelector(`img[data-q="${state.quantity}"]`) || figure.querySelector('img[data-q="error"]');
  }

  function showPair() {
    for (const [select, side, tag] of [[left, ".a", ".left"], [right, ".b", ".right"]]) {
      const source = imageOf(select.value);
      const shown = pair.querySelector(side);
      shown.src = source.src;
      shown.alt = source.alt;
      pair.querySelector(`.tag${tag}`).textContent = select.selectedOptions[0].textContent;
    }
  }

  function showDivide() {
    viewer.style.setProperty("--divide", `${divide.value}%`);
  }

  function showQuantity() {
    viewer.dataset.quantity = state.quantity;
    for (const element of viewer.querySelectorAll("[data-q]")) {
      const chosen = element.dataset.q === state.quantity;
      element.style.display = chosen ? (element.classList.contains("none") ? "flex" : "block") : "none";
    }
    const lit = state.quantity === "picture" || state.quantity === "indirect";
    stops.disabled = !lit;
    showPair();
  }

  function showExposure() {
    const value = Number(stops.value);
    for (const f of document.querySelectorAll("#exposure feComponentTransfer > *")) f.setAttribute("slope", 2 ** value);
    viewer.style.setProperty("--exposure", value === 0 ? "none" : "url(#exposure)");
    const text = Math.abs(value).toString();
    document.getElementById("stops-said").textContent = `${value > 0 ? "+" : value < 0 ? "−" : ""}${text} stops`;
  }

  /* The upper picture is wrapped, so that the dividing line stays put while the picture moves. */
  function buildPair() {
    const view = pair.querySelector(".view");
    const over = document.createElement("div");
    over.className = "stack over";
    over.append(view.querySelector(".b"));
    view.insertBefore(over, view.querySelector(".tag"));
    view.style.aspectRatio = figures[0].querySelector(".view").style.aspectRatio;
    pair.hidden = false;
    view.addEventListener("pointermove", (event) => {
      if (event.pointerType !== "mouse" || event.buttons) return;
      divide.value = 100 * place(view, event)[0];
      showDivide();
    });
  }

  for (const input of viewer.querySelectorAll("input[name=quantity]")) {
    input.addEventListener("change", () => { state.quantity = input.value; showQuantity(); });
  }
  for (const button of viewer.querySelectorAll("[data-zoom]")) {
    button.addEventListener("click", () => zoom(Number(button.dataset.zoom)));
  }
  for (const select of [left, right]) select.addEventListener("change", showPair);
  divide.addEventListener("input", showDivide);
  stops.addEventListener("input", showExposure);
  document.addEventListener("keydown", (event) => {
    if (/^(SELECT|INPUT)$/.test(event.target.tagName) || event.ctrlKey || event.metaKey || event.altKey) return;
    const digit = "123456789".indexOf(event.key);
    if (event.key === "f" || event.key === "F") [left.value, right.value] = [right.value, left.value];
    else if (digit >= 0 && digit < figures.length) left.value = figures[digit].dataset.name;
    else return;
    showPair();
  });

  buildPair();
  viewer.querySelectorAll(".view").forEach(watch);
  state.quantity = viewer.querySelector("input[name=quantity]:checked").value;
  showQuantity();
  showDivide();
  showExposure();
  showView();
})();
