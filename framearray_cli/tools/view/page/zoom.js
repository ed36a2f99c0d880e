// Zooms and moves the picture on its stage: by wheel, pinch, drag, double click and keys.

/** @import { Page } from "./main.js" */

import { byId } from "./dom.js";

const MOST = 32; // times the picture that fits
const WHEEL = 1 / 400; // of the logarithm of the scale, per pixel that a wheel scrolls
const LINE = 16; // pixels of a line, for wheels that count lines
const STEP = 1.25; // per key
const MOVE = 0.1; // of the stage, per key
const CLOSE = 2; // times the picture that fits, of a double click

export class Zoom {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {[number, number]} resolution
   */
  constructor(canvas, resolution) {
    this.canvas = canvas;
    this.resolution = resolution;
    this.scale = 1; // times the picture that fits
    this.x = 0; // of the canvas's corner, CSS pixels from where it is when the picture fits
    this.y = 0;
    this.pointers = new Map(); // id -> [x, y]
    /** @type {(() => void)[]} */
    this.followers = [];
  }

  // Follow pointers and wheels on the stage.
  listen() {
    const { canvas } = this, stage = /** @type {HTMLElement} */ (canvas.parentElement);
    stage.addEventListener("wheel", (event) => {
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE : 1);
      this.zoomTo(this.scale * Math.exp(-pixels * WHEEL), event.clientX, event.clientY);
    }, { passive: false });
    canvas.addEventListener("dblclick", (event) => this.toggle(event.clientX, event.clientY));
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 0) return;
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    new ResizeObserver(() => this.place()).observe(stage);
  }

  // Whether the scale is of the view, and not of the canvas.
  get isTurned() {
    return false;
  }

  // Whether a drag moves the picture.
  get canMove() {
    return this.scale > 1;
  }

  // Where the picture lies on the canvas while it fits: left, top, and CSS pixels per pixel of the picture.
  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    const [width, height] = this.resolution;
    const each = Math.min(clientWidth / width, clientHeight / height);
    return { left: (clientWidth - each * width) / 2, top: (clientHeight - each * height) / 2, each };
  }

  // The scale at which a pixel of the picture is one of the screen.
  get oneToOne() {
    return 1 / (this.fit().each * devicePixelRatio);
  }

  // The corner of the canvas on the screen while the picture fits.
  corner() {
    const box = this.canvas.getBoundingClientRect();
    return [box.left - this.x, box.top - this.y];
  }

  // The pixel of the picture at a point of the screen: column, row; null outside.
  /** @type {(x: number, y: number) => [number, number] | null} */
  pixelAt(x, y) {
    const [left, top] = this.corner(), fit = this.fit(), [width, height] = this.resolution;
    const column = Math.floor(((x - left - this.x) / this.scale - fit.left) / fit.each);
    const row = Math.floor(((y - top - this.y) / this.scale - fit.top) / fit.each);
    return column >= 0 && column < width && row >= 0 && row < height ? [column, row] : null;
  }

  // The pixel of the array's picture there.
  /** @type {(x: number, y: number) => [number, number] | null} */
  sourceAt(x, y) {
    return this.pixelAt(x, y);
  }

  // Zoom so that a point of the screen, or else the middle of the stage, stays where it is.
  /** @type {(scale: number, x?: number, y?: number) => void} */
  zoomTo(scale, x, y) {
    const [left, top] = this.corner();
    const atX = (x ?? left + this.canvas.clientWidth / 2) - left;
    const atY = (y ?? top + this.canvas.clientHeight / 2) - top;
    const next = scale === this.oneToOne ? scale : Math.min(Math.max(scale, 1), MOST);
    this.x = atX - ((atX - this.x) * next) / this.scale;
    this.y = atY - ((atY - this.y) * next) / this.scale;
    this.scale = next;
    this.place();
  }

  // Show the whole picture, or else one pixel per pixel of the screen, if that is larger.
  /** @type {(x?: number, y?: number) => void} */
  toggle(x, y) {
    this.zoomTo(this.scale !== 1 ? 1 : this.oneToOne > 1 ? this.oneToOne : CLOSE, x, y);
  }

  /** @type {(dx: number, dy: number) => void} */
  move(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.place();
  }

  // One finger, or the pointer, moves the picture; two fingers zoom it.
  /** @type {(event: PointerEvent) => void} */
  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (!other) {
      if (this.canMove) this.move(now[0] - before[0], now[1] - before[1]);
      return;
    }
    const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
    this.move((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    this.zoomTo(
      (this.scale * apart(now)) / Math.max(1, apart(before)),
      (now[0] + other[0]) / 2,
      (now[1] + other[1]) / 2,
    );
  }

  // Keep the picture on the stage, and show it there.
  place() {
    const { canvas, scale } = this, fit = this.fit(), [width, height] = this.resolution;
    const within = (at, start, size, room) => {
      const long = size * scale;
      return long <= room
        ? (room - long) / 2 - start * scale
        : Math.min(Math.max(at, room - long - start * scale), -start * scale);
    };
    this.x = within(this.x, fit.left, fit.each * width, canvas.clientWidth);
    this.y = within(this.y, fit.top, fit.each * height, canvas.clientHeight);
    canvas.style.transform = scale === 1 ? "" : `translate(${this.x}px, ${this.y}px) scale(${scale})`;
    canvas.classList.toggle("zoomed", scale > 1);
    for (const follow of this.followers) follow();
  }

  // Call a function after each change.
  /** @type {(change: () => void) => void} */
  follow(change) {
    this.followers.push(change);
  }
}

// Connect zoom with buttons and keys: key -> what it does.
/** @type {(page: Page) => Record<string, () => void>} */
export function zoomKeys({ zoom }) {
  const stage = byId("stage");
  zoom.listen();
  const full = () => (document.fullscreenElement ? document.exitFullscreen() : stage.requestFullscreen());
  byId("fit").addEventListener("click", () => zoom.zoomTo(1));
  byId("one-to-one").addEventListener("click", () => zoom.zoomTo(zoom.oneToOne));
  byId("full-screen").addEventListener("click", full);
  byId("full-screen").hidden = !document.fullscreenEnabled;
  zoom.follow(() => {
    byId("fit").disabled = zoom.scale === 1;
    byId("one-to-one").disabled = Math.abs(zoom.scale / zoom.oneToOne - 1) < 1e-6;
  });
  zoom.place();
  return {
    z: () => zoom.zoomTo(zoom.scale * STEP),
    x: () => zoom.zoomTo(zoom.scale / STEP),
    v: () => zoom.zoomTo(1),
    1: () => zoom.zoomTo(zoom.oneToOne),
    f: full,
  };
}

// Arrow keys move a picture that has the focus and is larger than its stage; true if they did.
/** @type {(zoom: Zoom, key: string) => boolean} */
export function moveByKey(zoom, key) {
  const step = MOVE * zoom.canvas.clientWidth;
  const by = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] }[key];
  if (!by || !zoom.canMove || document.activeElement !== zoom.canvas) return false;
  zoom.move(by[0], by[1]);
  return true;
}
