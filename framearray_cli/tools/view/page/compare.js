// Compares the picture with one that is kept: the kept one is on the right of a line that a slider moves.

/** @import { Page } from "./main.js" */
/** @import { View } from "./types.d.ts" */

import { byId } from "./dom.js";

/** @type {(page: Page) => { view: View | null, split: number, toggle: () => void, show: () => void }} */
export function addCompare(page) {
  const slider = byId("split"), line = byId("split-line"), button = byId("compare");
  const compare = {
    view: /** @type {View | null} */ (null),
    split: 0.5,
    toggle() {
      compare.view = compare.view ? null : structuredClone(page.view);
      button.setAttribute("aria-pressed", String(Boolean(compare.view)));
      slider.hidden = line.hidden = !compare.view;
      page.loadTiles(true);
      compare.show();
    },
    // Put the line where the pictures meet, and say what is on its right.
    show() {
      page.dirty();
      if (!compare.view) return;
      const { zoom, array } = page, { left, each } = zoom.fit();
      const at = zoom.isTurned ? 1 : zoom.scale; // of the canvas
      line.style.left = `${
        zoom.canvas.offsetLeft + zoom.x + at * (left + compare.split * each * zoom.resolution[0])
      }px`;
      const { c, places } = compare.view;
      line.dataset.place = `camera ${c}, ${array.main.name} ${places[array.main.name]}`;
      slider.setAttribute("aria-valuetext", `${slider.value} %; on the right ${line.dataset.place}`);
    },
  };
  slider.addEventListener("input", () => {
    compare.split = Number(slider.value) / 100;
    compare.show();
  });
  button.addEventListener("click", compare.toggle);
  page.zoom.follow(compare.show);
  return compare;
}
