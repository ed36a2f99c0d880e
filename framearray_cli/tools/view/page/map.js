// Mean colour of every picture, from the sheets as they arrive: the pad's background.

/** @import { FrameArray } from "./array.js" */
/** @import { Stream, View } from "./types.d.ts" */

import { decode, srgb } from "./array.js";

const MISSING = [[32, 36, 46], [46, 52, 66]]; // sRGB codes, alternating: no picture has such a pattern

export class ColourMap {
  /** @param {FrameArray} array */
  constructor(array) {
    this.array = array;
    this.means = new Map(); // stream key -> Float32Array (cameras, positions, 3), NaN where not loaded yet
    for (const stream of array.streams) {
      this.means.set(stream.key, new Float32Array(3 * array.nCameras * stream.n).fill(NaN));
    }
    this.tags = new Map(); // stream key -> per camera, of the sheet whose means are known
    for (const stream of array.streams) this.tags.set(stream.key, []);
    this.canvas = new OffscreenCanvas(array.nCameras, array.main.n);
    this.small = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    this.changed = true;
  }

  // Add the means of a sheet, one colour per picture.
  /** @type {(stream: Stream, c: number, sheet: ImageBitmap) => void} */
  add(stream, c, sheet) {
    const means = this.means.get(stream.key);
    const tags = this.tags.get(stream.key), { contents } = this.array;
    if (tags[c] === contents.tag(stream, c)) return;
    tags[c] = contents.tag(stream, c);
    const columns = Math.min(stream.n, this.array.small.columns);
    const rows = Math.ceil(stream.n / columns);
    const codes = this.average(sheet, columns, rows);
    for (let l = 0; l < stream.n; l++) {
      for (let i = 0; i < 3; i++) {
        const code = codes[3 * l + i] / 255;
        const mean = stream.scale ? decode(code, stream) : code;
        means[3 * (c * stream.n + l) + i] = contents.has(stream, c, l) ? mean : NaN;
      }
    }
    this.changed = true;
  }

  // The mean codes of the pictures of a sheet, three each. It is drawn at half its size only: browsers differ in how many
  // pixels they see when they draw smaller.
  /** @type {(sheet: ImageBitmap, columns: number, rows: number) => Float64Array} */
  average(sheet, columns, rows) {
    const small = /** @type {OffscreenCanvasRenderingContext2D} */ (this.small); // never lost: it has no screen
    const width = Math.ceil(sheet.width / columns / 2), height = Math.ceil(sheet.height / rows / 2); // of a picture
    const across = small.canvas.width = columns * width, down = small.canvas.height = rows * height;
    small.drawImage(sheet, 0, 0, across, down);
    const codes = small.getImageData(0, 0, across, down).data;
    const means = new Float64Array(3 * columns * rows);
    for (let y = 0, from = 0; y < down; y++) {
      const row = columns * Math.floor(y / height);
      for (let x = 0; x < across; x++, from += 4) {
        const to = 3 * (row + Math.floor(x / width));
        for (let i = 0; i < 3; i++) means[to + i] += codes[from + i];
      }
    }
    return means.map((sum) => sum / (width * height));
  }

  // Draw the colours of a view, one pixel per camera and light, transparent where not loaded yet; return the canvas.
  /** @type {(view: View) => OffscreenCanvas} */
  draw(view) {
    const { array } = this;
    const { width, height } = this.canvas;
    const shown = new ImageData(width, height);
    const gain = 2 ** (view.exposure + array.exposure);
    for (let l = 0; l < height; l++) {
      const places = { ...view.places, [array.main.name]: l };
      const parts = array.parts({ ...view, places });
      const linear = parts[0].stream.scale > 0;
      for (let c = 0; c < width; c++) {
        const sum = [0, 0, 0];
        for (const { stream, l: at, factor } of parts) {
          const means = this.means.get(stream.key);
          for (let i = 0; i < 3; i++) sum[i] += factor[i] * means[3 * (c * stream.n + at) + i];
        }
        const start = 4 * (l * width + c);
        if (!parts.every(({ stream, l: at }) => array.contents.has(stream, c, at))) {
          const rough = array.coarse?.mean(parts, c);
          const codes = rough ? rough.map((value) => 255 * srgb(value * gain)) : MISSING[(c + l) % 2];
          shown.data.set([...codes, 255], start);
          continue;
        }
        for (let i = 0; i < 3; i++) shown.data[start + i] = 255 * (linear ? srgb(sum[i] * gain) : sum[i]);
        shown.data[start + 3] = Number.isNaN(sum[0]) ? 0 : 255;
      }
    }
    this.canvas.getContext("2d")?.putImageData(shown, 0, 0);
    this.changed = false;
    return this.canvas;
  }
}
