// The inspector: what is known of the chosen robot, what it sees, and what can be done with it.
import { all, by, made, words, write } from "./dom.js";
import { bar } from "./controls.js";

let opened = () => {};

// Tabs as in W3C's patterns: one of them is in the order of Tab, the arrows go through them. `tell` is called with one that opens.
export function tabs(tell) {
  opened = tell;
  const tabs = all("[role=tab]");
  for (const tab of tabs) {
    tab.onclick = () => open(tab.id);
    tab.onkeydown = (e) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
      if (!step) return;
      const next = tabs[(tabs.indexOf(tab) + step + tabs.length) % tabs.length];
      open(next.id);
      next.focus();
    };
  }
}

export function open(id) {
  for (const tab of all("[role=tab]")) {
    const on = tab.id === id;
    tab.ariaSelected = on;
    tab.tabIndex = on ? 0 : -1;
    const panel = by(tab.getAttribute("aria-controls"));
    panel.hidden = !on;
    if (on && panel.querySelector("table")) panel.scrollTop = panel.scrollHeight;
  }
  opened(id);
}

// Of one that is newly chosen, or has gone, nothing is known that is of now.
export function nothing(floor) {
  floor.about = null;
  by("about").replaceChildren();
  by("reasons").hidden = true;
  by("camera").hidden = by("sonar").hidden = true;
}

export function one(scene, chosen, floor) {
  const robot = scene.robots.find((r) => r.id === chosen);
  by("one").hidden = !robot;
  by("none").hidden = !!robot;
  if (!robot) return;
  write(by("chosen"), robot.id);
  by("acts").className = robot.alive ? "" : robot.state === "not_heard" ? "away" : "gone-robot";
  if (!robot.alive) nothing(floor);
  const where = robot.x === null ? "pose unknown"
    : `at ${robot.x.toFixed(2)}, ${robot.y.toFixed(2)}, ${Math.round((robot.a * 180) / Math.PI)}°`;
  const gone = robot.state === "not_heard" ? "not heard" : "dead";
  write(by("doing"), (robot.alive ? `${words(robot.state)}, ${where}` : `${gone}, last ${where}`)
    + (robot.apart === null ? "" : `, in a frame of its own: ${robot.apart}`));
  const told = robot.badges.map(({ kind, word, why }) => {
    const line = made("li");
    line.append(made("span", word, { className: `badge ${kind}` }), why ? ` ${why}` : "");
    return line;
  });
  if (by("badges").textContent !== told.map((line) => line.textContent).join("")) by("badges").replaceChildren(...told);
  acts(robot);
}

// What cannot be done with it now, and why. A stop is never among it.
function acts(robot) {
  const has = (word) => robot.badges.some((b) => b.word === word);
  for (const name of ["start", "drive"]) bar(act(name), robot.bars && `${robot.id} cannot move: ${robot.bars}`);
  const armed = !has("disarmed") && !has("line lost");
  bar(act("arm"), has("line lost") ? "acknowledge first that its line was lost" : armed && `the wheels of ${robot.id} may turn already`);
  act("acknowledge").hidden = !has("line lost");
}

const act = (name) => document.querySelector(`[data-one=${name}]`) ?? by(name);

// Lines of a list, which is left alone while they are the same.
function list(id, lines) {
  const list = by(id);
  if (list.childElementCount === lines.length && list.lastChild?.textContent === lines.at(-1)) return;
  list.replaceChildren(...lines.map((line) => made("li", line)));
  list.scrollTop = list.scrollHeight;
}

const length = (way) => way.slice(1).reduce((sum, [x, y], k) => sum + Math.hypot(x - way[k][0], y - way[k][1]), 0);

// Without the minus of -0.00.
const decimals = (number) => (Math.round(number * 100) / 100 + 0).toFixed(2);

// Why it does what it does: who wished, the chosen one first, what limits it, its way, its devices, and what it did.
export function about(told) {
  const rows = [
    ["does", told.by && words(told.by)],
    ["wishes", told.wishes.map(([by, weight]) => `${words(by)} ${weight.toFixed(2)}`).join(", ")],
    ["way", told.way.length > 0 && `${length([told.pose, ...told.way]).toFixed(1)} m, by ${told.way.length} ${told.way.length === 1 ? "place" : "places"}`],
    ["speed", told.speed === null ? !told.why && "unknown" : `${decimals(told.speed)} m/s` + (told.turn === null ? "" : `, ${decimals(told.turn)} rad/s`)],
    ["camera", [told.looks, told.sees].filter(Boolean).join(", ")],
    ["pictures", told.pictures],
    ["limited by", told.limits.map(words).join(", ")],
    ["fault", told.fault],
    ["note", told.notes.join("; ")],
    ["stopped", told.estop && "emergency stop, until it is reset"],
    ["offline", told.offline.join(", ")],
    ["battery", told.power !== null && `${told.power.toFixed(1)} V`],
  ].filter(([, text]) => text);
  by("about").replaceChildren(...rows.flatMap(([term, text]) => [made("dt", term), made("dd", text)]));
  // A recording says all that led to what it did.
  by("reasons").hidden = !told.why;
  if (told.why) write(by("reasons"), told.why.join("\n"));
  list("events", told.events);
  by("camera").hidden = !told.camera && !told.pictures;
  by("camera").disabled = !told.camera;
  by("camera").title = told.pictures ? `pictures ${told.pictures}` : "";
  by("sonar").hidden = told.sonar.length === 0;
}

// At most five pictures a second, and only while somebody looks; each is asked for when the one before is there. One that does
// not come ends it: what is shown would be old.
const LOOK_MS = 200;
const PICTURE_MS = 3000;

export class Camera {
  constructor(floor, failed) {
    this.floor = floor;
    this.failed = failed; // (line)
    this.on = false;
    this.looks = 0;
  }

  show(id) {
    if (this.on === (id !== null)) return;
    this.on = id !== null;
    by("camera").ariaPressed = this.on;
    by("picture").hidden = !this.on;
    if (this.on) this.look(id);
  }

  async look(id) {
    const look = ++this.looks;
    const on = () => this.on && look === this.looks;
    while (on()) {
      const begun = performance.now();
      try {
        const answer = await fetch(`camera/${id}`, { signal: AbortSignal.timeout(PICTURE_MS) });
        if (!answer.ok) throw new Error(await answer.text());
        const bitmap = await createImageBitmap(await answer.blob());
        if (on()) paint(bitmap, this.floor.about?.seen);
      } catch (error) {
        if (!on()) return;
        this.failed(error.name === "TimeoutError" ? `no picture of ${id} for ${PICTURE_MS / 1000} s` : String(error.message));
        return this.show(null);
      }
      await new Promise((go) => setTimeout(go, Math.max(0, LOOK_MS - (performance.now() - begun))));
    }
  }
}

function paint(bitmap, seen) {
  const canvas = by("picture");
  const c = canvas.getContext("2d");
  [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
  c.drawImage(bitmap, 0, 0);
  if (!seen) return;
  const [sx, sy] = [bitmap.width / seen.width, bitmap.height / seen.height];
  c.lineWidth = 2;
  c.strokeStyle = c.fillStyle = "#d55e00";
  c.font = "11px system-ui, sans-serif";
  for (const [name, left, top, right, bottom] of seen.boxes) {
    c.strokeRect(left * sx, top * sy, (right - left + 1) * sx, (bottom - top + 1) * sy);
    c.fillText(name, left * sx, Math.max(10, top * sy - 3));
  }
}
