// Looks around in a panorama: a drag turns the view, the wheel and a pinch zoom it.

import { Zoom } from "./zoom.js";

const WIDTH = 0.5; // of the view's canvas, over that of the panorama: about one pixel per pixel in the middle
const ASPECT = 16 / 9;
const WIDEST = 1; // tangent of half the width of the view at scale 1: 90 degrees
const MOST = 16;

// The resolution of the canvas for views of a panorama.
/** @type {(panorama: [number, number]) => [number, number]} */
export function viewResolution([width]) {
  const columns = Math.round(WIDTH * width);
  return [columns, Math.round(columns / ASPECT)];
}

export class Look extends Zoom {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {[number, number]} panorama its resolution
   */
  constructor(canvas, panorama) {
    super(canvas, viewResolution(panorama));
    this.panorama = panorama;
    this.yaw = 0; // radians to the right of the middle column
    this.pitch = 0; // radians up
  }

  /** @override */
  get isTurned() {
    return true;
  }

  /** @override */
  get canMove() {
    return true;
  }

  // Tangents of half the width and half the height of the view.
  get tangents() {
    const across = WIDEST / this.scale;
    return [across, (across * this.resolution[1]) / this.resolution[0]];
  }

  // Yaw, pitch and tangents, as the shader reads them.
  get view() {
    return [this.yaw, this.pitch, ...this.tangents];
  }

  // The scale at which a pixel in the middle of the panorama is one of the screen.
  /** @override */
  get oneToOne() {
    return (WIDEST * this.panorama[0]) / (Math.PI * this.fit().each * this.resolution[0] * devicePixelRatio);
  }

  /** @override @type {(scale: number) => void} */
  zoomTo(scale) {
    this.scale = Math.min(Math.max(scale, 1), MOST);
    this.place();
  }

  // Turn the view by pixels of the screen.
  /** @override @type {(dx: number, dy: number) => void} */
  move(dx, dy) {
    const each = (2 * this.tangents[0]) / (this.fit().each * this.resolution[0]);
    this.yaw = (this.yaw - dx * each) % (2 * Math.PI);
    this.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.pitch + dy * each));
    this.place();
  }

  // The pixel of the panorama at a point of the screen; as in the shader of picture.js.
  /** @override @type {(x: number, y: number) => [number, number] | null} */
  sourceAt(x, y) {
    const pixel = this.pixelAt(x, y);
    if (!pixel) return null;
    const [columns, rows] = this.resolution, [across, up] = this.tangents;
    const right = ((2 * (pixel[0] + 0.5)) / columns - 1) * across, above = (1 - (2 * (pixel[1] + 0.5)) / rows) * up;
    const [sin, cos] = [Math.sin(this.pitch), Math.cos(this.pitch)];
    const forward = cos - above * sin, height = sin + above * cos;
    const yaw = this.yaw + Math.atan2(right, forward);
    const pitch = Math.atan2(height, Math.hypot(right, forward));
    const [width, tall] = this.panorama;
    const column = Math.floor((0.5 + yaw / (2 * Math.PI)) * width);
    return [((column % width) + width) % width, Math.min(tall - 1, Math.floor((0.5 - pitch / Math.PI) * tall))];
  }

  /** @override */
  place() {
    this.canvas.classList.add("zoomed");
    for (const follow of this.followers) follow();
  }
}
