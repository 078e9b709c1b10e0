// The map: what is drawn of a scene, and what a pointer does to it. Metres, x right, y up.
import { modified } from "./keys.js";

// Okabe and Ito's colours, which the colour-blind tell apart.
const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#999933", "#882255"];
const TRAIL = 600;
const JUMP = 1; // metres from one scene to the next
const AROUND = 2; // metres round robots without a map
const NEAR = 14; // pixels round what is pointed at

export const colour = (index) => COLOURS[index % COLOURS.length];

export class FloorView {
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on; // {choose(id), send(x, y), landmark(x, y)}
    this.map = null;
    this.scene = null;
    this.chosen = null;
    this.follow = false;
    this.trails = true;
    this.paths = new Map();
    this.frame = 0; // that of the robots that are drawn: where others are to these is not known
    this.view = null; // {x, y, scale}: the middle of the picture, pixels a metre
    this.dragged = null;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    // A drag whose end is not told gives no order.
    for (const name of ["pointercancel", "lostpointercapture"]) canvas.addEventListener(name, () => this.abandon());
    addEventListener("blur", () => this.abandon());
    // A second finger may be beside the map.
    addEventListener("pointerdown", (e) => this.dragged && this.dragged.id !== e.pointerId && this.abandon(), true);
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
    for (const name of ["focus", "blur"]) canvas.addEventListener(name, () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  setMap(map) {
    this.map = map;
    this.view = null;
    this.paths.clear();
    this.floor = map.width ? [-map.width / 2, -map.height / 2, map.width / 2, map.height / 2] : null;
    this.draw();
  }

  setScene(scene) {
    const back = this.scene && scene.at_s < this.scene.at_s;
    if (back) this.paths.clear();
    this.scene = scene;
    const frame = this.robot(this.chosen)?.frame ?? 0;
    if (frame !== this.frame && !this.map?.width) [this.floor, this.view] = [null, null];
    this.frame = frame;
    for (const r of scene.robots) {
      if (r.x === null) continue;
      let path = this.paths.get(r.id) ?? [];
      if (path.frame !== r.frame) path = Object.assign([], { frame: r.frame });
      const last = path.at(-1);
      const way = last ? Math.hypot(last[0] - r.x, last[1] - r.y) : JUMP;
      // In real time what has jumped was not driven: its pose is told in another frame now.
      if (way > 0.03) path.push([r.x, r.y, way >= JUMP && !this.map?.width]);
      if (path.length > TRAIL) path.shift();
      this.paths.set(r.id, path);
    }
    if (this.map && !this.map.width) this.grow();
    this.draw();
  }

  // Without a map there is an empty floor, of whole metres, that holds all places where robots were.
  grow() {
    const were = this.floor;
    let [left, bottom, right, top] = were ?? [Infinity, Infinity, -Infinity, -Infinity];
    for (const { x, y } of this.here()) {
      [left, right] = [Math.min(left, Math.floor(x - AROUND)), Math.max(right, Math.ceil(x + AROUND))];
      [bottom, top] = [Math.min(bottom, Math.floor(y - AROUND)), Math.max(top, Math.ceil(y + AROUND))];
    }
    if (left > right) return;
    this.floor = [left, bottom, right, top];
    if (!this.mine && String(this.floor) !== String(were)) this.view = null;
  }

  zoom(factor) {
    this.mine = factor !== 0;
    if (factor === 0) this.view = null;
    else if (this.fit()) this.view.scale = Math.min(400, Math.max(2, this.view.scale * factor));
    this.draw();
  }

  // The picture's size, and a view of the whole map where there is none yet.
  fit() {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (!this.map || !this.floor || w === 0 || h === 0) return false;
    const dots = devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(w * dots) || this.canvas.height !== Math.round(h * dots)) {
      this.canvas.width = Math.round(w * dots);
      this.canvas.height = Math.round(h * dots);
    }
    this.size = { w, h, dots };
    const [left, bottom, right, top] = this.floor;
    this.view ??= {
      x: (left + right) / 2, y: (bottom + top) / 2, scale: 0.95 * Math.min(w / (right - left), h / (top - bottom)),
    };
    const r = this.follow && this.robot(this.chosen);
    if (r && r.x !== null) [this.view.x, this.view.y] = [r.x, r.y];
    return true;
  }

  robot(id) {
    return this.scene?.robots.find((r) => r.id === id);
  }

  // Those whose places on this floor are known.
  here() {
    return this.scene.robots.filter((r) => r.x !== null && r.frame === this.frame);
  }

  toPixel(x, y) {
    const { view, size } = this;
    return [size.w / 2 + (x - view.x) * view.scale, size.h / 2 - (y - view.y) * view.scale];
  }

  toFloor(e) {
    const box = this.canvas.getBoundingClientRect();
    const { view, size } = this;
    return [
      view.x + (e.clientX - box.left - size.w / 2) / view.scale,
      view.y - (e.clientY - box.top - size.h / 2) / view.scale,
    ];
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
    const c = this.canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const ink = (name) => style.getPropertyValue(name).trim();
    const { map, scene, view, size } = this;
    c.setTransform(size.dots, 0, 0, size.dots, 0, 0);
    c.clearRect(0, 0, size.w, size.h);

    const [left, top] = this.toPixel(this.floor[0], this.floor[3]);
    const [right, bottom] = this.toPixel(this.floor[2], this.floor[1]);
    c.fillStyle = ink("--panel");
    c.fillRect(left, top, right - left, bottom - top);
    c.lineWidth = 1;
    if (!map.width) this.metres(c, ink("--line"));
    c.strokeStyle = ink(map.width ? "--wall" : "--line");
    c.strokeRect(left, top, right - left, bottom - top);
    c.fillStyle = ink("--wall");
    const cell = map.cell * view.scale;
    for (const [from, row, count] of map.walls)
      c.fillRect(left + from * cell, bottom - (row + 1) * cell, count * cell + 0.5, cell + 0.5);
    if (!scene) return;

    const placed = this.here().map((r) => [scene.robots.indexOf(r), r]);
    if (this.trails) for (const [k, r] of placed) this.trail(c, r, colour(k));
    for (const [k, r] of placed) this.slot(c, r, colour(k));
    for (const [k, r] of placed) this.leash(c, r, colour(k));
    if (this.about && placed.some(([, r]) => r.id === this.about.id)) this.way(c, ink("--accent"));
    if (this.sonar && this.about) this.cones(c, this.robot(this.about.id), ink);
    this.landmark(c, this.dragged?.landmark ?? scene.landmark, ink);
    for (const [k, r] of placed) this.body(c, r, colour(k), ink);
    this.labels(c, placed.map(([, r]) => r), ink);
    if (this.canvas.matches(":focus-visible")) this.cross(c, ink("--text"));
  }

  // Where the keyboard points: the middle of the view.
  cross(c, ink) {
    const [x, y] = [this.size.w / 2, this.size.h / 2];
    c.strokeStyle = ink;
    c.lineWidth = 1.5;
    c.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      c.moveTo(x + 4 * dx, y + 4 * dy);
      c.lineTo(x + 14 * dx, y + 14 * dy);
    }
    c.stroke();
  }

  // A line for each metre, and their length once, where they are not too close.
  metres(c, ink) {
    const [left, bottom, right, top] = this.floor;
    const step = [1, 5, 10, 50, 100].find((m) => m * this.view.scale > 12) ?? 1000;
    c.strokeStyle = ink;
    c.beginPath();
    for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
      c.moveTo(...this.toPixel(x, bottom));
      c.lineTo(...this.toPixel(x, top));
    }
    for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
      c.moveTo(...this.toPixel(left, y));
      c.lineTo(...this.toPixel(right, y));
    }
    c.stroke();
  }

  trail(c, r, ink) {
    const path = this.paths.get(r.id);
    // After a new map the last scene is still that of the former one.
    if (!path || path.length < 2) return;
    c.beginPath();
    for (const [x, y, jumped] of path) c[jumped ? "moveTo" : "lineTo"](...this.toPixel(x, y));
    c.strokeStyle = ink;
    c.globalAlpha = 0.45;
    c.lineWidth = 1.5;
    c.stroke();
    c.globalAlpha = 1;
  }

  // What the chosen robot hears: its sonars, or the beams of its lidar, as cones.
  cones(c, r, theme) {
    if (!r?.alive) return;
    const half = this.about.cone;
    const [cos, sin] = [Math.cos(r.a), Math.sin(r.a)];
    c.fillStyle = theme("--accent");
    c.globalAlpha = 0.15;
    for (const [dx, dy, heading, range] of this.about.sonar) {
      const [x, y] = this.toPixel(r.x + dx * cos - dy * sin, r.y + dx * sin + dy * cos);
      const angle = -(r.a + heading);
      c.beginPath();
      c.moveTo(x, y);
      c.arc(x, y, range * this.view.scale, angle - half, angle + half);
      c.closePath();
      c.fill();
    }
    c.globalAlpha = 1;
  }

  // The way that the chosen robot takes now, from where it believes to be.
  way(c, ink) {
    const { pose, way } = this.about;
    if (!pose || way.length === 0) return;
    c.strokeStyle = c.fillStyle = ink;
    c.lineWidth = 2;
    c.beginPath();
    for (const place of [pose, ...way]) c.lineTo(...this.toPixel(...place));
    c.stroke();
    for (const place of way) {
      c.beginPath();
      c.arc(...this.toPixel(...place), 3.5, 0, 7);
      c.fill();
    }
  }

  slot(c, r, ink) {
    if (!r.slot || !r.alive) return;
    const [x, y] = this.toPixel(...r.slot);
    c.strokeStyle = ink;
    c.setLineDash([3, 3]);
    c.beginPath();
    c.arc(x, y, r.r * this.view.scale, 0, 7);
    c.moveTo(...this.toPixel(r.x, r.y));
    c.lineTo(x, y);
    c.stroke();
    c.setLineDash([]);
  }

  // From a follower to its leader, where its place is not known.
  leash(c, r, ink) {
    const leader = r.follows && this.robot(r.follows);
    if (!r.alive || !leader?.alive || !this.here().includes(leader)) return;
    c.strokeStyle = ink;
    c.lineWidth = 1;
    c.setLineDash([3, 3]);
    c.beginPath();
    c.moveTo(...this.toPixel(r.x, r.y));
    c.lineTo(...this.toPixel(leader.x, leader.y));
    c.stroke();
    c.setLineDash([]);
  }

  body(c, r, ink, theme) {
    const [x, y] = this.toPixel(r.x, r.y);
    const radius = Math.max(4, r.r * this.view.scale);
    if (r.unsure && r.alive) {
      c.globalAlpha = 0.13;
      c.fillStyle = ink;
      c.beginPath();
      c.arc(x, y, r.unsure * this.view.scale, 0, 7);
      c.fill();
      c.globalAlpha = 1;
    }
    c.globalAlpha = r.alive ? 1 : 0.35;
    c.fillStyle = ink;
    c.beginPath();
    this.outline(c, r, x, y, radius);
    c.fill();
    c.strokeStyle = theme("--text");
    c.lineWidth = r.leader ? 3 : 1;
    c.stroke();
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(x, y);
    c.lineTo(x + radius * Math.cos(r.a), y - radius * Math.sin(r.a));
    c.strokeStyle = "#fff";
    c.stroke();
    if (r.id === this.chosen) {
      c.strokeStyle = theme("--accent");
      c.beginPath();
      c.arc(x, y, radius + 5, 0, 7);
      c.stroke();
    }
    c.globalAlpha = 1;
  }

  // A disc, or a box whose corners are in the robot's own frame.
  outline(c, r, x, y, radius) {
    if (!r.box?.length) return c.arc(x, y, radius, 0, 7);
    const [scale, cos, sin] = [radius / r.r, Math.cos(r.a), Math.sin(r.a)];
    for (const [ahead, left] of r.box) c.lineTo(x + scale * (ahead * cos - left * sin), y - scale * (ahead * sin + left * cos));
    c.closePath();
  }

  // Names above the robots, over whatever is behind them; below, where there is a name already.
  labels(c, robots, theme) {
    c.font = "12px system-ui, sans-serif";
    c.textAlign = "center";
    c.strokeStyle = theme("--panel");
    c.fillStyle = theme("--text");
    c.lineWidth = 3;
    const taken = [];
    for (const r of robots) {
      const text = r.id + (r.leader ? " ★" : "") + (r.alive ? "" : r.state === "not_heard" ? " ?" : " ✕");
      const [x, y] = this.toPixel(r.x, r.y);
      const [half, out] = [c.measureText(text).width / 2, Math.max(4, r.r * this.view.scale) + 6];
      const free = (at) => !taken.some((t) => Math.abs(t.x - x) < t.half + half && Math.abs(t.at - at) < 13);
      const at = free(y - out) ? y - out : y + out + 9;
      taken.push({ x, at, half });
      c.globalAlpha = r.alive ? 1 : 0.35;
      c.strokeText(text, x, at);
      c.fillText(text, x, at);
    }
    c.globalAlpha = 1;
  }

  landmark(c, place, theme) {
    if (!place) return;
    const [x, y] = this.toPixel(...place);
    c.fillStyle = "#f0e442";
    c.strokeStyle = theme("--text");
    c.lineWidth = 1.5;
    c.beginPath();
    for (const [dx, dy] of [[0, -10], [9, 7], [-9, 7]]) c.lineTo(x + dx, y + dy);
    c.closePath();
    c.fill();
    c.stroke();
  }

  at(e) {
    const box = this.canvas.getBoundingClientRect();
    const near = ([x, y], reach) =>
      Math.hypot(e.clientX - box.left - x, e.clientY - box.top - y) < reach;
    if (!this.scene || !this.fit()) return {};
    if (this.map.offers.includes("landmark") && this.scene.landmark && near(this.toPixel(...this.scene.landmark), NEAR)) return { landmark: true };
    const robot = this.here().find((r) => near(this.toPixel(r.x, r.y), Math.max(NEAR, r.r * this.view.scale)));
    return { robot };
  }

  // Only one pointer, and its main button, gives orders: a right click opens a menu, two fingers are no click.
  down(e) {
    if (!this.fit() || e.button !== 0 || !e.isPrimary) return;
    const { landmark, robot } = this.at(e);
    this.canvas.setPointerCapture(e.pointerId);
    this.dragged = { id: e.pointerId, from: [e.clientX, e.clientY], view: { ...this.view }, robot, moved: false };
    if (landmark) this.dragged.landmark = this.toFloor(e);
  }

  move(e) {
    const d = this.dragged;
    if (d?.id !== e.pointerId) return;
    if (e.buttons === 0) return this.abandon();
    const [dx, dy] = [e.clientX - d.from[0], e.clientY - d.from[1]];
    if (Math.hypot(dx, dy) > 4) d.moved = true;
    if (d.landmark) d.landmark = this.toFloor(e);
    else if (d.moved && !this.follow && (this.mine = true))
      Object.assign(this.view, { x: d.view.x - dx / d.view.scale, y: d.view.y + dy / d.view.scale });
    this.draw();
  }

  abandon() {
    this.dragged = null;
    this.draw();
  }

  up(e) {
    const d = this.dragged;
    if (d?.id !== e.pointerId) return;
    this.dragged = null;
    if (d.landmark && d.moved) this.on.landmark(...this.toFloor(e));
    else if (d.robot) this.on.choose(d.robot.id);
    else if (!d.moved && !d.landmark) this.on.send(...this.toFloor(e));
    this.draw();
  }

  wheel(e) {
    e.preventDefault();
    this.zoom(e.deltaY < 0 ? 1.15 : 0.87);
  }

  // With a modifier a key is the browser's; one that is held gives one order.
  key(e) {
    if (!this.fit() || modified(e)) return;
    const step = 40 / this.view.scale;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (way && !this.driving) {
      this.mine = true;
      this.view.x += way[0] * step;
      this.view.y += way[1] * step;
    } else if (e.key === "Enter") !e.repeat && this.on.send(this.view.x, this.view.y);
    else if (e.key === "l" && this.map.offers.includes("landmark")) !e.repeat && this.on.landmark(this.view.x, this.view.y);
    else if (e.key === "+") this.zoom(1.3);
    else if (e.key === "-") this.zoom(0.77);
    else if (e.key === "0") this.zoom(0);
    else return;
    e.preventDefault();
    this.draw();
  }
}
