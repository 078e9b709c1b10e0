// The strip of time under the map: error, leaders, stops, and what happened. One drags along it to see the fleet as it was. Of a
// fleet that runs the page keeps what it was shown; a recording is asked for its own.
import { by, made, write } from "./dom.js";
import { colour } from "./map.js";
import { ink } from "./ink.js";

const FINE = 600; // scenes that are kept as they come
const KEPT = 2400; // scenes in all: of those before, every second one is dropped when there are more
const HIGH = 0.5; // metres; the least error at the top of the strip
const TICKS = [1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600];
const TICK = 70; // pixels between two times, at least
const BAND = 5; // pixels of the leaders' colours, at the bottom
const FOOT = 16; // pixels of the times
const MARKS = { killed: "✕", estop_holds: "■", formed: "▲", elected: "★", cannot_form: "!", crashed: "✕", parts: "≠" };
const NEAR = 6; // pixels round a mark

// The strip's entries from scenes. Pure.
export function entry(scene, told) {
  const fresh = Math.max(0, Math.min(scene.told - told, scene.stages.length));
  return {
    at_s: scene.at_s, error: scene.error, leader: scene.leader, formed: scene.formed, held: scene.estop !== null,
    stages: fresh > 0 ? scene.stages.slice(-fresh) : [],
  };
}

// Every second of the older scenes. Pure.
export function thinned(scenes) {
  if (scenes.length <= KEPT) return scenes;
  return [...scenes.slice(0, -FINE).filter((_, k) => k % 2 === 0), ...scenes.slice(-FINE)];
}

export const clock = (s) => (s < 600 ? `${s.toFixed(1)} s` : `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`);

export class Timeline {
  constructor(on) {
    this.on = on; // {show(scene), say(line), past(on), names(of the runs)}
    this.section = by("time");
    this.canvas = made("canvas", "", { id: "strip", tabIndex: 0 });
    this.canvas.setAttribute("role", "slider");
    this.canvas.ariaLabel = "Time: arrow keys go back and on, with Shift by an event, Home and End to the ends, Space plays";
    this.label = made("output", "", { id: "at" });
    this.section.replaceChildren(this.buttons(), this.canvas);
    this.clear(false);
    this.section.hidden = true;
    this.canvas.onpointerdown = (e) => (this.canvas.setPointerCapture(e.pointerId), (this.dragged = true), this.pointed(e));
    this.canvas.onpointermove = (e) => (this.dragged ? this.pointed(e) : this.hint(e));
    this.canvas.onpointerup = this.canvas.onpointercancel = () => (this.dragged = false);
    this.canvas.onkeydown = (e) => this.key(e);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  buttons() {
    const button = (id, text, label, onclick) => (this[id] = made("button", text, { type: "button", id: `time-${id}`, ariaLabel: label, title: label, onclick }));
    const row = made("fieldset", "", { id: "transport" });
    row.append(
      button("previous", "«", "To the event before", () => this.event(-1)),
      button("back", "‹", "One step back", () => this.step(-1)),
      button("play", "▶", "Play", () => this.toggle()),
      button("forward", "›", "One step on", () => this.step(1)),
      button("next", "»", "To the next event", () => this.event(1)),
      button("now", "Now", "Show the fleet as it is now", () => this.live()),
      this.speeds(),
      this.label,
    );
    return row;
  }

  speeds() {
    this.speed = made("select", "", { id: "time-speed", ariaLabel: "Speed" });
    for (const times of ["0.5", "1", "2", "4", "8", "max"]) this.speed.add(new Option(times === "max" ? times : `${times}x`, times));
    this.speed.value = "1";
    this.speed.onchange = () => this.on.say(`speed ${this.speed.value}`);
    return this.speed;
  }

  // A new run: of a recording its own length is known.
  clear(recorded) {
    this.recorded = recorded;
    this.entries = [];
    this.events = [];
    this.scenes = [];
    this.told = 0;
    this.past = this.then = this.newest = null; // the time that a person looks at instead of now, and its scene
    this.run = recorded ? { last_s: 0, known_s: 0, playing: false } : null;
    this.robots = [];
    // From the beginning, so that the map does not change its size under a pointer.
    this.section.hidden = false;
    this.play.hidden = this.speed.hidden = !recorded;
    this.now.hidden = true;
    this.draw();
  }

  // Notes a scene, and returns the one that is to be shown: another while a person looks back.
  note(scene) {
    this.robots = scene.robots.map((r) => r.id);
    if (this.recorded) {
      this.at_s = scene.at_s;
      this.draw();
      return scene;
    }
    const last = this.scenes.at(-1);
    if (last && scene.at_s < last.at_s) this.clear(false);
    if (!last || scene.at_s > last.at_s) {
      this.add([entry(scene, this.told)]);
      this.told = scene.told;
      this.scenes = thinned([...this.scenes, scene]);
    }
    this.newest = scene;
    this.draw();
    return this.past === null ? scene : this.then;
  }

  add(entries) {
    for (const e of entries) {
      this.events.push(...e.stages);
      if (e.at_s !== undefined) this.entries.push(e);
    }
    this.events.sort((a, b) => a.at_s - b.at_s);
    if (this.entries.length > 2 * KEPT) this.entries = this.entries.filter((_, k) => k % 2 === 0);
  }

  // What a recording tells of its run.
  history(message) {
    if (message.count === message.entries.length) [this.entries, this.events] = [[], []];
    this.run = message;
    this.add(message.entries);
    this.on.names(message.names);
    write(this.play, message.playing ? "⏸" : "▶");
    this.play.ariaLabel = this.play.title = message.playing ? "Pause" : "Play";
    this.draw();
  }

  ends() {
    if (this.recorded) return [0, this.run.last_s];
    return [this.scenes[0]?.at_s ?? 0, this.scenes.at(-1)?.at_s ?? 0];
  }

  here() {
    return this.recorded ? this.wanted ?? this.at_s ?? 0 : this.past ?? this.ends()[1];
  }

  // To a time: of a recording one question at a time, the newest wins.
  seek(at_s) {
    const [from, to] = this.ends();
    const wanted = Math.min(to, Math.max(from, at_s));
    if (!this.recorded) return this.look(wanted);
    this.wanted = wanted;
    this.draw();
    if (this.asking) return;
    this.asking = setTimeout(() => {
      this.asking = null;
      const at_s = this.wanted;
      this.wanted = null;
      this.on.say(`goto ${at_s.toFixed(1)}`);
    }, 60);
  }

  look(at_s) {
    this.past = at_s;
    this.then = this.scenes.findLast((s) => s.at_s <= at_s + 0.001) ?? this.scenes[0];
    this.now.hidden = false;
    this.on.past(true);
    this.on.show(this.then);
    this.draw();
  }

  live() {
    this.past = null;
    this.now.hidden = true;
    this.on.past(false);
    if (this.newest) this.on.show(this.newest);
    this.draw();
  }

  step(count) {
    if (this.recorded) return this.on.say(count < 0 ? `back ${-count}` : `step ${count}`);
    const at = this.scenes.findLastIndex((s) => s.at_s <= this.here() + 0.001);
    const next = this.scenes[at + count];
    if (next) this.look(next.at_s);
  }

  event(way) {
    if (this.recorded) return this.on.say(way < 0 ? "previous" : "next");
    const here = this.here();
    const found = way < 0 ? this.events.findLast((e) => e.at_s < here - 0.05) : this.events.find((e) => e.at_s > here + 0.05);
    if (found) this.seek(found.at_s);
  }

  toggle() {
    if (this.recorded) this.on.say(this.run.playing ? "pause" : "play");
  }

  key(e) {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
    const [from, to] = this.ends();
    if (way && e.shiftKey) this.event(way);
    else if (way) this.step(way);
    else if (e.key === "Home") this.seek(from);
    else if (e.key === "End") this.recorded ? this.seek(to) : this.live();
    else if (e.key === " ") this.toggle();
    else return;
    e.preventDefault();
  }

  // From a time to a pixel, and back.
  x(at_s) {
    const [from, to] = this.ends();
    return ((at_s - from) / Math.max(to - from, 0.1)) * this.canvas.clientWidth;
  }

  pointed(e) {
    const box = this.canvas.getBoundingClientRect();
    const [from, to] = this.ends();
    const at_s = from + ((e.clientX - box.left) / box.width) * (to - from);
    const [near] = this.near(e);
    this.seek(near ? near.at_s : at_s);
  }

  near(e) {
    const x = e.clientX - this.canvas.getBoundingClientRect().left;
    return this.events.filter((event) => MARKS[event.mark] && Math.abs(this.x(event.at_s) - x) < NEAR);
  }

  hint(e) {
    this.canvas.title = this.near(e).map(({ time, text }) => `${time}  ${text}`).join("\n");
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (!this.section.hidden) this.paint();
    });
  }

  paint() {
    const { canvas } = this;
    const [w, h, dots] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio || 1];
    if (w === 0 || h === 0) return;
    if (canvas.width !== Math.round(w * dots)) canvas.width = Math.round(w * dots);
    if (canvas.height !== Math.round(h * dots)) canvas.height = Math.round(h * dots);
    const c = canvas.getContext("2d");
    c.setTransform(dots, 0, 0, dots, 0, 0);
    c.clearRect(0, 0, w, h);
    c.font = "11px system-ui, sans-serif";
    const low = h - FOOT - BAND;
    this.bands(c, low);
    this.times(c, w, h);
    this.errors(c, low);
    this.marks(c, low);
    this.cursor(c, h);
    const [from, to] = this.ends();
    const here = this.here();
    write(this.label, this.recorded ? `${clock(here)} of ${clock(to)}` : this.past === null ? clock(here) : `${clock(here)}: the past`);
    Object.assign(canvas, { ariaValueMin: from.toFixed(1), ariaValueMax: to.toFixed(1), ariaValueNow: here.toFixed(1), ariaValueText: this.label.textContent });
  }

  // What lasts: who led, when the shape stood, when an emergency stop held robots, and what has not been read yet.
  bands(c, low) {
    this.entries.forEach((e, k) => {
      const next = this.entries[k + 1];
      const x = Math.round(this.x(e.at_s));
      const wide = Math.round(this.x(next ? next.at_s : e.at_s + 0.5)) - x;
      const band = (style, y, high, alpha) => {
        c.globalAlpha = alpha;
        c.fillStyle = style;
        c.fillRect(x, y, wide, high);
      };
      if (e.formed) band(ink("--good"), 0, low, 0.12);
      if (e.held) band(ink("--stop"), 0, low, 0.25);
      if (e.leader) band(colour(Math.max(this.robots.indexOf(e.leader), 0)), low, BAND, 1);
    });
    if (this.recorded && this.run.known_s < this.run.last_s) {
      c.globalAlpha = 0.5;
      c.fillStyle = ink("--line");
      c.fillRect(this.x(this.run.known_s), 0, c.canvas.clientWidth, low + BAND);
    }
    c.globalAlpha = 1;
  }

  times(c, w, h) {
    const [from, to] = this.ends();
    const step = TICKS.find((s) => (s / Math.max(to - from, 0.1)) * w >= TICK) ?? TICKS.at(-1);
    c.fillStyle = ink("--dim");
    c.strokeStyle = ink("--line");
    c.lineWidth = 1;
    c.textAlign = "left";
    c.beginPath();
    for (let n = Math.ceil(from / step); n * step <= to; n++) {
      const x = this.x(n * step);
      c.moveTo(x, 0);
      c.lineTo(x, h - FOOT);
      if (x < w - 30) c.fillText(step < 60 ? `${n * step} s` : `${(n * step) / 60} min`, x + 3, h - 4);
    }
    c.stroke();
  }

  // The mean error of those with a place, the largest at the top.
  errors(c, low) {
    const most = Math.max(HIGH, ...this.entries.map((e) => (e.error ? e.error[0] : 0)));
    c.strokeStyle = ink("--accent");
    c.lineWidth = 1.5;
    c.lineJoin = "round";
    c.beginPath();
    let drawn = false;
    for (const e of this.entries) {
      if (e.error) c[drawn ? "lineTo" : "moveTo"](this.x(e.at_s), low - 2 - (e.error[0] / most) * (low - 14));
      drawn = e.error !== null;
    }
    c.stroke();
    if (this.entries.some((e) => e.error)) {
      c.fillStyle = ink("--accent");
      c.textAlign = "left";
      c.fillText(`position error, up to ${most.toFixed(1)} m`, 4, 11);
    }
  }

  marks(c, low) {
    c.textAlign = "center";
    c.font = "12px system-ui, sans-serif";
    const [from] = this.ends();
    for (const event of this.events) {
      const mark = MARKS[event.mark];
      if (!mark || event.at_s < from) continue;
      c.fillStyle = ink(["✕", "■", "!"].includes(mark) ? "--bad" : mark === "▲" ? "--good" : "--text");
      c.strokeStyle = ink("--panel");
      c.lineWidth = 3;
      const x = Math.min(Math.max(this.x(event.at_s), 7), this.canvas.clientWidth - 7);
      c.strokeText(mark, x, low - 4);
      c.fillText(mark, x, low - 4);
    }
  }

  cursor(c, h) {
    const x = this.x(this.here());
    c.strokeStyle = ink("--text");
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(x, 0);
    c.lineTo(x, h - FOOT);
    c.stroke();
  }
}
