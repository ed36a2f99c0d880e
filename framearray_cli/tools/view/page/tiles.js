// Which of the loaded tiles make the picture of a view.

/** @import { FrameArray } from "./array.js" */
/** @import { Store } from "./store.js" */
/** @import { CoarsePart, Part, View } from "./types.d.ts" */

// Return { parts, level, rough, missing }: level is 2 if nothing better can come now, 1 if small or coarse pictures stand
// in, 0 if a part has not come yet; rough: a coarse part that stands for a picture that is not rendered yet, or null;
// missing: whether there is nothing to show at all.
/** @param {FrameArray} array @param {Store} store @param {View} view */
export function loadedTiles(array, store, view) {
  let level = 2, missing = false;
  let rough = /** @type {CoarsePart | null} */ (null);
  const parts = array.parts(view).map((part) => {
    const there = array.contents.has(part.stream, view.c, part.l);
    const fine = there ? tileOf(array, store, part, view.c) : null;
    if (fine?.bitmap) {
      level = Math.min(level, fine.level);
      return fine;
    }
    const near = array.coarse ? array.coarse.part(part, view.c) : null;
    const coarse = array.coarse && near && tileOf(array.coarse.array, store, near, near.c);
    if (!there && near) rough ??= near;
    if (!there && !near) missing = true;
    level = Math.min(level, coarse?.bitmap ? (there ? 1 : coarse.level) : 0);
    return coarse?.bitmap ? coarse : fine;
  });
  return { parts, level, rough, missing };
}

// The full picture of a part, or else the small one in its sheet.
/** @param {FrameArray} array @param {Store} store @param {Part} part @param {number} c */
function tileOf(array, store, part, c) {
  const url = array.fullUrl(part.stream, c, part.l);
  const full = store.get(url);
  if (full) return { ...part, url, bitmap: full, part: [0, 0, 1, 1], level: 2 };
  const sheet = array.sheetUrl(part.stream, c);
  const bitmap = store.get(sheet);
  const best = array.lacksFull(part.stream) || (array.isCoarse && array.small.factor === 1); // there is none, or it is the same
  return { ...part, url: sheet, bitmap, part: array.smallPart(part.stream, part.l), level: best ? 2 : 1 };
}
