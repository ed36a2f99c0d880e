// The page inside another page: only the picture. A drag to the side moves the camera, one up or down the light.

/** @import { Page } from "./main.js" */

import { byId } from "./dom.js";

const TAP = 4; // pixels that a pointer may move before it drags

/** @type {(page: Page) => void} */
export function embed(page) {
  const { array } = page;
  const canvas = byId("picture");
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-roledescription", "Picture to turn: left and right arrows, up and down arrows");
  const name = byId("name"); // a heading for screen readers, without the panel
  name.className = "hidden-text";
  byId("stage").prepend(name);
  // Nothing but the picture on the screen is loaded until somebody cares.
  const wake = () => page.wake();
  for (const name of ["pointerenter", "pointerdown", "focus"]) canvas.addEventListener(name, wake, { once: true });
  if (array.isPanorama) { // a drag turns the view; arrows move camera and light
    page.zoom.listen();
    return;
  }

  /** @type {{ id: number, x: number, y: number, c: number, l: number, moves: boolean } | null} */
  let drag = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (drag || event.button > 0) return;
    page.player.stop();
    drag = { id: event.pointerId, x: event.clientX, y: event.clientY, c: page.view.c, l: page.l, moves: false };
    canvas.setPointerCapture(drag.id);
    canvas.focus({ preventScroll: true });
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!drag || event.pointerId !== drag.id) return;
    const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
    drag.moves ||= Math.hypot(dx, dy) > TAP;
    if (!drag.moves) return;
    // A whole side of the picture is a whole axis.
    const box = canvas.getBoundingClientRect();
    const c = moved(drag.c, dx / box.width, array.nCameras);
    const l = moved(drag.l, dy / box.height, array.main.n);
    if (c === page.view.c && l === page.l) return;
    page.change((view) => {
      view.c = c;
      view.places[array.main.name] = l;
    }, event.timeStamp);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => {
      if (event.pointerId === drag?.id) drag = null;
    });
  }
}

// The index that a share of the axis of n leads to.
/** @type {(from: number, share: number, n: number) => number} */
function moved(from, share, n) {
  return Math.min(n - 1, Math.max(0, Math.round(from + share * (n - 1))));
}
