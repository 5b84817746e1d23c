"use strict";
/* From numbers to colours: what can be shown of a picture, and on which scale. */

const SRGB = Uint8Array.from({ length: 8193 }, (_, i) => {
  const v = i / 8192;
  return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055) + 0.5;
});
const NOT_FINITE = [255, 0, 255];
const NO_SURFACE = [128, 128, 128];
const STOPS_SHOWN = 6; // of the logarithmic false colours

/* 256 colours between those of a map. */
function ramp(colours) {
  const rgb = colours.map((text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16)));
  return Array.from({ length: 256 }, (_, i) => {
    const place = (i / 255) * (rgb.length - 1);
    const below = Math.min(Math.floor(place), rgb.length - 2);
    return rgb[below].map((value, c) => Math.round(value + (place - below) * (rgb[below + 1][c] - value)));
  });
}

/* A light quantity: three numbers a pixel through the sRGB curve. */
function light(value, exposure) {
  return {
    unit: null, slider: "Exposure", base: exposure,
    painter: (scene, item, _, stops) => {
      const gain = 8192 * exposure(scene) * 2 ** stops;
      const rgb = [0, 0, 0];
      return (x, y) => {
        for (let c = 0; c < 3; c++) {
          const v = value(scene, item, c, x, y);
          if (!Number.isFinite(v)) return NOT_FINITE;
          rgb[c] = SRGB[Math.max(0, Math.min(8192, Math.round(v * gain)))];
        }
        return rgb;
      };
    },
    brightness: (scene, item) => (x, y) => Math.max(...[0, 1, 2].map((c) => value(scene, item, c, x, y))),
    fitted: (scene, bright) => Math.log2(0.9 / bright / exposure(scene)),
  };
}

/* A map quantity: one number a pixel, its place on a ramp of colours. */
function map(value, { unit, colours, largest, ticks, place, about }) {
  return {
    unit, slider: "Range", base: largest, colours, ticks, about,
    painter: (scene, item, key, stops) => {
      const number = value(scene, item, key);
      const high = largest(scene) * 2 ** stops;
      return (x, y) => {
        if (!scene.isCovered(x, y)) return NO_SURFACE;
        const v = number(x, y);
        if (Number.isNaN(v) || (!Number.isFinite(v) && unit !== "%")) return NOT_FINITE;
        return colours[Math.round(255 * Math.max(0, Math.min(1, place(v, high))))];
      };
    },
    brightness: (scene, item, key) => {
      const number = value(scene, item, key);
      return (x, y) => (scene.isCovered(x, y) ? Math.abs(number(x, y)) : NaN);
    },
    fitted: (scene, bright) => Math.log2(bright / largest(scene)),
  };
}

function quantitiesOf(album) {
  const signed = ramp(album.signed);
  const even = (high) => [-1, -0.5, 0, 0.5, 1].map((share) => share * high);
  const middle = (v, high) => 0.5 + (0.5 * v) / high;
  return {
    picture: light((scene, ...at) => scene.radiance(...at), (scene) => scene.data.exposure),
    indirect: light((scene, ...at) => scene.irradiance(...at), (scene) => scene.data.indirectExposure),
    error: map((scene, item, key) => scene.errorOf(item, key), {
      unit: "too dark / too bright, W/m²", colours: signed, ticks: even, place: middle,
      largest: (scene) => scene.data.largestError,
    }),
    relative: map((scene, item, key) => scene.relativeErrorOf(item, key), {
      unit: "%", colours: signed, ticks: (high) => even(100 * high), place: middle, largest: () => 0.5,
    }),
    false: map((scene, item) => (x, y) => scene.luminance(item, x, y), {
      unit: "luminance of indirect irradiance, W/m²", colours: ramp(album.sequential),
      ticks: (high) => [0, 0.25, 0.5, 0.75, 1].map((share) => high * 2 ** (STOPS_SHOWN * (share - 1))),
      place: (v, high) => 1 + Math.log2(Math.max(v, 1e-30) / high) / STOPS_SHOWN,
      largest: (scene) => scene.data.brightest,
    }),
  };
}

function paint(canvas, scene, colourAt) {
  const { width, height } = scene;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i += 4) {
      const rgb = colourAt(x, y);
      image.data[i] = rgb[0];
      image.data[i + 1] = rgb[1];
      image.data[i + 2] = rgb[2];
      image.data[i + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
}

function short(value) {
  if (Number.isNaN(value)) return "NaN";
  return Number.isFinite(value) ? String(Number(value.toPrecision(4))).replace("-", "−") : value > 0 ? "∞" : "−∞";
}
