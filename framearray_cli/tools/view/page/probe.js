// The value of the picture under the pointer, and stills of it.

/** @import { Page } from "./main.js" */
/** @import { Planes } from "./planes.js" */
/** @import { DrawnPart } from "./types.d.ts" */

import { decode } from "./array.js";
import { byId, download, downloadBlob } from "./dom.js";
import { loadedTiles } from "./tiles.js";

const DIGITS = 3;
const canvas = new OffscreenCanvas(1, 1);
const context =
  /** @type {OffscreenCanvasRenderingContext2D} */ (canvas.getContext("2d", { willReadFrequently: true }));

// The sum of the parts at a pixel of the picture, in linear light, or the value of data: 1 or 3 numbers.
/** @type {(parts: DrawnPart[], at: [number, number], resolution: [number, number]) => number[]} */
export function valueAt(parts, [column, row], [width, height]) {
  const sum = [0, 0, 0];
  for (const { stream, factor, bitmap, part } of parts) {
    const x = Math.floor((part[0] + ((column + 0.5) / width) * part[2]) * bitmap.width);
    const y = Math.floor((part[1] + ((row + 0.5) / height) * part[3]) * bitmap.height);
    const codes = codesAt(bitmap, x, y);
    if (!stream.scale) {
      const values = [0, 1, 2].map((i) => stream.low + (codes[i] / 255) * (stream.high - stream.low));
      return stream.key === "normal" ? values : values.slice(0, 1);
    }
    for (let i = 0; i < 3; i++) sum[i] += factor[i] * decode(codes[i] / 255, stream);
  }
  return sum;
}

/** @type {(bitmap: ImageBitmap | Planes, x: number, y: number) => ArrayLike<number>} */
function codesAt(bitmap, x, y) {
  if ("codesAt" in bitmap) return bitmap.codesAt(x, y);
  context.drawImage(bitmap, x, y, 1, 1, 0, 0, 1, 1);
  return context.getImageData(0, 0, 1, 1).data;
}

/** @type {(page: Page) => void} */
export function addProbe(page) {
  const stage = byId("stage"), output = byId("probe");
  /** @type {[number, number] | null} */
  let at = null;
  page.showProbe = () => {
    output.hidden = true;
    const pixel = at && page.zoom.pixelAt(at[0], at[1]);
    const source = at && page.zoom.sourceAt(at[0], at[1]);
    if (!pixel || !source) return;
    const { parts, level, missing } = loadedTiles(page.array, page.store, page.view);
    if (!level || missing) return;
    output.hidden = false;
    const values = valueAt(/** @type {DrawnPart[]} */ (parts), source, page.array.resolution);
    const text = values.map((value) => value.toPrecision(DIGITS).replace(/e\+?/, "e")).join("  ");
    const shown = [...page.picture.pixelAt(pixel)].map((code) => code.toString(16).padStart(2, "0")).join("");
    output.value = `${source[0]}, ${source[1]}: ${text}${level < 2 ? " (about)" : ""}, shown #${shown}`;
  };
  stage.addEventListener("pointermove", (event) => {
    at = [event.clientX, event.clientY];
    page.showProbe();
  });
  stage.addEventListener("pointerleave", () => {
    at = null;
    page.showProbe();
  });
  byId("save-picture").addEventListener("click", () => savePicture(page));
  byId("save-exr").hidden = !page.array.contents.live || !page.array.hasExr;
  byId("save-exr").addEventListener(
    "click",
    () => download(page.array.sourceUrl(page.view.c, page.l), `${nameOf(page)}.exr`),
  );
}

// Save what the screen shows, in the resolution of the array.
/** @type {(page: Page) => void} */
function savePicture(page) {
  byId("picture").toBlob((blob) => downloadBlob(blob, `${nameOf(page)}.png`));
}

/** @type {(page: Page) => string} */
function nameOf({ array, view, l }) {
  return `${array.name}.c${String(view.c).padStart(4, "0")}.l${String(l).padStart(3, "0")}`;
}
