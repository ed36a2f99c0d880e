// The state of the page: place, layer, exposure, colours. It is written to the address and read from it.

const PLAIN = { intensity: 1, color: "#ffffff" };

export function firstView(array) {
  return {
    c: 0,
    places: Object.fromEntries(array.axes.map((axis) => [axis.name, 0])),
    show: "picture",
    exposure: 0,
    look: firstLook(array),
    tints: Object.fromEntries(array.tinted.map((name) => [name, { ...PLAIN }])),
    ambient: { ...PLAIN },
  };
}

// The view that the page starts with.
function firstLook(array) {
  return array.contents.views?.[0].name ?? "srgb";
}

export function toHash(array, view) {
  const words = new URLSearchParams();
  words.set("camera", view.c);
  for (const { name } of array.axes) words.set(name === array.main.name ? "light" : `axis.${name}`, view.places[name]);
  if (view.show !== "picture") words.set("show", view.show);
  if (view.look !== firstLook(array)) words.set("view", view.look);
  if (view.exposure) words.set("exposure", round(view.exposure));
  for (const [name, tint] of Object.entries(view.tints)) if (isTinted(tint)) words.set(`group.${name}`, tintText(tint));
  if (isTinted(view.ambient)) words.set("ambient", tintText(view.ambient));
  return `#${words}`;
}

// Values that do not fit the array stay as in a first view.
export function fromHash(array, hash) {
  const view = firstView(array);
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  view.c = index(words.get("camera"), array.nCameras);
  for (const { name, n } of array.axes) {
    view.places[name] = index(words.get(name === array.main.name ? "light" : `axis.${name}`), n);
  }
  if (array.layers.some((layer) => layer.key === words.get("show"))) view.show = words.get("show");
  if (array.contents.views?.some(({ name }) => name === words.get("view"))) view.look = words.get("view");
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

export function isTinted({ intensity, color }) {
  return intensity !== PLAIN.intensity || color !== PLAIN.color;
}

export function round(value) {
  return Math.round(value * 100) / 100;
}

function index(text, n) {
  const value = Math.round(Number(text));
  return value > 0 ? Math.min(n - 1, value) : 0;
}

function tintText({ intensity, color }) {
  return `${round(intensity)},${color.slice(1)}`;
}

function tintOf(text) {
  const found = /^(\d+(?:\.\d+)?),([0-9a-f]{6})$/.exec(text ?? "");
  return found ? { intensity: Math.min(16, Number(found[1])), color: `#${found[2]}` } : { ...PLAIN };
}
