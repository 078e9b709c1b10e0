// What pointers and keys do to the map: choose, send, drag the landmark and what can be lifted, move the view, zoom with wheel or two fingers.
import { modified } from "./keys.js";

const NEAR = 14; // pixels round what is pointed at
const FINGER = 24; // a finger is broader
const STILL = 4; // a click may move so far
const HOLD_MS = 500; // a finger that stays sends the chosen robot to its place, also where a tap would choose another

export class Gestures {
  constructor(floor) {
    const { canvas } = (this.floor = floor);
    this.dragged = null;
    this.fingers = new Map();
    this.pinch = null;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointerleave", () => floor.on.point(null));
    // A drag whose end is not told gives no order.
    for (const name of ["pointercancel", "lostpointercapture"])
      canvas.addEventListener(name, (e) => (this.lift(e), this.abandon()));
    addEventListener("blur", () => (this.fingers.clear(), (this.pinch = null), this.abandon()));
    // A second finger may be beside the map.
    addEventListener("pointerdown", (e) => this.dragged && this.dragged.id !== e.pointerId && this.abandon(), true);
    // The browser's own answer to a finger that stays.
    canvas.addEventListener("contextmenu", (e) => e.pointerType === "touch" && e.preventDefault());
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
    for (const name of ["focus", "blur"]) canvas.addEventListener(name, () => floor.draw());
  }

  pixel(e) {
    const box = this.floor.canvas.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  }

  toFloor(e) {
    return this.floor.view.toFloor(...this.pixel(e));
  }

  at(e) {
    const { floor } = this;
    if (!floor.scene || !floor.fit()) return {};
    const [px, py] = this.pixel(e);
    const reach = e.pointerType === "touch" ? FINGER : NEAR;
    const near = ([x, y], within) => Math.hypot(px - x, py - y) < within;
    if (floor.movable() && near(floor.toPixel(...floor.scene.landmark), reach)) return { landmark: true };
    const robot = floor.here().find((r) => near(floor.toPixel(r.x, r.y), Math.max(reach, r.r * floor.view.at.scale)));
    if (!floor.map.offers.includes("place")) return { robot };
    const half = ({ at, r, box }) => r ?? Math.min(...box.map((corner) => Math.hypot(corner[0] - at[0], corner[1] - at[1]))) / 2;
    const object = floor.scene.objects.find((o) => near(floor.toPixel(...o.at), Math.max(reach, half(o) * floor.view.at.scale)));
    return { robot, lifted: robot?.alive ? robot.id : object?.id };
  }

  // Only one pointer, and its main button, gives orders: a right click opens a menu, two fingers zoom, a long press sends.
  down(e) {
    const { floor } = this;
    if (!floor.fit()) return;
    if (e.pointerType === "touch") this.fingers.set(e.pointerId, this.pixel(e));
    if (this.fingers.size === 2) return this.pinched();
    if (e.button !== 0 || !e.isPrimary) return;
    const { landmark, robot, lifted } = this.at(e);
    floor.canvas.setPointerCapture(e.pointerId);
    this.dragged = { id: e.pointerId, from: this.pixel(e), place: this.toFloor(e), robot, landmark, lifted, moved: false };
    floor.moving = landmark ? this.toFloor(e) : null;
    if (e.pointerType === "touch" && !landmark) this.hold = setTimeout(() => this.held(), HOLD_MS);
  }

  held() {
    const { place, moved } = this.dragged;
    if (moved) return;
    this.abandon();
    this.floor.on.send(...place);
  }

  move(e) {
    const { floor, dragged: d } = this;
    if (this.fingers.has(e.pointerId)) this.fingers.set(e.pointerId, this.pixel(e));
    if (this.pinch) return this.pinched();
    if (!floor.fit()) return;
    floor.on.point(this.toFloor(e));
    const over = d ? {} : this.at(e);
    if (!d) floor.canvas.className = over.landmark || over.lifted ? "grab" : "";
    if (d?.id !== e.pointerId) return;
    if (e.buttons === 0) return this.abandon();
    const [px, py] = this.pixel(e);
    if (Math.hypot(px - d.from[0], py - d.from[1]) > STILL) d.moved = true;
    if (d.landmark) floor.moving = this.toFloor(e);
    else if (d.lifted) floor.lifted = d.moved ? { id: d.lifted, at: this.toFloor(e) } : null;
    else if (d.moved && !floor.follow) floor.view.place(...d.place, floor.view.at.scale, px, py);
    if (d.moved) floor.canvas.className = "grabbing";
    floor.draw();
  }

  // Two fingers: what was between them stays between them.
  pinched() {
    const { view } = this.floor;
    const [[ax, ay], [bx, by]] = [...this.fingers.values()];
    const now = { x: (ax + bx) / 2, y: (ay + by) / 2, apart: Math.max(1, Math.hypot(ax - bx, ay - by)) };
    if (this.pinch) {
      view.place(...this.pinch.place, this.pinch.scale, now.x, now.y);
      view.zoom(now.apart / this.pinch.apart, [now.x, now.y]);
    } else {
      this.abandon();
      this.pinch = { place: view.toFloor(now.x, now.y), scale: view.at.scale, apart: now.apart };
    }
    this.floor.draw();
  }

  lift(e) {
    this.fingers.delete(e.pointerId);
    this.pinch = null;
  }

  abandon() {
    clearTimeout(this.hold);
    this.dragged = this.floor.moving = this.floor.lifted = null;
    this.floor.canvas.className = "";
    this.floor.draw();
  }

  up(e) {
    this.lift(e);
    const d = this.dragged;
    if (d?.id !== e.pointerId) return;
    this.abandon();
    const { on } = this.floor;
    if (d.landmark && d.moved) on.landmark(...this.toFloor(e));
    else if (d.lifted && d.moved) on.place(d.lifted, ...this.toFloor(e));
    else if (d.robot) on.choose(d.robot.id);
    else if (!d.moved && !d.landmark) on.send(...this.toFloor(e));
  }

  wheel(e) {
    e.preventDefault();
    if (this.floor.fit()) this.floor.zoom(e.deltaY < 0 ? 1.15 : 0.87, this.pixel(e));
  }

  // With a modifier a key is the browser's; one that is held gives one order.
  key(e) {
    const { floor } = this;
    if (!floor.fit() || modified(e)) return;
    const { view } = floor;
    const step = 40 / view.at.scale;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (way && !floor.driving) {
      view.shows = null;
      view.middle(view.at.x + way[0] * step, view.at.y + way[1] * step);
    } else if (e.key === "Enter") !e.repeat && floor.on.send(view.at.x, view.at.y);
    else if (e.key === "l" && floor.map.offers.includes("landmark")) !e.repeat && floor.on.landmark(view.at.x, view.at.y);
    else if (e.key === "+") floor.zoom(1.3);
    else if (e.key === "-") floor.zoom(0.77);
    else if (e.key === "0") floor.showAll("all");
    else if (e.key === "f") floor.showAll("fleet");
    else return;
    e.preventDefault();
    floor.draw();
  }
}
