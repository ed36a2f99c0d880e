// The numbers of a view, in words for the eye and for screen readers.

/** @import { Page } from "./main.js" */

import { byId } from "./dom.js";
import { showProgress } from "./progress.js";

// Show the numbers of the view, and set the controls to it.
/** @type {(page: Page) => void} */
export function showNumbers({ array, view, l, controls }) {
  const { nCameras, main } = array;
  const time = main.times ? `, ${main.times[l].replace(" ", "\u00a0")}` : ""; // on one line
  const text = `camera ${view.c} of 0-${nCameras - 1}, ${main.name} ${l} of 0-${main.n - 1}${time}`;
  const [lacking, ranges] = array.contents.lacking;
  byId("lacking").hidden = !lacking;
  byId("lacking").textContent = `${lacking} of ${nCameras} camera positions lack images: ${ranges}`;
  showProgress(array);
  byId("where").textContent = text;
  showSun(main.sun?.[l]);
  byId("pad").setAttribute("aria-label", `Pad: ${text}`);
  byId("picture").setAttribute("aria-label", `Picture of ${array.name}: ${text}`);
  const shown = array.layers.find((layer) => layer.key === view.show);
  const range = shown && !shown.scale && shown.key !== "normal";
  byId("legend").hidden = !range;
  if (range) byId("legend").textContent = `${shown.label}: ${figure(shown.low)} to ${figure(shown.high)}`;
  byId("exposure").disabled = Boolean(shown && !shown.exposed);
  controls.show(view);
}

const WINDS = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];

// Show where the sun stands, on a small map of the sky: north is up, the horizon is the rim.
/** @type {(sun?: [number, number]) => void} */
function showSun(sun) {
  byId("sun").hidden = !sun;
  if (!sun) return;
  const [azimuth, height] = sun, far = (10 * (90 - Math.max(0, height))) / 90, angle = (azimuth * Math.PI) / 180;
  byId("sun-at").setAttribute("cx", String(far * Math.sin(angle)));
  byId("sun-at").setAttribute("cy", String(-far * Math.cos(angle)));
  byId("sun-at").style.opacity = height > 0 ? "1" : "0.25";
  const wind = WINDS[Math.round(azimuth / 45) % 8];
  const text = height > 0 ? `sun in the ${wind}, ${Math.round(height)}\u00b0 high` : `sun below the horizon, ${wind}`;
  byId("sun").querySelector("span").textContent = text;
}

/** @type {(value: number) => string} */
function figure(value) {
  return Number(value.toPrecision(3)).toString();
}
