// The keys that a person holds to drive, from what the browser tells of them. It reads no clock: an event has its time
// (`timeStamp`), and `way` is given it; both are milliseconds on the clock of performance.now().
//
// That a key was let go may never be told: a modifier, a dialog or another window takes the release. So a key counts by what
// is heard of it, not until its release: it repeats while it is down. Of several keys the system repeats only the one pressed
// last, so each repeat speaks for all that are held. The first repeat takes longer: about 500 ms on most systems, 660 on
// plain X11.
const FIRST_MS = 800;
const REPEAT_MS = 500;

// By their places on the keyboard: what a key writes depends on its layout and on other keys.
const WAYS = { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1],
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };

// Shift is none: it takes no release away.
export const modified = (e) => e.altKey || e.ctrlKey || e.metaKey || e.isComposing || e.getModifierState("AltGraph")
  || /^(Alt|Control|Meta|OS)/.test(e.code);

export class HeldKeys {
  constructor() {
    this.end();
  }

  // Nothing is held until a key is pressed anew.
  end() {
    this.codes = new Set();
    this.until = 0;
    this.silent = false; // whether it was silence that ended it
  }

  // Says whether the key is one of driving.
  down(e) {
    if (modified(e)) this.end();
    else if (WAYS[e.code]) {
      this.pass(e.timeStamp);
      if (!e.repeat) {
        this.codes.add(e.code);
        this.until = e.timeStamp + FIRST_MS;
      } else if (this.codes.has(e.code)) this.until = Math.max(this.until, e.timeStamp + REPEAT_MS);
      return true;
    }
    return false;
  }

  up(e) {
    if (modified(e)) this.end();
    this.codes.delete(e.code);
  }

  pass(now) {
    if (this.codes.size === 0 || now <= this.until) return;
    this.end();
    this.silent = true;
  }

  // How far ahead and to the left at that time, each from -1 to 1; null if no key is held.
  way(now) {
    this.pass(now);
    if (this.codes.size === 0) return null;
    const sum = [...this.codes].map((code) => WAYS[code]).reduce(([a, b], [c, d]) => [a + c, b + d], [0, 0]);
    return sum.map((n) => Math.max(-1, Math.min(1, n)));
  }
}
