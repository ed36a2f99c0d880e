// Loads tiles in order of priority, and keeps decoded ones within a budget of bytes.

/** @import { Item } from "./types.d.ts" */

const PARALLEL = 6; // connections that browsers open to one server
const PARALLEL_LATER = 4; // of them for tiles that are not urgent, so that a drag never waits for all six
const URGENT = 6; // items at the head of the list
// Share of the budget that one list may fill; the rest keeps what was shown just before.
const SHARE = 0.8;

export class Store {
  /**
   * @param {number} budget bytes
   * @param {(url: string) => void} loaded
   */
  constructor(budget, loaded) {
    this.budget = budget;
    this.loaded = loaded; // called with a url once it is loaded, or known to be missing
    this.bytes = 0;
    this.most = 0; // the largest `bytes` so far
    this.entries = new Map(); // url -> { bitmap, bytes }; the least recently used first
    this.missing = new Map(); // url -> answer of the server
    this.inFlight = new Map(); // url -> AbortController
    /** @type {Item[]} */
    this.wanted = [];
    this.next = 0; // of the wanted ones
  }

  /** @type {(url: string) => ImageBitmap | null} */
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
    const seen = new Set();
    this.wanted = [];
    for (const item of list) {
      if (seen.has(item.url)) continue;
      if (bytes + item.bytes > SHARE * this.budget && !item.needed) break;
      bytes += item.bytes;
      seen.add(item.url);
      this.wanted.push(item);
    }
    // Mark these as used, the first of the list last, so that only others make room for those still to load.
    for (let i = this.wanted.length - 1; i >= 0; i--) this.get(this.wanted[i].url);
    for (const [url, controller] of this.inFlight) if (!seen.has(url)) controller.abort();
    this.next = 0;
    this.pump();
  }

  pump() {
    while (this.next < this.wanted.length) {
      if (this.inFlight.size >= (this.next < URGENT ? PARALLEL : PARALLEL_LATER)) return;
      const item = this.wanted[this.next++];
      const known = this.entries.has(item.url) || this.inFlight.has(item.url) || this.missing.has(item.url);
      if (!known) this.load(item.url);
    }
  }

  /** @type {(url: string) => Promise<void>} */
  async load(url) {
    const controller = new AbortController();
    this.inFlight.set(url, controller);
    try {
      const answer = await fetch(url, { signal: controller.signal });
      if (!answer.ok) {
        this.missing.set(url, (await answer.text()).trim() || answer.statusText);
      } else {
        // Keep the codes of the file; the shader decodes them.
        /** @type {ImageBitmapOptions} */
        const options = { premultiplyAlpha: "none", colorSpaceConversion: "none" };
        this.add(url, await createImageBitmap(await answer.blob(), options));
      }
    } catch (thrown) {
      const error = /** @type {Error} */ (thrown);
      if (error.name !== "AbortError") this.missing.set(url, `cannot be loaded: ${error.message}`);
    }
    if (this.inFlight.get(url) === controller) this.inFlight.delete(url);
    if (this.entries.has(url) || this.missing.has(url)) this.loaded(url);
    this.pump();
  }

  /** @type {(url: string, bitmap: ImageBitmap) => void} */
  add(url, bitmap) {
    if (this.entries.has(url)) {
      bitmap.close();
      return;
    }
    const bytes = 4 * bitmap.width * bitmap.height;
    for (const [old, entry] of this.entries) {
      if (this.bytes + bytes <= this.budget) break;
      this.entries.delete(old);
      this.bytes -= entry.bytes;
      entry.bitmap.close();
    }
    this.entries.set(url, { bitmap, bytes });
    this.bytes += bytes;
    this.most = Math.max(this.most, this.bytes);
  }

  // Request missing tiles again; a render may have continued.
  forgetMissing() {
    this.missing.clear();
  }
}

// Bytes for decoded pictures: fewer on phones; ?memory=MIB in the address overrides both.
export function memoryBudget() {
  const asked = Number(new URLSearchParams(location.search).get("memory"));
  if (asked > 0) return asked * 2 ** 20;
  const small = matchMedia("(max-width: 760px), (pointer: coarse)").matches ||
    "deviceMemory" in navigator && Number(navigator.deviceMemory) < 4;
  return (small ? 96 : 384) * 2 ** 20;
}
