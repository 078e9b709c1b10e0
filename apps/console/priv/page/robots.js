// The table of robots, and what keeps each from its work.
import { by, made, metres, words, write } from "./dom.js";
import { colour } from "./map.js";

// A row for each robot, made once, so that it keeps the focus. Tab comes to one of them, the arrows go through them.
export class Robots {
  constructor(choose) {
    this.choose = choose;
    this.rows = new Map();
    by("robots").onkeydown = (e) => this.key(e);
  }

  clear() {
    this.rows.clear();
    by("robots").replaceChildren();
  }

  show(scene, chosen, frame) {
    scene.robots.forEach((robot, index) => this.row(robot, index, scene, chosen, frame));
    const at = this.rows.get(chosen) ?? [...this.rows.values()].find((row) => row.button.tabIndex === 0) ?? this.rows.values().next().value;
    for (const row of this.rows.values()) row.button.tabIndex = row === at ? 0 : -1;
  }

  row(robot, index, scene, chosen, frame) {
    const { tr, button, cells } = this.rows.get(robot.id) ?? this.made(robot, index);
    const [, state, off, unsure] = cells;
    off.hidden = by("off").hidden;
    badges(state, robot);
    write(off, robot.alive ? metres(robot.off) : "");
    write(unsure, robot.alive && robot.unsure !== null ? `±${metres(robot.unsure)}` : "");
    tr.className = [!robot.alive && "dead", robot.state === "E-STOP" && "held", robot.frame !== frame && "apart", robot.id === chosen && "chosen"]
      .filter(Boolean).join(" ");
    button.ariaPressed = robot.id === chosen;
  }

  made({ id }, index) {
    const tr = made("tr");
    tr.dataset.id = id;
    const mark = made("span", "", { className: "mark", ariaHidden: "true" });
    mark.style.background = colour(index);
    const button = made("button", id, { type: "button" });
    const cells = [0, 1, 2, 3].map(() => made("td"));
    cells[0].append(mark, button);
    tr.append(...cells);
    tr.onclick = () => this.choose(id);
    by("robots").append(tr);
    const row = { tr, button, cells };
    this.rows.set(id, row);
    return row;
  }

  key(e) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[e.key];
    const row = e.target.closest("tr");
    const next = step && (step > 0 ? row.nextElementSibling : row.previousElementSibling);
    if (step) e.preventDefault();
    if (!next) return;
    e.target.tabIndex = -1;
    next.querySelector("button").tabIndex = 0;
    next.querySelector("button").focus();
  }
}

// What it does in a word, and before it what is wrong.
function badges(cell, robot) {
  const told = robot.badges.map((b) => b.word).join() + robot.state + robot.leader;
  if (cell.dataset.told === told) return;
  cell.dataset.told = told;
  const shown = robot.badges.map(({ kind, word, why }) => made("span", word, { className: `badge ${kind}`, title: why ?? "" }));
  const state = robot.badges.some((b) => b.instead) ? "" : words(robot.state);
  cell.replaceChildren(...shown.flatMap((badge) => [badge, " "]), state + (robot.alive && robot.leader ? " ★" : ""));
}

// Who leads, and who follows: of a divided fleet each part has a leader.
const NAMED = 8;

export function leads(scene) {
  const text = scene.robots.filter((r) => r.alive && r.leader).map(({ id }) => {
    const others = scene.robots.filter((r) => r.alive && (r.follows === id || (r.slot && id === scene.leader))).map((r) => r.id);
    const epoch = id === scene.leader && scene.epoch !== null ? ` epoch ${scene.epoch}` : "";
    const named = others.length > NAMED ? `${others.length} robots` : others.join(", ");
    return `${id} leads${epoch}; ${others.length === 0 ? "no robot follows" : `${named} follow`}.`;
  }).join(" ") || "No robot leads.";
  write(by("leads"), text);
}

// Which are not on the map, because their places are not known to those that are.
export function apart(scene, frame) {
  const others = scene.robots.filter((r) => r.x !== null && r.frame !== frame).map((r) => r.id);
  by("apart").hidden = others.length === 0;
  write(by("apart"), `Not on this map, because their places on it are not known: ${others.join(", ")}. Choose one to see its own.`);
}
