"use strict";
/* A picture enlarged; arrow keys go through the pictures of the same figure, so that two of them can be flipped. */
(() => {
  const box = document.getElementById("lightbox");
  const [shown, said] = [box.querySelector("img"), box.querySelector("p")];
  let plates = [];
  let at = 0;

  function show(index) {
    at = (index + plates.length) % plates.length;
    const source = plates[at].querySelector("img");
    shown.src = source.src;
    shown.alt = source.alt;
    said.textContent = `${at + 1} of ${plates.length}: ${source.alt}`;
  }

  for (const plate of document.querySelectorAll(".plate")) {
    plate.addEventListener("click", () => {
      plates = [...plate.closest(".plates").querySelectorAll(".plate")];
      show(plates.indexOf(plate));
      box.showModal();
    });
  }
  box.addEventListener("click", () => box.close());
  box.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (step) show(at + step);
  });
})();
