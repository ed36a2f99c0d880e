// Plays along an axis, back and forth, or along the path. It waits for pictures that are still loading.

/** @import { FrameArray } from "./array.js" */
/** @import { Path } from "./path.js" */
/** @import { Change } from "./types.d.ts" */

export class Player {
  // isReady(): whether the screen shows the view; go(change): changes the view; stopped(what): reports the end.
  /**
   * @param {FrameArray} array
   * @param {() => boolean} isReady
   * @param {(change: Change) => void} go
   * @param {(what: string) => void} stopped
   */
  constructor(array, isReady, go, stopped) {
    this.array = array;
    this.isReady = isReady;
    this.go = go;
    this.stopped = stopped;
    /** @type {Path | null} */
    this.path = null;
    this.time = 0; // seconds since the last step, or of the path
    /** @type {number | null} */
    this.last = null; // ms
    /** @type {string | null} */
    this.what = null; // "camera", "light", "path" or null
    this.speed = 1;
    this.direction = { camera: 1, light: 1 };
  }

  /** @type {(what: string, path?: Path | null) => void} */
  start(what, path = null) {
    this.stop();
    if (what === "path" ? !path?.segments.length : this.length(what) < 2) return;
    Object.assign(this, { what, path, time: 0, last: null });
  }

  stop() {
    const was = this.what;
    this.what = null;
    if (was) this.stopped(was);
  }

  /** @type {(axis: string) => number} */
  length(axis) {
    return axis === "camera" ? this.array.nCameras : this.array.main.n;
  }

  // Called before each frame of the screen; now: milliseconds.
  /** @type {(now: number) => void} */
  tick(now) {
    if (!this.what) return;
    const passed = this.last === null ? 0 : Math.min(0.25, (now - this.last) / 1000) * this.speed;
    if (!this.isReady()) {
      this.last = now;
      return;
    }
    this.last = now;
    this.time += passed;
    if (this.what === "path") this.followPath();
    else this.step();
  }

  step() {
    const steps = Math.floor(this.time * this.array.fps);
    if (!steps) return;
    this.time -= steps / this.array.fps;
    const axis = this.what === "camera" ? "camera" : "light";
    const n = this.length(axis);
    this.go((view) => {
      const name = this.array.main.name;
      const from = axis === "camera" ? view.c : view.places[name];
      const { to, direction } = bounce(from, steps * this.direction[axis], n);
      this.direction[axis] = direction;
      if (axis === "camera") view.c = to;
      else view.places[name] = to;
    });
  }

  followPath() {
    const at = this.path?.at(this.time);
    if (!this.path || !at) return this.stop();
    this.show(at);
    if (this.time >= this.path.seconds) this.stop();
  }

  // Go to a place of a path.
  /** @type {(at: ReturnType<Path["at"]>) => void} */
  show(at) {
    if (!at) return;
    this.go((view) => {
      view.c = Math.round(at.c);
      Object.assign(view.places, at.places, { [this.array.main.name]: Math.round(at.l) });
    });
  }
}

// Walk a signed number of steps over 0 to n - 1, turning at the ends.
/** @type {(from: number, steps: number, n: number) => { to: number, direction: number }} */
export function bounce(from, steps, n) {
  const period = 2 * (n - 1);
  const phase = steps < 0 ? period - from : from; // on the way back the phase counts down from the end
  const at = (((phase + Math.abs(steps)) % period) + period) % period;
  return at <= n - 1 ? { to: at, direction: at === n - 1 ? -1 : 1 } : { to: period - at, direction: -1 };
}
