// Plays along an axis, back and forth, or along the path. It waits for pictures that are still loading.

export class Player {
  // isReady(): whether the screen shows the view; go(change): changes the view; stopped(what): reports the end.
  constructor(array, isReady, go, stopped) {
    Object.assign(this, { array, isReady, go, stopped });
    this.what = null; // "camera", "light", "path" or null
    this.speed = 1;
    this.direction = { camera: 1, light: 1 };
  }

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

  length(axis) {
    return axis === "camera" ? this.array.nCameras : this.array.main.n;
  }

  // Called before each frame of the screen; now: milliseconds.
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
    const axis = this.what;
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
    const at = this.path.at(this.time);
    this.go((view) => {
      view.c = Math.round(at.c);
      Object.assign(view.places, at.places, { [this.array.main.name]: Math.round(at.l) });
    });
    if (this.time >= this.path.seconds) this.stop();
  }
}

// Walk a signed number of steps over 0 to n - 1, turning at the ends.
export function bounce(from, steps, n) {
  const period = 2 * (n - 1);
  const phase = steps < 0 ? period - from : from; // on the way back the phase counts down from the end
  const at = (((phase + Math.abs(steps)) % period) + period) % period;
  return at <= n - 1 ? { to: at, direction: at === n - 1 ? -1 : 1 } : { to: period - at, direction: -1 };
}
