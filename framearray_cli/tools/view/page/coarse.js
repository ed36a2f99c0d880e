// The coarse array of a render that goes on: small pictures of some places, for those that have no fine one yet.

/** @import { CoarsePart, CoarseTable, Item, Part, Stream } from "./types.d.ts" */

import { FrameArray } from "./array.js";
import { Contents } from "./contents.js";
import { ColourMap } from "./map.js";

const DIM = 0.55; // of the pad's colours where only a coarse picture is

export class Coarse {
  /** @param {CoarseTable} table */
  constructor(table) {
    this.array = new FrameArray(table.index, new Contents(table.contents), "coarse/");
    this.map = new ColourMap(this.array); // only its means are used
    this.near = new Map(); // stream key -> { stream, at: the nearest camera of each that has all pictures, or -1 }
    this.places = table.places; // light axis -> the positions of the fine array that it has
    this.update(table);
  }

  /** @type {(table: CoarseTable) => void} */
  update({ contents, places }) {
    this.array.contents = new Contents(contents);
    this.places = places;
    this.near.clear();
    for (const stream of this.array.streams) this.near.set(stream.key, { stream, at: this.nearestCameras(stream) });
  }

  // For each camera the nearest one whose pictures are all there, or -1.
  /** @type {(stream: Stream) => number[]} */
  nearestCameras(stream) {
    const { contents, nCameras } = this.array;
    const { missing } = contents.streams[stream.key];
    /** @type {number[]} */
    const there = [];
    for (let c = 0; c < nCameras; c++) if (contents.tag(stream, c) && !missing[c]) there.push(c);
    return Array.from({ length: nCameras }, (_, c) => (there.length ? there[nearest(there, c)] : -1));
  }

  // The coarse part that stands for a part of a view: its stream, camera and light; null if there is none.
  /** @type {(part: Part, c: number) => CoarsePart | null} */
  part(part, c) {
    const found = this.near.get(part.stream.key);
    if (!found || found.at[c] < 0) return null;
    const l = found.stream.axis ? nearest(this.places[found.stream.axis], part.l) : 0;
    return { ...part, stream: found.stream, c: found.at[c], l };
  }

  // Where the picture of a part is among the fine places, in words.
  /** @type {(part: CoarsePart) => string} */
  place({ stream, c, l }) {
    return `camera ${c}${stream.axis ? `, ${stream.axis} ${this.places[stream.axis][l]}` : ""}`;
  }

  // Tiles to load for some parts of a view at camera c: those of its place; the sheets of all cameras, the nearest first.
  /** @type {(parts: Part[], c: number) => Item[]} */
  here(parts, c) {
    /** @type {Item[]} */
    const list = [];
    for (const part of parts.map((one) => this.part(one, c))) {
      if (!part) continue;
      list.push({ url: this.array.sheetUrl(part.stream, part.c), bytes: this.array.bytes(part.stream, true) });
      const url = this.array.fullUrl(part.stream, part.c, part.l);
      if (this.array.small.factor > 1) list.push({ url, bytes: this.array.bytes(part.stream, false) });
    }
    return list;
  }

  /** @type {(parts: Part[], c: number) => Item[]} */
  all(parts, c) {
    /** @type {Item[]} */
    const list = [];
    for (let k = 0; k < this.array.nCameras; k++) {
      for (const near of k ? [c - k, c + k] : [c]) {
        if (near >= 0 && near < this.array.nCameras) {
          for (const part of parts.map((one) => this.part(one, near))) {
            if (!part || part.c !== near) continue;
            list.push({ url: this.array.sheetUrl(part.stream, near), bytes: this.array.bytes(part.stream, true) });
          }
        }
      }
    }
    return list;
  }

  // The mean colour of parts of a view at camera c, linear, times how much the pad dims it; null if not known.
  /** @type {(parts: Part[], c: number) => number[] | null} */
  mean(parts, c) {
    const sum = [0, 0, 0];
    for (const part of parts) {
      const near = this.part(part, c);
      if (!near) return null;
      const means = this.map.means.get(near.stream.key);
      for (let i = 0; i < 3; i++) sum[i] += DIM * part.factor[i] * means[3 * (near.c * near.stream.n + near.l) + i];
    }
    return Number.isNaN(sum[0]) ? null : sum;
  }
}

// Renew `array.coarse` after `array.contents`: null without a coarse array.
/** @type {(array: FrameArray) => void} */
export function updateCoarse(array) {
  const table = array.contents.coarse;
  if (!table) array.coarse = null;
  else if (array.coarse?.array.digest === table.index.digest) array.coarse.update(table);
  else array.coarse = new Coarse(table);
}

/** @type {(places: number[], place: number) => number} */
function nearest(places, place) {
  let best = 0;
  for (let i = 1; i < places.length; i++) {
    if (Math.abs(places[i] - place) < Math.abs(places[best] - place)) best = i;
  }
  return best;
}
