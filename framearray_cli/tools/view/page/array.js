// A frame array as index.json describes it: its axes, the URLs of its tiles, and the terms of a picture.

/** @import { Contents } from "./contents.js" */
/** @import { Index, Part, Stream, Tint, View } from "./types.d.ts" */

import { waysToDecode } from "./clips.js";
import { loadContents } from "./contents.js";

export const WHITE = [1, 1, 1];

export async function loadArray() {
  const [answer, contents] = await Promise.all([fetch("index.json", { cache: "no-cache" }), loadContents()]);
  if (!answer.ok) throw new Error(`index.json: ${answer.status} ${answer.statusText}`);
  const array = new FrameArray(await answer.json(), contents);
  if (array.clips) array.decodesBy = await waysToDecode(array.clips.codec);
  return array;
}

export class FrameArray {
  /**
   * @param {import("./types.d.ts").Index} index
   * @param {import("./contents.js").Contents} contents
   * @param {string} base of its addresses: "", or that of the coarse array
   */
  constructor(index, contents, base = "") {
    const { name, digest, fps, resolution, axes, exposure, small, streams } = index;
    this.name = name;
    this.digest = digest;
    this.fps = fps;
    this.resolution = resolution;
    this.axes = axes;
    this.exposure = exposure;
    this.small = small;
    this.streams = streams;
    this.isPanorama = index.panorama;
    this.clips = index.clips; // of an export, whose pictures of light positions are in clips
    this.decodesBy = ""; // see clips.js
    this.hasExr = index.has_exr;
    this.ambient = index.ambient;
    this.backgroundAmbient = index.background_ambient;
    this.contents = contents;
    this.base = base;
    /** @type {import("./coarse.js").Coarse | null} */
    this.coarse = null; // small pictures of an array that is being rendered
    this.nCameras = index.n_cameras;
    this.main = index.axes[0]; // along the pad's second side
    this.others = index.axes.slice(1);
    this.layers = index.streams.filter((stream) => stream.role === "layer");
    this.groups = index.streams.filter((stream) => stream.role === "group");
    // Names of all light that can be changed: the groups, and the background.
    this.tinted = this.groups.map((group) => group.label);
    if (index.streams.some((stream) => stream.role === "background")) this.tinted.push("background");
  }

  /** @type {(stream: import("./types.d.ts").Stream, c: number, l: number) => string} */
  fullUrl(stream, c, l) {
    const start = `${this.base}tiles/${stream.key}/c${pad(c, 4)}.l`;
    const tag = this.contents.tag(stream, c);
    if (!this.clips || !this.inClips(stream)) return `${start}${pad(l, 3)}.jpg?${tag}`;
    const index = (stream.role === "layer" ? c : l) % this.clips.length; // in its clip
    if (stream.role !== "layer") return `${start}${pad(l - index, 3)}.clip?${tag}#${index}`;
    return `${this.base}tiles/${stream.key}/c${pad(c - index, 4)}.clip?${this.contents.stamp}#${index}`;
  }

  // Whether pictures of a stream are in clips: along the light, or of layers along the cameras.
  /** @type {(stream: Stream) => boolean} */
  inClips(stream) {
    return Boolean(this.clips) && (stream.n > 1 || stream.role === "layer");
  }

  // The image itself, which only a server has.
  /** @type {(c: number, l: number) => string} */
  sourceUrl(c, l) {
    return `sources/${this.streams[0].key}/c${pad(c, 4)}.l${pad(l, 3)}.exr`;
  }

  /** @type {(stream: import("./types.d.ts").Stream, c: number) => string} */
  sheetUrl(stream, c) {
    return `${this.base}tiles/${stream.key}/c${pad(c, 4)}.jpg?${this.contents.tag(stream, c)}`;
  }

  get isCoarse() {
    return this.base !== "";
  }

  // Whether small pictures are all that there is of a stream: this browser decodes no clips.
  /** @type {(stream: Stream) => boolean} */
  lacksFull(stream) {
    return this.inClips(stream) && !this.decodesBy;
  }

  /**
   * Bytes of a decoded tile or sheet.
   * @type {(stream: import("./types.d.ts").Stream, sheet: boolean) => number}
   */
  bytes(stream, sheet) {
    const [width, height] = this.resolution;
    if (!sheet) return (this.inClips(stream) && this.decodesBy === "frames" ? 1.5 : 4) * width * height;
    const columns = Math.min(stream.n, this.small.columns);
    return 4 * columns * this.small.width * Math.ceil(stream.n / columns) * this.small.height;
  }

  // Where the small picture of light l lies in its sheet: left, top, width, height as shares of the sheet.
  // Its last column and row may cover less than `factor` pixels, so the picture may end before they do.
  /** @type {(stream: Stream, l: number) => number[]} */
  smallPart(stream, l) {
    const columns = Math.min(stream.n, this.small.columns);
    const rows = Math.ceil(stream.n / columns);
    const [width, height] = this.resolution;
    const share = [width / this.small.factor / this.small.width, height / this.small.factor / this.small.height];
    return [(l % columns) / columns, Math.floor(l / columns) / rows, share[0] / columns, share[1] / rows];
  }

  // The streams whose sum is the picture of a view, each with its light index and RGB factor, as in pictures.py:
  //     picture = sum of factor_g (direct_g + a I_A,g R W) over groups g, the background among them.
  /** @type {(view: View) => Part[]} */
  parts(view) {
    if (view.show !== "picture") {
      const layer = this.layers.find((stream) => stream.key === view.show);
      if (layer) return [{ stream: layer, l: 0, factor: WHITE }];
    }
    return this.streams.filter((stream) => stream.role !== "layer").map((stream) => ({
      stream,
      l: stream.axis ? view.places[stream.axis] : 0,
      factor: this.factor(stream, view),
    }));
  }

  /** @type {(stream: Stream, view: View) => number[]} */
  factor(stream, view) {
    if (stream.role === "group") return tint(view.tints[stream.label]);
    if (stream.role === "background") return tint(view.tints.background);
    if (stream.role !== "ambient") return WHITE;
    const sky = view.tints.background ? tint(view.tints.background) : WHITE;
    const weight = this.backgroundAmbient.map((value, i) => value * sky[i]);
    for (const group of this.groups) {
      const light = this.ambient[group.label][view.places[group.axis]];
      const by = tint(view.tints[group.label]);
      for (let i = 0; i < 3; i++) weight[i] += by[i] * light[i];
    }
    const by = tint(view.ambient);
    return weight.map((value, i) => value * by[i]);
  }
}

// RGB factor of an intensity and an sRGB colour such as "#ffcc88".
/** @type {(tint: Tint) => number[]} */
export function tint({ intensity, color }) {
  return linearColor(color).map((value) => intensity * value);
}

/** @type {(color: string) => number[]} */
export function linearColor(color) {
  return [1, 3, 5].map((start) => linear(parseInt(color.slice(start, start + 2), 16) / 255));
}

/** @type {(encoded: number) => number} */
export function linear(encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
}

/** @type {(value: number) => number} */
export function srgb(value) {
  const x = Math.min(1, Math.max(0, value));
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

// Radiance of a code, which is 0 to 1; coding.py explains the curve.
/** @type {(code: number, coding: { scale: number, white: number }) => number} */
export function decode(code, { scale, white }) {
  const y = linear(code);
  return (scale * 2 * y) / (1 - y + Math.sqrt((1 - y) ** 2 + (4 * y) / white ** 2));
}

/** @type {(number: number, digits: number) => string} */
function pad(number, digits) {
  return String(number).padStart(digits, "0");
}
