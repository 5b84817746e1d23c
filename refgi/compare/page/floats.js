"use strict";
/* Planes as refgi/compare/album.py packs them: bits of half floats, and what they stand for. */

const HALVES = halfFloats();

/* The number that each 16 bits stand for as a half float. */
function halfFloats() {
  const numbers = new Float32Array(65536);
  for (let bits = 0; bits < 32768; bits++) {
    const exponent = bits >> 10;
    const fraction = bits & 1023;
    const number = exponent === 0 ? fraction * 2 ** -24
      : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15);
    numbers[bits] = number;
    numbers[bits + 32768] = -number;
  }
  return numbers;
}

async function inflated(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* Undo the differences to the pixel on the left and to the second channel, modulo 2^16. */
function summed(bytes, channels, width, height) {
  const count = width * height;
  const bits = Array.from({ length: channels }, () => new Uint16Array(count));
  for (let c = 0; c < channels; c++) {
    for (let y = 0, i = 0; y < height; y++) {
      for (let x = 0, sum = 0; x < width; x++, i++) {
        const at = c * count + i;
        sum = (sum + (bytes[at] << 8) + bytes[channels * count + at]) & 65535;
        bits[c][i] = sum;
      }
    }
  }
  for (let c = 0; c < channels; c++) {
    if (channels > 1 && c !== 1) for (let i = 0; i < count; i++) bits[c][i] += bits[1][i];
  }
  return bits;
}

/* Planes of one size; a pixel of the view lies at (x >> level, y >> level). */
class Planes {
  constructor(bits, width, height, level, exponent) {
    Object.assign(this, { bits, width, height, level, factor: 2 ** exponent });
  }

  index(x, y) {
    return (y >> this.level) * this.width + (x >> this.level);
  }

  at(channel, x, y) {
    return HALVES[this.bits[channel][this.index(x, y)]] * this.factor;
  }

  /* The luminance of three channels as an array. */
  luminance() {
    const [r, g, b] = this.bits;
    const values = new Float32Array(r.length);
    for (let i = 0; i < r.length; i++) {
      values[i] = this.factor * (0.2126 * HALVES[r[i]] + 0.7152 * HALVES[g[i]] + 0.0722 * HALVES[b[i]]);
    }
    return values;
  }
}

async function planesOf(number, facts, width, height) {
  const text = document.getElementById(`planes${number}`).textContent;
  const [w, h] = [width, height].map((side) => Math.ceil(side / 2 ** facts.level));
  return new Planes(summed(await inflated(text), facts.channels, w, h), w, h, facts.level, facts.exponent);
}

/* Weighted means over blocks of 2^shift x 2^shift, and the weights of the blocks. */
function blockMeans(values, weights, width, height, shift) {
  const [w, h] = [width, height].map((side) => Math.ceil(side / 2 ** shift));
  const means = new Float32Array(w * h);
  const sums = new Float32Array(w * h);
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      const at = (y >> shift) * w + (x >> shift);
      if (weights[i] > 0) means[at] += values[i] * weights[i];
      sums[at] += weights[i];
    }
  }
  for (let i = 0; i < means.length; i++) if (sums[i] > 0) means[i] /= sums[i];
  return { means, weights: sums };
}
