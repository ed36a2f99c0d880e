// What of an array is there, as contents.json says: it may still be rendered.

/** @import { Stream } from "./types.d.ts" */

export async function loadContents() {
  const answer = await fetch("contents.json", { cache: "no-cache" });
  if (!answer.ok) throw new Error(`contents.json: ${answer.status} ${answer.statusText}`);
  return new Contents(await answer.json());
}

export class Contents {
  /** @param {import("./types.d.ts").Contents} table */
  constructor(table) {
    this.live = table.live;
    this.index = table.index;
    this.stamp = table.stamp;
    this.images = table.images;
    this.lacking = table.lacking;
    this.coarse = table.coarse;
    this.streams = table.streams;
  }

  get isComplete() {
    return this.lacking[0] === 0;
  }

  // Changes with the sources of a stream and camera; "" if none of them is there.
  /** @type {(stream: Stream, c: number) => string} */
  tag(stream, c) {
    return this.streams[stream.key].stamps[c];
  }

  /** @type {(stream: Stream, c: number, l: number) => boolean} */
  has(stream, c, l) {
    const gaps = this.streams[stream.key].missing[c] ?? [];
    return Boolean(this.tag(stream, c)) && !gaps.some(([first, last]) => first <= l && l <= last);
  }
}
