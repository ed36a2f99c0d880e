// A path over the pad: segments with places at even times; it is drawn, played, and saved for `framearray assemble`.

/** @import { FrameArray } from "./array.js" */
/** @import { Place, Segment, Tint, View } from "./types.d.ts" */

import { isTinted, round } from "./view.js";
import { linearColor } from "./array.js";

const STRAIGHT = 1; // seconds of the move to a clicked place
const PLACES_PER_SECOND = 8; // of a drawn stroke: a hand hardly turns faster
const MOST_PLACES = 400; // per segment
const SHORTEST = 0.1; // seconds

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

  // Add a stroke drawn by hand. samples: [{ s, c, l }], s in seconds.
  /** @type {(samples: (Place & { s: number })[], places: Record<string, number>) => void} */
  addStroke(samples, places) {
    const length = samples[samples.length - 1].s - samples[0].s;
    const seconds = Math.max(SHORTEST, length);
    // at least one place per sample: a quick stroke keeps its corners
    const count = Math.min(MOST_PLACES, Math.max(2, samples.length, Math.round(seconds * PLACES_PER_SECOND) + 1));
    const camera = [], light = [];
    for (let k = 0, i = 0; k < count; k++) {
      const s = samples[0].s + (length * k) / (count - 1);
      while (i < samples.length - 2 && samples[i + 1].s < s) i++;
      const [a, b] = [samples[i], samples[Math.min(i + 1, samples.length - 1)]];
      const share = b.s > a.s ? Math.min(1, (s - a.s) / (b.s - a.s)) : 1;
      camera.push(round(a.c + (b.c - a.c) * share));
      light.push(round(a.l + (b.l - a.l) * share));
    }
    this.segments.push({ seconds, camera, light, places: { ...places } });
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
