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
  byId("pad").setAttribute("aria-label", `Pad: ${text}`);
  byId("picture").setAttribute("aria-label", `Picture of ${array.name}: ${text}`);
  const shown = array.layers.find((layer) => layer.key === view.show);
  const range = shown && !shown.scale && shown.key !== "normal";
  byId("legend").hidden = !range;
  if (range) byId("legend").textContent = `${shown.label}: ${figure(shown.low)} to ${figure(shown.high)}`;
  byId("exposure").disabled = Boolean(shown && !shown.exposed);
  controls.show(view);
}

/** @type {(value: number) => string} */
function figure(value) {
  return Number(value.toPrecision(3)).toString();
}
