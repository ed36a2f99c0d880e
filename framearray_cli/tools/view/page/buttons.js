// Buttons beside those of the path: play, reset, link, keys; and links that are followed.

/** @import { Page } from "./main.js" */

import { byId } from "./dom.js";
import { firstView, fromHash, toHash } from "./view.js";

/** @type {(page: Page) => void} */
export function addButtons(page) {
  for (const what of ["camera", "light"]) {
    byId(`play-${what}`).addEventListener("click", () => page.play(what));
    byId(`play-${what}`).disabled = page.player.length(what) < 2;
  }
  byId("speed").addEventListener("change", (event) => (page.player.speed = Number(event.target.value)));
  byId("reset").addEventListener("click", () => {
    const { c, places } = page.view;
    page.change((view) => Object.assign(view, firstView(page.array), { c, places }));
  });
  byId("link").addEventListener("click", () => copyLink(page));
  byId("help").addEventListener("click", () => {
    byId("keys").hidden = !byId("keys").hidden;
    byId("help").setAttribute("aria-expanded", String(!byId("keys").hidden));
    byId("keys").scrollIntoView({ block: "nearest" });
  });
  addEventListener("hashchange", () => {
    page.change((view) => Object.assign(view, fromHash(page.array, location.hash)));
  });
  byId("name").textContent = document.title = page.array.name;
  byId("pad-light").textContent = page.array.main.name;
}

/** @type {(page: Page) => Promise<void>} */
async function copyLink(page) {
  const link = new URL(toHash(page.array, page.view), location.href).href;
  history.replaceState(null, "", link);
  let outcome = "Copied";
  try {
    await navigator.clipboard.writeText(link);
  } catch {
    outcome = "In the address bar"; // no clipboard without https, or without permission
  }
  byId("link").textContent = outcome;
  setTimeout(() => (byId("link").textContent = "Copy link"), 1500);
}
