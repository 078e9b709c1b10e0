// The legend of the map.
import { DOUBT, body, doubt, echoes, slot, thing, triangle, way } from "./drawing.js";

// What the signs of the map mean: each is drawn on a small canvas as on the map.
const SIGNS = [
  ["leader", (c, r) => body(c, r.view, { ...r, leader: true }, r.hue, false)],
  ["chosen", (c, r) => body(c, r.view, { ...r, r: 0.15 }, r.hue, true)],
  ["held by the emergency stop", (c, r) => body(c, r.view, { ...r, badges: [{ kind: "stop" }] }, r.hue, false)],
  ["cannot do its work: the list says why", (c, r) => body(c, r.view, { ...r, badges: [{ kind: "bad" }] }, r.hue, false)],
  ["dead, or not heard", (c, r) => body(c, r.view, { ...r, alive: false, badges: [{ kind: "off" }] }, r.hue, false)],
  ["its place in the formation", (c, r) => slot(c, r.view, { ...r, x: 0.4, slot: [-0.2, 0] }, r.hue)],
  [`where it is, by its own estimate (over ${DOUBT} m as a number)`, (c, r) => doubt(c, r.view, { ...r, unsure: 0.35 }, r.hue)],
  ["goal and way", (c, r) => way(c, r.view, { pose: [-0.5, 0], way: [[0.2, 0]] })],
  ["what a sonar hears", (c, r) => echoes(c, r.view, { ...r, x: -0.4 }, { sonar: [[0, 0, 0, 0.6]], cone: 0.4 })],
  ["landmark", (c) => triangle(c, 18, 13)],
  ["ball", (c, r) => thing(c, r.view, { at: [0, 0], r: 0.2, box: [] })],
  ["box", (c, r) => thing(c, r.view, { box: [[-0.5, -0.2], [0.5, -0.2], [0.5, 0.2], [-0.5, 0.2]] })],
];

// Fills a list; again where the browser's look has changed.
export function legend(list) {
  const view = { at: { scale: 26 }, size: { w: 36, h: 26 }, toPixel: (x, y) => [18 + 26 * x, 13 - 26 * y] };
  const robot = { view, hue: "#56b4e9", x: 0, y: 0, a: 0, r: 0.28, box: [], alive: true, badges: [], leader: false };
  list.replaceChildren(...SIGNS.map(([meaning, draw]) => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 72, height: 52, ariaHidden: "true" });
    const c = canvas.getContext("2d");
    c.scale(2, 2);
    draw(c, robot);
    const line = document.createElement("li");
    line.append(canvas, meaning);
    return line;
  }));
}
