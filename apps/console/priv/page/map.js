// The map: what is known of the floor and its robots, which part of it is seen, and who draws it.
import { paint } from "./drawing.js";
import { Gestures } from "./gestures.js";
import { View } from "./view.js";

// Okabe and Ito's colours, which the colour-blind tell apart.
const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#999933", "#882255"];
const TRAIL = 600;
const JUMP = 1; // metres from one scene to the next
const GAP = 2; // seconds from one scene to the next
const AROUND = 2; // metres round robots without a map

export const colour = (index) => COLOURS[index % COLOURS.length];

export class FloorView {
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on; // {choose(id), send(x, y), landmark(x, y), place(id, x, y), point([x, y] or null)}
    this.map = null;
    this.scene = null;
    this.chosen = null;
    this.about = null; // what is known of the chosen robot
    this.follow = false;
    this.trails = true;
    this.sonar = false;
    this.driving = false;
    this.moving = null; // where the landmark is dragged
    this.lifted = null; // {id, at}: a robot, a ball or a box, and where it is dragged
    this.ghost = null; // {id, x, y}: where a robot is to go that has not said its way yet
    this.paths = new Map();
    this.frame = 0; // that of the robots that are drawn: where others are to these is not known
    this.view = new View(canvas);
    this.gestures = new Gestures(this);
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  setMap(map) {
    this.map = map;
    this.fresh();
    this.paths.clear();
    this.floor = map.width ? [-map.width / 2, -map.height / 2, map.width / 2, map.height / 2] : null;
    this.draw();
  }

  // Another floor: what was seen of the former one says nothing.
  fresh() {
    this.view.stale = true;
    this.view.shows ??= "fleet";
  }

  setScene(scene) {
    // A time that was jumped to has a way of its own.
    const since = scene.at_s - (this.scene?.at_s ?? scene.at_s);
    if (since < 0 || since > GAP) this.paths.clear();
    this.scene = scene;
    const frame = this.robot(this.chosen)?.frame ?? 0;
    if (frame !== this.frame && !this.map?.width) (this.floor = null), this.fresh();
    this.frame = frame;
    for (const r of scene.robots) if (r.x !== null) this.drove(r);
    if (this.map && !this.map.width) this.grow();
    this.draw();
  }

  drove(r) {
    let path = this.paths.get(r.id) ?? [];
    if (path.frame !== r.frame) path = Object.assign([], { frame: r.frame });
    const last = path.at(-1);
    const way = last ? Math.hypot(last[0] - r.x, last[1] - r.y) : JUMP;
    // In real time what has jumped was not driven: its pose is told in another frame now.
    if (way > 0.03) path.push([r.x, r.y, way >= JUMP && !this.map?.width]);
    if (path.length > TRAIL) path.shift();
    this.paths.set(r.id, path);
  }

  // What the mission of the chosen robot draws, else that of the fleet.
  layer() {
    return this.about?.layer.length ? this.about.layer : this.scene.layer;
  }

  // Without a map there is an empty floor, of whole metres, that holds all places where robots were, and what is drawn.
  grow() {
    let [left, bottom, right, top] = this.floor ?? [Infinity, Infinity, -Infinity, -Infinity];
    const drawn = this.layer().flatMap((sign) => sign.points.map(([x, y]) => ({ x, y })));
    for (const { x, y } of [...this.here(), ...drawn]) {
      [left, right] = [Math.min(left, Math.floor(x - AROUND)), Math.max(right, Math.ceil(x + AROUND))];
      [bottom, top] = [Math.min(bottom, Math.floor(y - AROUND)), Math.max(top, Math.ceil(y + AROUND))];
    }
    if (left <= right) this.floor = [left, bottom, right, top];
  }

  zoom(factor, pixel) {
    if (this.fit()) this.view.zoom(factor, pixel);
    this.draw();
  }

  // The whole floor, or the fleet.
  showAll(what) {
    this.view.shows = what;
    this.view.stale = true;
    this.draw();
  }

  // Whether there is something to show; brings into view what belongs there.
  fit() {
    if (!this.map || !this.floor || !this.view.measure()) return false;
    const seen = this.scene ? this.here().map((r) => [r.x, r.y]) : [];
    if (this.scene?.landmark) seen.push(this.scene.landmark);
    if (!this.gestures.dragged || !this.view.at) this.view.fit(this.floor, seen);
    const r = this.follow && this.robot(this.chosen);
    if (r && r.x !== null) this.view.middle(r.x, r.y);
    return true;
  }

  robot(id) {
    return this.scene?.robots.find((r) => r.id === id);
  }

  // Those whose places on this floor are known.
  here() {
    return this.scene.robots.filter((r) => r.x !== null && r.frame === this.frame);
  }

  // Whether there is a landmark that a person may move.
  movable() {
    return this.scene?.landmark && this.map.offers.includes("landmark");
  }

  toPixel(x, y) {
    return this.view.toPixel(x, y);
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (this.fit()) this.paint();
    });
  }

  paint() {
    paint(this, colour);
  }
}
