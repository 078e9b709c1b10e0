// What happened to the fleet, as a grid: repeats in one row with their count, and with what ended them.
import { by, made } from "./dom.js";

const KEPT = 500; // rows
const NEAR = 12; // rows back in which the same again is a repeat

// Adds an event to rows, the last the newest; returns the rows. An event is {time, what, text, robot, ends}: `ends` is what it
// ends of the same robot. Pure.
export function fold(rows, event) {
  const near = rows.slice(-NEAR);
  const begun = event.ends && near.findLast((row) => row.what === event.ends && row.robot === event.robot && !row.ended);
  if (begun) return rows.map((row) => (row === begun ? { ...row, ended: { time: event.time, text: event.text } } : row));
  const same = near.findLast((row) => row.what === event.what && row.robot === event.robot && row.text === event.text);
  if (!same) return [...rows, { ...event, count: 1, last: event.time, ended: null }].slice(-KEPT);
  const again = { ...same, count: same.count + 1, last: event.time, at_s: event.at_s, ended: null };
  return [...rows.filter((row) => row !== same), again];
}

export class Events {
  constructor(choose) {
    this.choose = choose; // (robot, at_s)
    this.clear();
  }

  clear() {
    this.rows = [];
    this.told = 0;
    by("stages").replaceChildren();
  }

  show(scene) {
    // A recording was turned back.
    if (scene.told < this.told) this.clear();
    const fresh = Math.max(0, Math.min(scene.told - this.told, scene.stages.length));
    this.told = scene.told;
    if (fresh === 0) return;
    for (const event of scene.stages.slice(-fresh)) this.rows = fold(this.rows, event);
    const panel = by("panel-events");
    const down = panel.scrollHeight - panel.scrollTop - panel.clientHeight < 30;
    by("stages").replaceChildren(...this.rows.map((row) => this.row(row)));
    if (down) panel.scrollTop = panel.scrollHeight;
  }

  row(event) {
    const tr = made("tr");
    const time = made("td", event.count > 1 ? `${event.time} – ${event.last}` : event.time);
    const text = made("td");
    if (event.robot || event.at_s !== null) {
      const label = event.robot ? `Choose ${event.robot}: ${event.text}` : event.text;
      text.append(made("button", event.text, { type: "button", title: label, onclick: () => this.choose(event.robot, event.at_s) }));
    } else text.append(event.text);
    if (event.count > 1) text.append(made("span", `${event.count} times`, { className: "count" }));
    if (event.ended) text.append(made("span", `until ${event.ended.time}: ${event.ended.text}`, { className: "count" }));
    tr.append(time, made("td", event.what), text);
    return tr;
  }
}

// The orders that were given on this page, each with its answer.
const ORDERS = 200;

export class Given {
  constructor() {
    this.open = [];
  }

  order(line) {
    const tr = made("tr");
    const answer = made("td", "…");
    tr.append(made("td", new Date().toLocaleTimeString()), made("td", line), answer);
    by("given").append(tr);
    while (by("given").childElementCount > ORDERS) by("given").firstChild.remove();
    this.open.push({ line, answer });
  }

  answer(line, text, ok) {
    const at = this.open.findIndex((order) => line === order.line || line.startsWith(`${order.line} (`));
    if (at < 0) return;
    const [{ answer }] = this.open.splice(at, 1);
    answer.textContent = text;
    answer.className = ok ? "" : "bad";
  }
}
