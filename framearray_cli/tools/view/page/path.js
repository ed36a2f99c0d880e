// A path over the pad: segments with places at even times; it is drawn, played, and saved for `framearray assemble`.

/** @import { FrameArray } from "./array.js" */
/** @import { Place, Segment, Tint, View } from "./types.d.ts" */

/** @typedef {Place & { s: number }} Sample */

import { isTinted, round } from "./view.js";
import { linearColor } from "./array.js";

const STRAIGHT = 1; // seconds of the move to a clicked place
const SHORTEST = 0.1; // seconds of a stroke
const MOMENT = 0.001; // seconds of a move at least
const WITHIN = 0.4; // positions between a stroke and its moves, along each axis, at any time
const RESTS = 0.25; // positions that a resting hand moves at most

export class Path {
  constructor() {
    /** @type {Segment[]} */
    this.segments = [];
    /** @type {Place | null} */
    this.start = null; // the first place of a path that has no segment yet
  }

  get seconds() {
    return this.segments.reduce((sum, segment) => sum + segment.seconds, 0);
  }

  get end() {
    const last = this.segments.at(-1);
    return last ? { c: last.camera[last.camera.length - 1], l: last.light[last.light.length - 1] } : this.start;
  }

  get isEmpty() {
    return this.segments.length === 0 && this.start === null;
  }

  // The lines that the pad draws.
  get strokes() {
    if (this.segments.length || !this.start) return this.segments;
    return [{ camera: [this.start.c], light: [this.start.l] }];
  }

  clear() {
    this.segments = [];
    this.start = null;
  }

  // Go straight to a place, from where the path ends.
  /** @type {(place: Place, places: Record<string, number>) => void} */
  addPlace(place, places) {
    const from = this.end;
    if (from === null) {
      this.start = place;
      return;
    }
    const camera = [from.c, place.c], light = [from.l, place.l];
    this.segments.push({ seconds: STRAIGHT, camera, light, places: { ...places } });
  }

  // Add a stroke drawn by hand: straight moves between a few of its places. samples: [{ s, c, l }], s in seconds.
  /** @type {(samples: Sample[], places: Record<string, number>) => void} */
  addStroke(samples, places) {
    const keys = simplified(samples);
    const by = Math.max(1, SHORTEST / (keys[keys.length - 1].s - keys[0].s || SHORTEST));
    for (let k = 1; k < keys.length; k++) {
      const [from, to] = [keys[k - 1], keys[k]];
      const seconds = Math.max(by * (to.s - from.s), MOMENT);
      this.segments.push({ seconds, camera: [from.c, to.c], light: [from.l, to.l], places: { ...places } });
    }
  }

  // Give the whole path a length in seconds; its segments keep their shares.
  /** @type {(seconds: number) => void} */
  stretch(seconds) {
    const by = seconds / this.seconds;
    for (const segment of this.segments) segment.seconds *= by;
  }

  // The place at a time, seconds: { c, l, places }.
  /** @type {(time: number) => (Place & { places: Record<string, number> }) | null} */
  at(time) {
    let left = time;
    for (const [k, segment] of this.segments.entries()) {
      const isLast = k === this.segments.length - 1;
      if (left <= segment.seconds || isLast) {
        const share = Math.min(1, left / segment.seconds);
        return { c: between(segment.camera, share), l: between(segment.light, share), places: segment.places };
      }
      left -= segment.seconds;
    }
    return null;
  }

  // Return the path file, see docs/guide/movies.md.
  /** @type {(array: FrameArray, view: View) => string} */
  toToml(array, view) {
    const exposure = view.exposure ? ` --exposure ${round(view.exposure)}` : "";
    const lines = [
      "# Drawn on the pad of `framearray view`. Make a movie of it:",
      `#     framearray assemble OUT THIS_FILE -o movie.mp4${exposure}`,
      `fps = ${number(array.fps)}`,
      'positions = "nearest"',
    ];
    for (const segment of this.segments) {
      lines.push("", "[[segments]]", `seconds = ${number(Math.round(segment.seconds * 1000) / 1000)}`);
      lines.push(`camera = ${span(segment.camera)}`);
      const axes = array.others.map((axis) => `${key(axis.name)} = ${segment.places[axis.name]}`);
      if (array.main.name === "light") lines.push(`light = ${span(segment.light)}`);
      else axes.unshift(`${key(array.main.name)} = ${span(segment.light)}`);
      if (axes.length) lines.push(`axes = { ${axes.join(", ")} }`);
    }
    for (const [name, tint] of Object.entries(view.tints)) lines.push(...tintLines(`groups.${key(name)}`, tint));
    lines.push(...tintLines("ambient", view.ambient));
    return `${lines.join("\n")}\n`;
  }
}

// A few of the samples, such that straight moves between them pass all others within WITHIN. Where the hand rested, both
// ends of the move are the same; the last place is always where it let go.
/** @type {(samples: Sample[]) => Sample[]} */
function simplified(samples) {
  const kept = new Set([0, samples.length - 1]);
  const spans = [[0, samples.length - 1]];
  for (let span = spans.pop(); span; span = spans.pop()) {
    const [first, last] = span, [a, b] = [samples[first], samples[last]];
    let most = WITHIN, worst = -1;
    for (let k = first + 1; k < last; k++) {
      const at = samples[k], share = b.s > a.s ? (at.s - a.s) / (b.s - a.s) : 1;
      const off = Math.max(Math.abs(a.c + share * (b.c - a.c) - at.c), Math.abs(a.l + share * (b.l - a.l) - at.l));
      if (off > most) [most, worst] = [off, k];
    }
    if (worst < 0) continue;
    kept.add(worst);
    spans.push([first, worst], [worst, last]);
  }
  const keys = [...kept].sort((a, b) => a - b).map((k) => ({ ...samples[k] }));
  for (const key of keys) [key.c, key.l] = [tenth(key.c), tenth(key.l)];
  const end = { ...keys[keys.length - 1] };
  for (let k = 1; k < keys.length; k++) if (rests(keys[k - 1], keys[k])) Object.assign(keys[k], place(keys[k - 1]));
  for (let k = keys.length - 1; k > 0 && rests(keys[k], end); k--) Object.assign(keys[k], place(end));
  return keys;
}

/** @type {(from: Place, to: Place) => boolean} */
function rests(from, to) {
  return Math.abs(to.c - from.c) < RESTS && Math.abs(to.l - from.l) < RESTS;
}

/** @type {(key: Place) => Place} */
function place({ c, l }) {
  return { c, l };
}

/** @type {(value: number) => number} */
function tenth(value) {
  return Math.round(10 * value) / 10;
}

/** @type {(table: string, tint: Tint) => string[]} */
function tintLines(table, tint) {
  if (!isTinted(tint)) return [];
  const color = linearColor(tint.color).map((value) => number(Math.round(value * 1e4) / 1e4));
  return ["", `[${table}]`, `intensity = ${number(round(tint.intensity))}`, `color = [${color.join(", ")}]`];
}

/** @type {(places: number[], share: number) => number} */
function between(places, share) {
  const at = share * (places.length - 1);
  const k = Math.min(Math.floor(at), places.length - 2);
  return places[k] + (places[k + 1] - places[k]) * (at - k);
}

/** @type {(places: number[]) => string} */
function span(places) {
  const same = places.every((place) => place === places[0]);
  return same ? String(places[0]) : `[${places.join(", ")}]`;
}

/** @type {(value: number) => string} */
function number(value) {
  return Number.isInteger(value) ? `${value}.0` : String(value);
}

/** @type {(name: string) => string} */
function key(name) {
  return /^[\w-]+$/.test(name) ? name : JSON.stringify(name);
}
