// Loads tiles in order of priority, and keeps decoded ones within a budget of bytes.

/** @import { Planes } from "./planes.js" */
/** @import { Item } from "./types.d.ts" */

import { AS_CODED, decodeClip } from "./clips.js";

const PARALLEL = 6; // connections that browsers open to one server
const PARALLEL_LATER = 4; // of them for tiles that are not urgent, so that a drag never waits for all six
const PARALLEL_CLIPS = 2; // clips that are decoded at once, one of them only if it is urgent
const URGENT = 6; // items at the head of the list
// Share of the budget that one list may fill; the rest keeps what was shown just before.
const SHARE = 0.8;

export class Store {
  /**
   * @param {number} budget bytes
   * @param {(url: string) => void} loaded
   * @param {import("./clips.js").Coded} array
   */
  constructor(budget, loaded, array) {
    this.budget = budget;
    this.array = array;
    this.loaded = loaded; // called with a url once it is loaded, or known to be missing
    this.bytes = 0;
    this.most = 0; // the largest `bytes` so far
    this.entries = new Map(); // url -> { bitmap, bytes }; the least recently used first
    this.missing = new Map(); // url -> answer of the server
    this.inFlight = new Map(); // file -> AbortController
    /** @type {Item[]} */
    this.wanted = [];
    this.next = 0; // of the wanted ones
    this.clips = 0; // that are decoded now
    this.decoded = new Set(); // urls of pictures of clips, since the list was made
  }

  /** @type {(url: string) => ImageBitmap | Planes | null} */
  get(url) {
    const entry = this.entries.get(url);
    if (!entry) return null;
    this.entries.delete(url); // to the end of the map, as the last one used
    this.entries.set(url, entry);
    return entry.bitmap;
  }

  /** @type {(url: string) => boolean} */
  has(url) {
    return this.entries.has(url);
  }

  // Load these in this order; cancel all other loads.
  /** @type {(list: Item[]) => void} */
  want(list) {
    let bytes = 0;
    const seen = new Set(), files = new Set();
    this.wanted = [];
    for (const item of list) {
      if (seen.has(item.url)) continue;
      if (bytes + item.bytes > SHARE * this.budget && !item.needed) break;
      bytes += item.bytes;
      seen.add(item.url);
      files.add(fileOf(item.url));
      this.wanted.push(item);
    }
    // Mark these as used, the first of the list last, so that only others make room for those still to load.
    for (let i = this.wanted.length - 1; i >= 0; i--) this.get(this.wanted[i].url);
    for (const [file, controller] of this.inFlight) if (!files.has(file)) controller.abort();
    this.next = 0;
    this.decoded.clear();
    this.pump();
  }

  pump() {
    while (this.next < this.wanted.length) {
      if (this.inFlight.size >= (this.next < URGENT ? PARALLEL : PARALLEL_LATER)) return;
      const item = this.wanted[this.next];
      const file = fileOf(item.url);
      if (file !== item.url && this.clips >= (this.next < URGENT ? PARALLEL_CLIPS : PARALLEL_CLIPS - 1)) return;
      this.next++;
      const known = this.entries.has(item.url) || this.missing.has(item.url) || this.decoded.has(item.url);
      if (!known && !this.inFlight.has(file)) this.load(file);
    }
  }

  // The wanted pictures of a file that are not there.
  /** @type {(file: string) => string[]} */
  lacking(file) {
    return this.wanted.map((item) => item.url).filter((url) => fileOf(url) === file && !this.entries.has(url));
  }

  // Load a picture, or the wanted pictures of a clip.
  /** @type {(file: string) => Promise<void>} */
  async load(file) {
    const controller = new AbortController(), { signal } = controller;
    const urls = this.lacking(file);
    const isClip = urls[0] !== file;
    this.inFlight.set(file, controller);
    this.clips += Number(isClip);
    try {
      const answer = await fetch(file, { signal });
      if (!answer.ok) {
        this.fail(urls, (await answer.text()).trim() || answer.statusText);
      } else if (!isClip) {
        this.add(file, await createImageBitmap(await answer.blob(), AS_CODED));
      } else {
        const data = new Uint8Array(await answer.arrayBuffer());
        const wanted = urls.map((url) => Number(url.slice(file.length + 1)));
        const came = new Set();
        const take = (index, picture) => {
          const url = `${file}#${index}`;
          came.add(url);
          this.decoded.add(url);
          this.add(url, picture);
        };
        if (!signal.aborted) await decodeClip(this.array, data, wanted, signal, take);
        if (!signal.aborted) this.fail(urls.filter((url) => !came.has(url)), "its clip ends before it");
      }
    } catch (thrown) {
      const error = /** @type {Error} */ (thrown);
      if (!signal.aborted) this.fail(urls, `cannot be loaded: ${error.message}`);
    }
    if (this.inFlight.get(file) === controller) this.inFlight.delete(file);
    this.clips -= Number(isClip);
    if (isClip || signal.aborted) this.next = 0; // other pictures of it, or the same again, may be wanted now
    this.pump();
  }

  /** @type {(urls: string[], why: string) => void} */
  fail(urls, why) {
    for (const url of urls) {
      this.missing.set(url, why);
      this.loaded(url);
    }
  }

  /** @type {(url: string, bitmap: ImageBitmap | Planes) => void} */
  add(url, bitmap) {
    if (this.entries.has(url)) {
      bitmap.close();
      return;
    }
    const bytes = "bytes" in bitmap ? bitmap.bytes : 4 * bitmap.width * bitmap.height;
    for (const [old, entry] of this.entries) {
      if (this.bytes + bytes <= this.budget) break;
      this.entries.delete(old);
      this.bytes -= entry.bytes;
      entry.bitmap.close();
    }
    this.entries.set(url, { bitmap, bytes });
    this.bytes += bytes;
    this.most = Math.max(this.most, this.bytes);
    this.loaded(url);
  }

  // Request missing tiles again; a render may have continued.
  forgetMissing() {
    this.missing.clear();
  }
}

// A url without the index of a picture in its clip.
/** @type {(url: string) => string} */
function fileOf(url) {
  const end = url.indexOf("#");
  return end < 0 ? url : url.slice(0, end);
}

// Bytes for decoded pictures: fewer on phones; ?memory=MIB in the address overrides both.
export function memoryBudget() {
  const asked = Number(new URLSearchParams(location.search).get("memory"));
  if (asked > 0) return asked * 2 ** 20;
  const small = matchMedia("(max-width: 760px), (pointer: coarse)").matches ||
    "deviceMemory" in navigator && Number(navigator.deviceMemory) < 4;
  return (small ? 96 : 384) * 2 ** 20;
}
