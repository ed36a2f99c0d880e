// The order in which to load tiles: those on the screen, those that come next, then sheets and pictures around them.

/** @import { FrameArray } from "./array.js" */
/** @import { Item, Stream, View } from "./types.d.ts" */

const AHEAD = 8; // steps that a movement is extrapolated
const RING = 6; // full pictures around the place, in each direction

// view: gives the place; velocity: [cameras, lights] per step; calm: whether the view has stayed for a moment. Pictures
// around the place wait until then, as decoding them would delay the picture on the screen.
// What is not there yet is left out. Returns [{ url, bytes, needed }]; a needed tile is loaded even if it exceeds the budget.
/** @type {(array: FrameArray, view: View, velocity: number[], calm: boolean) => Item[]} */
export function loadOrder(array, view, velocity, calm) {
  const [dc, dl] = velocity;
  const moving = dc !== 0 || dl !== 0;
  const parts = array.parts(view);
  const streams = parts.map((part) => part.stream);
  /** @type {Item[]} */
  const list = [];

  const position = (stream, dlight) => {
    if (!stream.axis) return 0;
    const l = view.places[stream.axis] + (stream.axis === array.main.name ? dlight : 0);
    return Math.min(stream.n - 1, Math.max(0, l));
  };
  const full = (offset, dlight) => {
    const c = view.c + offset;
    if (c < 0 || c >= array.nCameras) return;
    for (const stream of streams) {
      if (array.lacksFull(stream) || !array.contents.has(stream, c, position(stream, dlight))) continue;
      const url = array.fullUrl(stream, c, position(stream, dlight));
      list.push({ url, bytes: array.bytes(stream, false), needed: offset === 0 && dlight === 0 });
    }
  };
  const sheet = (c) => {
    if (c < 0 || c >= array.nCameras) return;
    for (const stream of streams) {
      if (!array.contents.tag(stream, c)) continue;
      list.push({ url: array.sheetUrl(stream, c), bytes: array.bytes(stream, true) });
    }
  };

  if (moving) sheet(view.c);
  full(0, 0);
  sheet(view.c);
  list.push(...(array.coarse?.here(parts, view.c) ?? []));
  if (moving) {
    const near = Math.abs(dc) <= 2 && Math.abs(dl) <= 2; // faster movements skip the full pictures
    for (let k = 1; k <= AHEAD; k++) {
      if (near) full(Math.round(k * dc), Math.round(k * dl));
      sheet(view.c + Math.round(k * dc));
    }
  }
  for (let k = 1; k <= 3; k++) for (const c of [view.c - k, view.c + k]) sheet(c);
  for (let k = 1; calm && k <= 2; k++) ring(k, full);
  // While the array is rendered, coarse sheets take the place of sheets far away: these would be made again and again.
  list.push(...(array.coarse?.all(parts, view.c) ?? []));
  for (let k = 4; k < (array.coarse ? 0 : array.nCameras); k++) for (const c of [view.c - k, view.c + k]) sheet(c);
  for (let k = 3; calm && k <= RING; k++) ring(k, full);
  return list;
}

/** @type {(k: number, full: (dc: number, dl: number) => void) => void} */
function ring(k, full) {
  for (let i = -k; i <= k; i++) {
    full(i, -k);
    full(i, k);
    if (Math.abs(i) < k) {
      full(-k, i);
      full(k, i);
    }
  }
}
