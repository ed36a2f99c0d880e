// Buttons of the path: draw, play, clear, save; and the strokes of a pointer on the pad.

/** @import { Page } from "./main.js" */
/** @import { Place } from "./types.d.ts" */

import { byId, downloadBlob } from "./dom.js";

const CLICK = 4; // pixels that the pointer may move during a click

/** @type {(page: Page) => void} */
export function addPathButtons(page) {
  let samples = [];
  let from = [0, 0];

  const timeline = byId("timeline");
  page.showTime = (seconds) => {
    timeline.value = String(Math.floor(seconds * page.array.fps));
    byId("frame").value = `frame ${timeline.value} of 0-${timeline.max}`;
  };
  timeline.addEventListener("input", () => {
    page.player.stop();
    const seconds = Number(timeline.value) / page.array.fps;
    page.player.show(page.path.at(seconds));
    page.showTime(seconds);
  });

  const showLength = () => {
    const { path } = page;
    const count = path.segments.length;
    const length = count ? `${count} segment${count > 1 ? "s" : ""}` : "1 place";
    byId("path-length").value = length;
    byId("path-row").hidden = path.isEmpty;
    for (const id of ["play-path", "save-path", "seconds"]) byId(id).disabled = !count;
    byId("clear-path").disabled = path.isEmpty;
    byId("seconds").value = count ? page.path.seconds.toFixed(1) : "";
    byId("timeline-row").hidden = !count;
    timeline.max = String(Math.max(0, Math.round(path.seconds * page.array.fps) - 1));
    page.showTime(0);
    page.dirty();
  };

  page.setDrawing = (drawing) => {
    page.isDrawing = drawing;
    byId("draw").setAttribute("aria-pressed", String(drawing));
    byId("draw-help").hidden = !drawing;
    byId("pad").classList.toggle("drawing", drawing);
  };

  page.drawPath = (place, phase, event) => {
    const sample = { ...place, s: event.timeStamp / 1000 };
    if (phase === "down") {
      samples = [];
      from = [event.clientX, event.clientY];
    }
    samples.push(sample);
    if (phase !== "up") return;
    const far = Math.hypot(event.clientX - from[0], event.clientY - from[1]) > CLICK;
    if (far || samples.some((one) => Math.hypot(one.c - sample.c, one.l - sample.l) > 0.5)) {
      page.path.addStroke(samples, page.view.places);
    } else page.path.addPlace({ c: Math.round(place.c), l: Math.round(place.l) }, page.view.places);
    showLength();
  };

  page.addHere = () => {
    page.path.addPlace({ c: page.view.c, l: page.l }, page.view.places);
    showLength();
  };

  byId("draw").addEventListener("click", () => page.setDrawing(!page.isDrawing));
  byId("play-path").addEventListener("click", () => page.play("path"));
  byId("clear-path").addEventListener("click", () => {
    page.player.stop();
    page.path.clear();
    showLength();
  });
  byId("seconds").addEventListener("change", (event) => {
    const seconds = Number(event.target.value);
    if (seconds >= 0.1 && seconds <= 10000) page.path.stretch(seconds);
    showLength();
  });
  byId("save-path").addEventListener("click", () => {
    const text = page.path.toToml(page.array, page.view);
    const name = `${page.array.name.replace(/[^\w.-]+/g, "-")}-path.toml`;
    downloadBlob(new Blob([text], { type: "application/toml" }), name);
  });
}
