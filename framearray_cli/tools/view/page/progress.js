// How far an array is that is being rendered.

/** @import { FrameArray } from "./array.js" */

import { byId } from "./dom.js";

// Show the number of images that are there, and what stands for the others; nothing once all are there.
/** @type {(array: FrameArray) => void} */
export function showProgress(array) {
  const [there, all] = array.contents.images;
  const box = byId("made");
  box.hidden = array.contents.isComplete || !all || !array.contents.live;
  const bar = box.querySelector("progress");
  bar.max = Math.max(all, 1);
  bar.value = there;
  const more = array.coarse ? "; coarse pictures stand for the others" : "";
  box.querySelector("span").textContent = `${there.toLocaleString("en")} of ${all.toLocaleString("en")} images${more}`;
}
