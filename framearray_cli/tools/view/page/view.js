// The state of the page: place, layer, exposure, colours. It is written to the address and read from it.

/** @import { FrameArray } from "./array.js" */
/** @import { Tint, View } from "./types.d.ts" */

const PLAIN = { intensity: 1, color: "#ffffff" };

/** @type {(array: FrameArray) => View} */
export function firstView(array) {
  return {
    c: 0,
    places: Object.fromEntries(array.axes.map((axis) => [axis.name, 0])),
    show: "picture",
    exposure: 0,
    tints: Object.fromEntries(array.tinted.map((name) => [name, { ...PLAIN }])),
    ambient: { ...PLAIN },
  };
}

/** @type {(array: FrameArray, view: View) => string} */
export function toHash(array, view) {
  const words = new URLSearchParams();
  words.set("camera", String(view.c));
  for (const { name } of array.axes) words.set(axisWord(array, name), String(view.places[name]));
  if (view.show !== "picture") words.set("show", view.show);
  if (view.exposure) words.set("exposure", String(round(view.exposure)));
  for (const [name, tint] of Object.entries(view.tints)) if (isTinted(tint)) words.set(`group.${name}`, tintText(tint));
  if (isTinted(view.ambient)) words.set("ambient", tintText(view.ambient));
  return `#${words}`;
}

/** @type {(array: FrameArray, name: string) => string} */
function axisWord(array, name) {
  return name === array.main.name ? "light" : `axis.${name}`;
}

// Values that do not fit the array stay as in a first view.
/** @type {(array: FrameArray, hash: string) => View} */
export function fromHash(array, hash) {
  const view = firstView(array);
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  view.c = index(words.get("camera"), array.nCameras);
  for (const { name, n } of array.axes) {
    view.places[name] = index(words.get(axisWord(array, name)), n);
  }
  const layer = array.layers.find((one) => one.key === words.get("show"));
  if (layer) view.show = layer.key;
  const exposure = Number(words.get("exposure"));
  if (Math.abs(exposure) <= 16) view.exposure = exposure;
  for (const name of Object.keys(view.tints)) view.tints[name] = tintOf(words.get(`group.${name}`));
  view.ambient = tintOf(words.get("ambient"));
  return view;
}

// Whether the page is shown inside another one: "embed" is a word of the address.
export function isEmbedded() {
  return new URLSearchParams(location.hash.slice(1)).has("embed");
}

/** @type {(tint: Tint) => boolean} */
export function isTinted({ intensity, color }) {
  return intensity !== PLAIN.intensity || color !== PLAIN.color;
}

/** @type {(value: number) => number} */
export function round(value) {
  return Math.round(value * 100) / 100;
}

/** @type {(text: string | null, n: number) => number} */
function index(text, n) {
  const value = Math.round(Number(text));
  return value > 0 ? Math.min(n - 1, value) : 0;
}

/** @type {(tint: Tint) => string} */
function tintText({ intensity, color }) {
  return `${round(intensity)},${color.slice(1)}`;
}

/** @type {(text: string | null) => Tint} */
function tintOf(text) {
  const found = /^(\d+(?:\.\d+)?),([0-9a-f]{6})$/.exec(text ?? "");
  return found ? { intensity: Math.min(16, Number(found[1])), color: `#${found[2]}` } : { ...PLAIN };
}
