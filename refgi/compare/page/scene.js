"use strict";
/* The pictures of one view as numbers: irradiance, radiance, error, standard error and ids at any pixel. */

class Scene {
  constructor(data, planes) {
    this.data = data;
    this.facts = planes;
    this.width = data.width;
    this.height = data.height;
    this.items = [...data.pictures, ...data.references].map((item) => ({ ...item, ready: false }));
    this.coarse = new Map();
  }

  /* Unpack what all pictures need, then the pictures; tell of each that is ready. */
  async open(tell) {
    const { mask, emitted, reflectance } = this.data;
    [this.mask, this.emitted, this.reflectance] = await Promise.all([mask, emitted, reflectance].map((n) => this.planes(n)));
    this.covered = this.mask.bits[0].map((bits) => HALVES[bits]);
    this.ids = {};
    for (const [name, number] of Object.entries(this.data.ids)) this.ids[name] = await this.planes(number);
    const references = this.items.filter((item) => item.key);
    for (const item of [...references, ...this.items.filter((one) => !one.key)]) {
      item.light = await this.planes(item.irradiance);
      if (item.radiance !== undefined) item.own = await this.planes(item.radiance);
      if (item.deviation !== undefined) item.error = await this.planes(item.deviation);
      item.luminance = item.light.luminance();
      item.ready = true;
      tell(item);
    }
  }

  planes(number) {
    return planesOf(number, this.facts[number], this.width, this.height);
  }

  isCovered(x, y) {
    return this.covered[y * this.width + x] > 0;
  }

  irradiance(item, channel, x, y) {
    return item.light.at(channel, x, y);
  }

  radiance(item, channel, x, y) {
    if (item.own) return item.own.at(channel, x, y);
    return this.emitted.at(channel, x, y) + this.reflectance.at(channel, x, y) * item.light.at(channel, x, y);
  }

  luminance(item, x, y) {
    return item.luminance[item.light.index(x, y)];
  }

  /* The reference by that key that a picture is judged by, or the truth. */
  judgeOf(item, key) {
    const name = item.judges.includes(key) ? key : "truth";
    return this.items.find((one) => one.key === name);
  }

  /* Luminance of a reference over the same blocks as a picture's. */
  referenceLuminance(reference, level) {
    const own = reference.light;
    if (level <= own.level) return reference.luminance;
    const name = `${reference.key} ${level}`;
    if (!this.coarse.has(name)) {
      const weights = own.level === 0 ? this.covered
        : blockMeans(this.covered, this.covered, this.width, this.height, own.level).weights;
      this.coarse.set(name, blockMeans(reference.luminance, weights, own.width, own.height, level - own.level).means);
    }
    return this.coarse.get(name);
  }

  /* A function of x and y: a picture's luminance less its reference's; of a reference its standard error. */
  errorOf(item, key) {
    if (item.key) return (x, y) => item.error.at(0, x, y);
    const reference = this.referenceLuminance(this.judgeOf(item, key), item.light.level);
    return (x, y) => {
      const at = item.light.index(x, y);
      return item.luminance[at] - reference[at];
    };
  }

  /* The same over the reference's luminance. */
  relativeErrorOf(item, key) {
    const error = this.errorOf(item, key);
    const judge = item.key ? item : this.judgeOf(item, key);
    const reference = this.referenceLuminance(judge, item.light.level);
    return (x, y) => {
      const value = error(x, y);
      return value === 0 ? 0 : value / reference[item.light.index(x, y)];
    };
  }

  /* What a pixel shows, by name. */
  idsAt(x, y) {
    return Object.entries(this.ids).map(([name, planes]) => {
      const i = planes.index(x, y);
      return [name, planes.bits[0][i] + 65536 * planes.bits[1][i]];
    });
  }
}
