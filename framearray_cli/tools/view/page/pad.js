// The pad: cameras from left to right, lights from top to bottom. The pointer moves the place, or draws a path.

/** @import { FrameArray } from "./array.js" */
/** @import { ColourMap } from "./map.js" */
/** @import { Place, Segment, View } from "./types.d.ts" */

export class Pad {
  // moved(place, phase, event): place is { c, l }, which need not be whole; phase is "down", "move" or "up".
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {FrameArray} array
   * @param {ColourMap} map
   * @param {(place: Place, phase: "down" | "move" | "up", event: PointerEvent) => void} moved
   */
  constructor(canvas, array, map, moved) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")); // first asked for here
    this.ratio = 1;
    /** @type {(() => void) | undefined} */
    this.onresize = undefined;
    this.array = array;
    this.map = map;
    this.ground = new OffscreenCanvas(1, 1);
    new ResizeObserver(() => this.resize()).observe(canvas);
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return {
        c: along((event.clientX - box.left) / box.width, array.nCameras),
        l: along((event.clientY - box.top) / box.height, array.main.n),
      };
    };
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => {
      if (pressed !== null || event.button > 0) return;
      pressed = event.pointerId;
      canvas.setPointerCapture(pressed);
      canvas.focus({ preventScroll: true });
      moved(place(event), "down", event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.pointerId === pressed) moved(place(event), "move", event);
    });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
      canvas.addEventListener(name, (event) => {
        if (event.pointerId !== pressed) return;
        pressed = null;
        moved(place(event), "up", event);
      });
    }
  }

  resize() {
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    this.ratio = ratio;
    this.onresize?.();
  }

  // strokes: [{ camera: [...], light: [...] }] of a path; groundChanged: whether the colours may have changed.
  /** @type {(view: View, strokes: Pick<Segment, "camera" | "light">[], groundChanged: boolean) => void} */
  draw(view, strokes, groundChanged) {
    const { context, canvas, array } = this;
    if (groundChanged) this.ground = this.map.draw(view);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = false;
    context.drawImage(this.ground, 0, 0, canvas.width, canvas.height);
    const x = (c) => ((c + 0.5) / array.nCameras) * canvas.width;
    const y = (l) => ((l + 0.5) / array.main.n) * canvas.height;
    for (const { camera, light } of strokes) this.line(camera.map(x), light.map(y));
    const at = [x(view.c), y(view.places[array.main.name])];
    context.lineWidth = this.ratio;
    context.strokeStyle = "#fff7";
    context.beginPath();
    context.moveTo(at[0], 0);
    context.lineTo(at[0], canvas.height);
    context.moveTo(0, at[1]);
    context.lineTo(canvas.width, at[1]);
    context.stroke();
    for (const [radius, width, style] of /** @type {const} */ ([[7, 4, "#000a"], [7, 2, "#fff"]])) {
      context.lineWidth = width * this.ratio;
      context.strokeStyle = style;
      context.beginPath();
      context.arc(at[0], at[1], radius * this.ratio, 0, 2 * Math.PI);
      context.stroke();
    }
  }

  /** @type {(xs: number[], ys: number[]) => void} */
  line(xs, ys) {
    const { context } = this;
    context.lineJoin = context.lineCap = "round";
    for (const [width, style] of /** @type {const} */ ([[5, "#000b"], [2.5, "#f0b45a"]])) {
      context.lineWidth = width * this.ratio;
      context.strokeStyle = style;
      context.beginPath();
      xs.forEach((x, i) => context.lineTo(x, ys[i]));
      if (xs.length === 1) context.lineTo(xs[0] + 0.01, ys[0]);
      context.stroke();
    }
  }
}

// A share of the pad's side -> a place on an axis of n; the outer halves of the end cells belong to the ends.
/** @type {(share: number, n: number) => number} */
function along(share, n) {
  return Math.min(n - 1, Math.max(0, share * n - 0.5));
}
