// Draws the map of a FloorView on its canvas. Nothing here changes what it draws.
import { FONT, dashed, ink, text } from "./ink.js";

const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const LINES = 44; // pixels from one line of the grid to the next, at least
const BAR = 70; // pixels of the scale bar, at least
export const DOUBT = 2; // metres; a doubt that is larger is told as a number

export function paint(floor, colour) {
  const c = floor.canvas.getContext("2d");
  const { map, scene, view } = floor;
  const { w, h, dots } = view.size;
  c.setTransform(dots, 0, 0, dots, 0, 0);
  c.clearRect(0, 0, w, h);
  ground(c, floor);
  if (scene) {
    const placed = floor.here().map((r) => [r, colour(scene.robots.indexOf(r))]);
    if (floor.trails) for (const [r, hue] of placed) trail(c, floor, r, hue);
    for (const sign of floor.layer()) layer(c, view, sign);
    for (const [r, hue] of placed) doubt(c, view, r, hue);
    for (const [r, hue] of placed) slot(c, view, r, hue);
    for (const [r, hue] of placed) leash(c, floor, r, hue);
    if (floor.about && placed.some(([r]) => r.id === floor.about.id)) way(c, view, floor.about);
    if (floor.sonar && floor.about) echoes(c, view, floor.robot(floor.about.id), floor.about);
    ghost(c, floor);
    for (const object of scene.objects) thing(c, view, object);
    const mark = floor.moving ?? scene.landmark;
    if (mark) triangle(c, ...view.toPixel(...mark));
    for (const [r, hue] of placed) body(c, view, r, hue, r.id === floor.chosen);
    if (floor.lifted) lifted(c, floor, colour);
    labels(c, view, placed.map(([r]) => r), mark);
  }
  scale(c, view);
  if (floor.canvas.matches(":focus-visible")) cross(c, view);
}

// The floor, a line for each metre or more of them, and the walls.
function ground(c, { map, floor, view }) {
  const [left, top] = view.toPixel(floor[0], floor[3]);
  const [right, bottom] = view.toPixel(floor[2], floor[1]);
  c.fillStyle = ink("--panel");
  c.fillRect(left, top, right - left, bottom - top);
  const step = STEPS.find((m) => m * view.at.scale >= LINES) ?? STEPS.at(-1);
  c.strokeStyle = ink("--grid");
  c.lineWidth = 1;
  c.beginPath();
  for (let n = Math.ceil(floor[0] / step); n * step <= floor[2]; n++) {
    const [x] = view.toPixel(n * step, 0);
    c.moveTo(x, top);
    c.lineTo(x, bottom);
  }
  for (let n = Math.ceil(floor[1] / step); n * step <= floor[3]; n++) {
    const [, y] = view.toPixel(0, n * step);
    c.moveTo(left, y);
    c.lineTo(right, y);
  }
  c.stroke();
  c.strokeStyle = ink(map.width ? "--wall" : "--line");
  c.strokeRect(left, top, right - left, bottom - top);
  c.fillStyle = ink("--wall");
  const cell = map.cell * view.at.scale;
  for (const [from, row, count] of map.walls)
    c.fillRect(left + from * cell, bottom - (row + 1) * cell, count * cell + 0.5, cell + 0.5);
}

// How long a metre is, in the corner.
function scale(c, { at, size }) {
  const step = STEPS.find((m) => m * at.scale >= BAR) ?? STEPS.at(-1);
  const [right, y, long] = [size.w - 14, size.h - 14, step * at.scale];
  c.strokeStyle = c.fillStyle = ink("--text");
  c.lineWidth = 1.5;
  c.beginPath();
  c.moveTo(right - long, y - 5);
  c.lineTo(right - long, y);
  c.lineTo(right, y);
  c.lineTo(right, y - 5);
  c.stroke();
  text(c, `${step} m`, right - long / 2, y - 5);
}

// Where the keyboard points: the middle of the view.
function cross(c, { size }) {
  const [x, y] = [size.w / 2, size.h / 2];
  c.strokeStyle = ink("--text");
  c.lineWidth = 1.5;
  c.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    c.moveTo(x + 4 * dx, y + 4 * dy);
    c.lineTo(x + 14 * dx, y + 14 * dy);
  }
  c.stroke();
}

function trail(c, { paths, view }, r, hue) {
  const path = paths.get(r.id);
  // After a new map the last scene is still that of the former one.
  if (!path || path.length < 2) return;
  c.beginPath();
  for (const [x, y, jumped] of path) c[jumped ? "moveTo" : "lineTo"](...view.toPixel(x, y));
  c.strokeStyle = hue;
  c.globalAlpha = 0.45;
  c.lineWidth = 1.5;
  c.stroke();
  c.globalAlpha = 1;
}

// What the mission draws: lines, points with their labels, and cells.
function layer(c, view, { kind, points, size }) {
  if (kind === "cells") return cells(c, view, points, size);
  const places = points.map(([x, y]) => view.toPixel(x, y));
  c.lineWidth = 1.5;
  if (kind === "polyline") return dashed(c, ink("--dim"), () => places.forEach((place) => c.lineTo(...place)));
  c.strokeStyle = ink("--dim");
  for (const [x, y] of places) {
    c.beginPath();
    c.arc(x, y, 5, 0, 7);
    c.stroke();
  }
  // A label for which there is no room is left out.
  const taken = [];
  for (const [k, [x, y]] of places.entries()) {
    const at = room(c, taken, points[k][2], x, [y + 19, y - 10, y + 33, y - 24]);
    if (at !== undefined) text(c, points[k][2], x, at);
  }
}

// The first of these heights at which there are no other words yet; it is taken then.
function room(c, taken, words, x, heights) {
  c.font = FONT;
  const half = c.measureText(words).width / 2 + 3;
  const at = heights.find((y) => !taken.some((t) => Math.abs(t.x - x) < t.half + half && Math.abs(t.at - y) < 13));
  if (at !== undefined) taken.push({ x, at, half });
  return at;
}

function cells(c, view, places, size) {
  c.fillStyle = ink("--accent");
  c.globalAlpha = 0.1;
  for (const [x, y] of places) {
    const [left, top] = view.toPixel(x - size / 2, y + size / 2);
    c.fillRect(left, top, size * view.at.scale, size * view.at.scale);
  }
  c.globalAlpha = 1;
}

// Where it is in 95 of 100 cases, by its own estimate.
export function doubt(c, view, r, hue) {
  if (!r.unsure || !r.alive) return;
  const [x, y] = view.toPixel(r.x, r.y);
  const radius = Math.min(r.unsure, DOUBT) * view.at.scale;
  c.strokeStyle = hue;
  c.lineWidth = 1;
  if (r.unsure > DOUBT) c.setLineDash([2, 4]);
  c.beginPath();
  c.arc(x, y, radius, 0, 7);
  c.stroke();
  c.setLineDash([]);
  if (r.unsure > DOUBT) text(c, `±${r.unsure.toFixed(1)} m`, x, y + radius + 12);
}

export function slot(c, view, r, hue) {
  if (!r.slot || !r.alive) return;
  const [x, y] = view.toPixel(...r.slot);
  c.lineWidth = 1;
  dashed(c, hue, () => {
    c.arc(x, y, r.r * view.at.scale, 0, 7);
    c.moveTo(...view.toPixel(r.x, r.y));
    c.lineTo(x, y);
  });
}

// From a follower to its leader, where its place is not known.
function leash(c, floor, r, hue) {
  const leader = r.follows && floor.robot(r.follows);
  if (!r.alive || !leader?.alive || !floor.here().includes(leader)) return;
  c.lineWidth = 1;
  dashed(c, hue, () => {
    c.moveTo(...floor.toPixel(r.x, r.y));
    c.lineTo(...floor.toPixel(leader.x, leader.y));
  });
}

// The way that the chosen robot takes now, from where it believes to be; its goal is the last of it.
export function way(c, view, { pose, way: corners }) {
  if (!pose || corners.length === 0) return;
  c.strokeStyle = c.fillStyle = ink("--accent");
  c.lineWidth = 2;
  c.beginPath();
  for (const place of [pose, ...corners]) c.lineTo(...view.toPixel(...place));
  c.stroke();
  for (const place of corners.slice(0, -1)) {
    c.beginPath();
    c.arc(...view.toPixel(...place), 3, 0, 7);
    c.fill();
  }
  goal(c, ...view.toPixel(...corners.at(-1)));
}

function goal(c, x, y) {
  c.beginPath();
  c.arc(x, y, 7, 0, 7);
  c.moveTo(x - 11, y);
  c.lineTo(x + 11, y);
  c.moveTo(x, y - 11);
  c.lineTo(x, y + 11);
  c.stroke();
}

// Where a robot was sent, or is about to be, before it says which way it takes.
function ghost(c, floor) {
  const r = floor.ghost && floor.robot(floor.ghost.id);
  if (!r || r.x === null) return;
  const [x, y] = floor.toPixel(floor.ghost.x, floor.ghost.y);
  c.lineWidth = 2;
  dashed(c, ink("--accent"), () => {
    c.moveTo(...floor.toPixel(r.x, r.y));
    c.lineTo(x, y);
    c.moveTo(x + r.r * floor.view.at.scale, y);
    c.arc(x, y, r.r * floor.view.at.scale, 0, 7);
  });
  c.strokeStyle = ink("--accent");
  goal(c, x, y);
}

// What the chosen robot hears: the nearest thing of each sonar, or beam of its lidar, is somewhere on an arc.
export function echoes(c, view, r, { sonar, cone }) {
  if (!r?.alive || r.x === null) return;
  const [cos, sin] = [Math.cos(r.a), Math.sin(r.a)];
  c.strokeStyle = ink("--accent");
  for (const [dx, dy, heading, range] of sonar) {
    const [x, y] = view.toPixel(r.x + dx * cos - dy * sin, r.y + dx * sin + dy * cos);
    const angle = -(r.a + heading);
    c.globalAlpha = 0.18;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(x, y);
    c.lineTo(x + range * view.at.scale * Math.cos(angle), y + range * view.at.scale * Math.sin(angle));
    c.stroke();
    c.globalAlpha = 0.9;
    c.lineWidth = 2.5;
    c.beginPath();
    c.arc(x, y, range * view.at.scale, angle - cone, angle + cone);
    c.stroke();
  }
  c.globalAlpha = 1;
}

const RINGS = { stop: "--stop", bad: "--bad", warn: "--warn" };

export function body(c, view, r, hue, chosen) {
  const [x, y] = view.toPixel(r.x, r.y);
  const radius = Math.max(4, r.r * view.at.scale);
  const [badge] = r.badges;
  c.globalAlpha = r.alive ? 1 : 0.4;
  c.fillStyle = r.alive ? hue : ink("--dim");
  c.beginPath();
  outline(c, r, x, y, radius);
  c.fill();
  c.strokeStyle = ink("--text");
  c.lineWidth = r.leader ? 3 : 1;
  c.stroke();
  c.lineWidth = 2;
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x + radius * Math.cos(r.a), y - radius * Math.sin(r.a));
  c.strokeStyle = "#fff";
  c.stroke();
  c.globalAlpha = 1;
  if (badge?.kind === "off") crossed(c, x, y, radius);
  else if (badge) ring(c, x, y, radius + 3, ink(RINGS[badge.kind]), badge.kind === "stop" ? [] : [4, 3]);
  if (badge?.kind === "stop") block(c, x, y, Math.min(radius, 9));
  if (chosen) ring(c, x, y, radius + 7, ink("--accent"), []);
}

function ring(c, x, y, radius, hue, dashes) {
  c.strokeStyle = hue;
  c.lineWidth = 2.5;
  c.setLineDash(dashes);
  c.beginPath();
  c.arc(x, y, radius, 0, 7);
  c.stroke();
  c.setLineDash([]);
}

// A robot that the emergency stop holds: a square, as on the buttons of all players.
function block(c, x, y, half) {
  c.fillStyle = ink("--stop");
  c.strokeStyle = "#fff";
  c.lineWidth = 1.5;
  c.beginPath();
  c.rect(x - half * 0.7, y - half * 0.7, half * 1.4, half * 1.4);
  c.fill();
  c.stroke();
}

function crossed(c, x, y, radius) {
  c.strokeStyle = ink("--text");
  c.lineWidth = 2;
  c.beginPath();
  for (const side of [-1, 1]) {
    c.moveTo(x - radius, y - side * radius);
    c.lineTo(x + radius, y + side * radius);
  }
  c.stroke();
}

// A disc, or a box whose corners are in the robot's own frame.
function outline(c, r, x, y, radius) {
  if (!r.box.length) return c.arc(x, y, radius, 0, 7);
  const [scale, cos, sin] = [radius / r.r, Math.cos(r.a), Math.sin(r.a)];
  for (const [ahead, left] of r.box) c.lineTo(x + scale * (ahead * cos - left * sin), y - scale * (ahead * sin + left * cos));
  c.closePath();
}

// A ball, or a box, to scale.
export function thing(c, view, { at, r, box }) {
  c.fillStyle = box.length ? "#1e50e6" : "#e4781e";
  c.strokeStyle = ink("--text");
  c.lineWidth = 1;
  c.beginPath();
  if (box.length) for (const corner of box) c.lineTo(...view.toPixel(...corner));
  else c.arc(...view.toPixel(...at), Math.max(r * view.at.scale, 4), 0, 7);
  c.closePath();
  c.fill();
  c.stroke();
}

// What is dragged, over the place where it would be put.
function lifted(c, { scene, lifted: { id, at }, view }, colour) {
  const r = scene.robots.find((robot) => robot.id === id);
  c.globalAlpha = 0.6;
  if (r) {
    const [x, y] = view.toPixel(...at);
    c.fillStyle = colour(scene.robots.indexOf(r));
    c.beginPath();
    outline(c, r, x, y, Math.max(4, r.r * view.at.scale));
    c.fill();
  } else {
    const object = scene.objects.find((o) => o.id === id);
    const moved = ([x, y]) => [x + at[0] - object.at[0], y + at[1] - object.at[1]];
    if (object) thing(c, view, { at, r: object.r, box: object.box.map(moved) });
  }
  c.globalAlpha = 1;
}

// Names above the robots, and below the landmark; on the other side where there is a name already.
function labels(c, view, robots, mark) {
  const taken = [];
  const place = (words, [x, y], above, below) => text(c, words, x, room(c, taken, words, x, [y + above, y + below]) ?? y + below);
  if (mark) place("landmark", view.toPixel(...mark), 22, -16);
  for (const r of robots) {
    const words = [r.id + (r.leader ? " ★" : ""), r.badges[0]?.word].filter(Boolean).join(" · ");
    const out = Math.max(4, r.r * view.at.scale) + 9;
    c.globalAlpha = r.alive ? 1 : 0.6;
    place(words, view.toPixel(r.x, r.y), -out, out + 9);
  }
  c.globalAlpha = 1;
}

export function triangle(c, x, y) {
  c.fillStyle = "#f0e442";
  c.strokeStyle = ink("--text");
  c.lineWidth = 1.5;
  c.beginPath();
  for (const [dx, dy] of [[0, -10], [9, 7], [-9, 7]]) c.lineTo(x + dx, y + dy);
  c.closePath();
  c.fill();
  c.stroke();
}
