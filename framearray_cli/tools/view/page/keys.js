// Keyboard control, except for keys that the focused element needs itself.

/** @import { Page } from "./main.js" */

import { byId } from "./dom.js";
import { moveByKey, zoomKeys } from "./zoom.js";

const FAST = 10; // steps per key with Shift
const STOPS = 0.5; // of exposure per key

/** @type {(page: Page) => void} */
export function addKeys(page) {
  const { array } = page;
  const name = array.main.name;
  const clamp = (value, n) => Math.min(n - 1, Math.max(0, value));
  const camera = (to) => page.change((view) => (view.c = clamp(to(view.c), array.nCameras)));
  const light = (to) => page.change((view) => (view.places[name] = clamp(to(view.places[name]), array.main.n)));
  const expose = (to) => page.change((view) => (view.exposure = Math.min(8, Math.max(-8, to(view.exposure)))));

  const places = {
    ArrowLeft: (by) => camera((c) => c - by),
    ArrowRight: (by) => camera((c) => c + by),
    ArrowUp: (by) => light((l) => l - by),
    ArrowDown: (by) => light((l) => l + by),
    Home: () => camera(() => 0),
    End: () => camera(() => array.nCameras - 1),
    PageUp: () => light(() => 0),
    PageDown: () => light(() => array.main.n - 1),
  };
  const others = page.isEmbedded ? {} : {
    ...zoomKeys(page),
    s: () => byId("save-picture").click(),
    c: () => byId("compare").click(),
    " ": () => page.play("camera"),
    l: () => page.play("light"),
    p: () => page.play("path"),
    d: () => page.setDrawing(!page.isDrawing),
    "+": () => expose((stops) => stops + STOPS),
    "=": () => expose((stops) => stops + STOPS),
    "-": () => expose((stops) => stops - STOPS),
    0: () => expose(() => 0),
    "?": () => byId("help").click(),
    Escape: () => {
      page.player.stop();
      page.setDrawing(false);
    },
  };

  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const at = /** @type {Element} */ (event.target);
    const isPad = at.id === "pad" || at === document.body;
    const typing = at.matches("input[type=number], select");
    const sliding = at.matches("input");
    const pressing = at.matches("button, input[type=color]");
    if (typing || (sliding && event.key in places) || (pressing && [" ", "Enter"].includes(event.key))) return;
    if (moveByKey(page.zoom, event.key)) {
      event.preventDefault();
      return;
    }
    if (event.key in places) {
      page.player.stop();
      places[event.key](event.shiftKey ? FAST : 1);
    } else if (event.key === "Enter" && isPad && page.isDrawing) page.addHere();
    else if (event.key.toLowerCase() in others) others[event.key.toLowerCase()]?.();
    else if (event.key in others) others[event.key]();
    else return;
    event.preventDefault();
  });
}
