// The page: connects array, store, picture, pad, path and controls; one loop redraws what changed.

/** @import { FrameArray } from "./array.js" */
/** @import { Change, CoarsePart, DrawnPart, Place, View } from "./types.d.ts" */

import { loadArray } from "./array.js";
import { addButtons } from "./buttons.js";
import { updateCoarse } from "./coarse.js";
import { addCompare } from "./compare.js";
import { loadContents } from "./contents.js";
import { Controls } from "./controls.js";
import { byId } from "./dom.js";
import { addKeys } from "./keys.js";
import { loadOrder } from "./loadorder.js";
import { Look } from "./look.js";
import { ColourMap } from "./map.js";
import { showNumbers } from "./numbers.js";
import { Pad } from "./pad.js";
import { addPathButtons } from "./pathbuttons.js";
import { Path } from "./path.js";
import { Picture } from "./picture.js";
import { Player } from "./player.js";
import { addProbe } from "./probe.js";
import { memoryBudget, Store } from "./store.js";
import { loadedTiles } from "./tiles.js";
import { fromHash, isEmbedded, toHash } from "./view.js";
import { Zoom } from "./zoom.js";

const HASH_DELAY = 300; // ms after the last change; browsers refuse more than some hundred addresses per minute
const STILL_AFTER = 250; // ms without a change: the movement is over
const CALM_AFTER = 60; // ms without a change: load pictures around the place as well
const REFRESH = 3000, REFRESH_COMPLETE = 15000; // ms between two looks at what is there
const REFRESH_COARSE = 700; // ms, while coarse pictures come
const RETRY_AFTER = 5000; // ms, if there is no picture

export class Page {
  /** @param {FrameArray} array */
  constructor(array) {
    this.array = array;
    updateCoarse(array);
    this.view = fromHash(array, location.hash);
    this.velocity = [0, 0];
    this.changedAt = -Infinity; // ms
    this.refreshIn = REFRESH; // ms
    this.store = new Store(memoryBudget(), (url) => this.arrived(url), array);
    this.isEmbedded = isEmbedded();
    this.isAsleep = this.isEmbedded; // loads only the picture on the screen
    this.loadTiles(false);
    const look = array.isPanorama ? new Look(byId("picture"), array.resolution) : null;
    this.zoom = look ?? new Zoom(byId("picture"), array.resolution);
    // Takes 0.2 s without a graphics card, while tiles load.
    this.picture = new Picture(byId("picture"), this.zoom.resolution, look);
    this.map = new ColourMap(array);
    this.listSheets();
    this.path = new Path();
    this.isDrawing = false;
    this.measures = false; // whether each drawing is waited for, to be timed
    /** @type {(drawing: boolean) => void} */
    this.setDrawing = () => {}; // these four are of the path's buttons
    /** @type {(seconds: number) => void} */
    this.showTime = () => {};
    /** @type {(place: Place, phase: string, event: PointerEvent) => void} */
    this.drawPath = () => {};
    this.addHere = () => {};
    this.steps = []; // the last places: { c, l, first, full }, ms until drawn at all, and in full size
    this.player = new Player(array, () => this.level > 0, (change) => this.change(change), (what) => this.ended(what));
    this.controls = new Controls(array, this.view, (change) => this.change(change));
    this.pad = new Pad(byId("pad"), array, this.map, (place, phase, event) => this.pointer(place, phase, event));
    this.pad.onresize = () => this.dirty();
    this.showProbe = () => {}; // of the value under the pointer
    this.level = 0; // what the screen shows: 0 another view, 1 this view in small, 2 this view in full size
    addPathButtons(this);
    addKeys(this);
    addButtons(this);
    if (look) look.follow(() => this.dirty());
    if (!this.isEmbedded) addProbe(this);
    if (!this.isEmbedded) this.compare = addCompare(this);
    showNumbers(this);
    this.viewChanged(performance.now());
    requestAnimationFrame((now) => this.frame(now));
    if (array.contents.live) setTimeout(() => this.refreshAlways(), array.coarse ? REFRESH_COARSE : REFRESH);
  }

  listSheets() {
    const { array } = this;
    this.sheets = new Map(); // url of a sheet -> [map, stream, c]
    for (const map of array.coarse ? [this.map, array.coarse.map] : [this.map]) {
      for (const stream of map.array.streams) {
        for (let c = 0; c < array.nCameras; c++) this.sheets.set(map.array.sheetUrl(stream, c), [map, stream, c]);
      }
    }
  }

  // Look whether images have come or changed, and show them; load the page again if other tiles are made of all.
  async refresh() {
    const contents = await loadContents();
    if (contents.index !== this.array.digest) {
      const moves = this.player.what || performance.now() - this.changedAt < STILL_AFTER;
      if (!moves) location.reload();
      return;
    }
    const coarse = contents.coarse?.contents.stamp !== this.array.contents.coarse?.contents.stamp;
    this.refreshIn = contents.isComplete ? REFRESH_COMPLETE : coarse ? REFRESH_COARSE : REFRESH;
    if (contents.stamp === this.array.contents.stamp && !coarse) return;
    this.array.contents = contents;
    updateCoarse(this.array);
    this.listSheets();
    this.map.changed = true;
    this.level = 0;
    this.store.forgetMissing();
    this.loadTiles(true);
    showNumbers(this);
    this.dirty();
  }

  async refreshAlways() {
    try {
      if (document.visibilityState === "visible") await this.refresh();
    } catch {
      // the server may be back later
    }
    setTimeout(() => this.refreshAlways(), this.refreshIn);
  }

  get l() {
    return this.view.places[this.array.main.name];
  }

  // Change the view; the next frame of the screen shows it.
  /** @type {(change: Change, time?: number) => void} */
  change(change, time = performance.now()) {
    const { c } = this.view, { l } = this;
    change(this.view);
    this.velocity = time - this.changedAt < STILL_AFTER ? [this.view.c - c, this.l - l] : [0, 0];
    this.viewChanged(time);
    showNumbers(this);
    this.wake();
    if (this.isEmbedded) return; // the address is the other page's
    clearTimeout(this.hashTimer);
    this.hashTimer = setTimeout(() => history.replaceState(null, "", toHash(this.array, this.view)), HASH_DELAY);
  }

  /** @type {(time: number) => void} */
  viewChanged(time) {
    this.changedAt = time;
    this.level = 0;
    this.steps.push({ c: this.view.c, l: this.l, show: this.view.show, at: time, first: null, full: null });
    if (this.steps.length > 4000) this.steps.shift();
    this.loadTiles(false);
    clearTimeout(this.calmTimer);
    this.calmTimer = setTimeout(() => this.loadTiles(true), CALM_AFTER);
    const look = groundLook(this.array, this.view);
    if (look !== this.look) this.map.changed = true;
    this.look = look;
    this.dirty();
  }

  /** @type {(calm: boolean) => void} */
  loadTiles(calm) {
    const list = loadOrder(this.array, this.view, this.velocity, calm);
    const other = this.compare?.view ? loadOrder(this.array, this.compare.view, [0, 0], false) : [];
    list.splice(1, 0, ...other.filter((item) => item.needed));
    this.store.want(this.isAsleep ? list.filter((item) => item.needed) : list);
  }

  // Load what is around the picture, too.
  wake() {
    if (!this.isAsleep) return;
    this.isAsleep = false;
    this.loadTiles(true);
  }

  dirty() {
    this.isDirty = true;
  }

  /** @type {(url: string) => void} */
  arrived(url) {
    const sheet = this.sheets?.get(url);
    const bitmap = sheet && this.store.get(url);
    if (bitmap) {
      const [map, ...place] = sheet;
      map.add(...place, bitmap);
      this.map.changed = true;
    }
    this.dirty();
  }

  /** @type {(now: number) => void} */
  frame(now) {
    requestAnimationFrame((later) => this.frame(later));
    this.player.tick(now);
    if (this.player.what === "path") this.showTime(this.player.time);
    if (!this.isDirty) return;
    this.isDirty = false;
    this.drawPicture();
    if (this.isEmbedded) return;
    this.showProbe();
    const ground = this.map.changed && (now - (this.groundAt ?? -1e9) > 100 || !this.store.inFlight.size);
    if (ground) this.groundAt = now;
    if (this.map.changed && !ground) this.dirty();
    this.pad.draw(this.view, this.path.strokes, ground);
    byId("memory").value = `${Math.round((this.store.bytes + this.picture.bytes) / 2 ** 20)} MiB`;
  }

  // Draw the view from the best tiles that are loaded; if a part lacks one, the last drawing stays. What is not there yet
  // is drawn from the coarse array, or else as a blank.
  drawPicture() {
    const { array, store, view } = this;
    const { parts, level, rough, missing } = loadedTiles(array, store, view);
    if (missing) {
      this.picture.blank();
      this.showNote(`Camera ${view.c}, ${array.main.name} ${this.l}: not rendered yet.`);
      this.level = 2;
      return;
    }
    this.showProblem(rough);
    if (!level) return;
    const drawn = /** @type {DrawnPart[]} */ (parts); // all are there, as `level` says
    this.picture.draw(drawn, view.exposure + array.exposure);
    this.drawCompared();
    if (this.measures) this.picture.pixels(1); // waits for the drawing
    this.level = level;
    const step = this.steps.at(-1);
    if (!step) return;
    const ms = performance.now() - step.at;
    step.first ??= ms;
    if (level === 2) step.full ??= ms;
  }

  // Draw the right part of the picture that is compared, if it is loaded.
  drawCompared() {
    const { array, compare } = this;
    if (!compare?.view) return;
    const { parts, level, missing } = loadedTiles(array, this.store, compare.view);
    if (!level || missing) return;
    this.picture.draw(/** @type {DrawnPart[]} */ (parts), compare.view.exposure + array.exposure, compare.split);
  }

  // Show why there is no picture, if there is none; or which coarse one stands for it.
  /** @type {(rough: CoarsePart | null) => void} */
  showProblem(rough) {
    const { array, view } = this;
    const full = array.parts(view).map((part) => array.fullUrl(part.stream, view.c, part.l));
    const wrong = full.map((url) => this.store.missing.get(url)).find((text) => text);
    const stands = rough ? `Not rendered yet. Coarse picture of ${array.coarse?.place(rough)}.` : "";
    this.showNote(wrong ? `No picture here. ${wrong}` : stands);
    if (wrong) this.retry ??= setTimeout(() => this.retryMissing(), RETRY_AFTER);
  }

  /** @type {(text: string) => void} */
  showNote(text) {
    byId("note").hidden = !text;
    if (byId("note").textContent !== text) byId("note").textContent = text;
  }

  // A damaged image may have been rendered again, or the server may be back.
  retryMissing() {
    this.retry = undefined;
    this.store.forgetMissing();
    this.loadTiles(true);
    this.dirty();
  }

  /** @type {(place: Place, phase: string, event: PointerEvent) => void} */
  pointer(place, phase, event) {
    this.player.stop();
    if (this.isDrawing) this.drawPath(place, phase, event);
    else if (phase === "up") return;
    this.change((view) => {
      view.c = Math.round(place.c);
      view.places[this.array.main.name] = Math.round(place.l);
    }, event.timeStamp);
  }

  /** @type {(what: string) => void} */
  play(what) {
    if (this.player.what === what) this.player.stop();
    else {
      this.player.start(what, this.path);
      if (this.player.what) showPlaying(what, true);
    }
  }

  /** @type {(what: string) => void} */
  ended(what) {
    showPlaying(what, false);
  }
}

/** @type {(what: string, plays: boolean) => void} */
function showPlaying(what, plays) {
  const button = byId(`play-${what}`);
  button.setAttribute("aria-pressed", String(plays));
  button.textContent = button.textContent.replace(/^\w+/, plays ? "Pause" : "Play");
}

// All that the pad's background depends on: the view without the place on the pad.
/** @type {(array: FrameArray, view: View) => string} */
function groundLook(array, view) {
  const others = array.others.map((axis) => view.places[axis.name]);
  return JSON.stringify([view.show, view.exposure, view.tints, view.ambient, others]);
}

document.documentElement.classList.toggle("embed", isEmbedded());
try {
  const array = await loadArray();
  const page = new Page(array);
  if (page.isEmbedded) (await import("./embed.js")).embed(page);
  Object.assign(globalThis, { framearray: page }); // for the console, and for tests
} catch (error) {
  byId("note").hidden = false;
  byId("note").textContent = `The page cannot start. ${/** @type {Error} */ (error).message}`;
  console.error(error);
}
