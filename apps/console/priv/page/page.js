// The page: a WebSocket to the fleet, and what is typed, clicked and driven. Text from the fleet is only ever set as text.
import { FloorView } from "./map.js";
import { HeldKeys, modified } from "./keys.js";
import { all, by, write } from "./dom.js";
import { answerable, controls, enable, follows, ordered, press, reasons, unask } from "./controls.js";
import { Events, Given } from "./events.js";
import { Camera, about, nothing, one, open, tabs } from "./inspector.js";
import { legend } from "./legend.js";
import { Messages } from "./messages.js";
import { Nodes } from "./nodes.js";
import { Robots, apart, leads } from "./robots.js";
import { Timeline } from "./timeline.js";

const DRIVE_MS = 100; // how often the keyboard says a word; the server stops after 300 ms without one
const PRESENT_MS = 250; // how often a person who sees the page is told of
const OLD_MS = 2000; // a scene comes ten times a second
const GOOD_MS = 8000; // how long an answer of one line stays over the map; a refusal stays until it is closed
const SENT_MS = 3000; // how long a robot that was sent may say nothing of its way
// A stop is sent at any time; all else only while the fleet is heard.
const STOP = /^\s*(e+[\s-]?stop|stop|halt|emergenc|disarm)/i;
let heard = 0, ahead = -Infinity, socket, chosen, scene, tries = 0, driving = false, timer, opened = false, focused = null, closing;
const held = new HeldKeys();

// Reachable for tests and the curious.
const floor = window.floor = new FloorView(by("map"), {
  choose,
  send,
  landmark: (x, y) => say(`landmark ${x.toFixed(2)},${y.toFixed(2)}`),
  place: (id, x, y) => say(`place ${id} ${x.toFixed(2)},${y.toFixed(2)}`),
  point: (place) => {
    by("coords").hidden = !place;
    if (place) write(by("coords"), `x ${place[0].toFixed(2)}  y ${place[1].toFixed(2)} m`);
  },
});
// The run beside this one, if a recording is compared with another.
const other = new FloorView(by("beside"), { choose, send: () => {}, landmark: () => {}, place: () => {}, point: () => {} });
const timeline = window.timeline = new Timeline({
  show,
  say,
  past: (on) => document.body.classList.toggle("past", on),
  names: (names) => all(".run").forEach((caption, k) => write(caption, names[k] ?? "")),
});
const robots = new Robots(choose);
const events = new Events((id, at_s) => {
  if (id && id !== chosen) choose(id);
  if (at_s !== null) timeline.seek(at_s);
});
const given = new Given();
const watch = (what) => (on) => socket?.readyState === WebSocket.OPEN && say(`${what} ${on ? "on" : "off"}`);
const messages = new Messages(watch("messages"));
const nodes = new Nodes(watch("nodes"), say);
const camera = new Camera(floor, (line) => answer({ ok: false, text: line }));

// Beside this page, wherever a proxy puts it; with its token, if its address has one.
const live = new URL(`live${location.search}`, location.href);
live.protocol = location.protocol === "https:" ? "wss:" : "ws:";

function connect() {
  socket = new WebSocket(live);
  socket.onopen = () => {
    tries = 0;
    opened = true;
    ahead = -Infinity;
    connected(true);
    if (chosen) say(`look ${chosen}`);
    messages.again();
    nodes.again();
  };
  socket.onmessage = ({ data }) => hear(JSON.parse(data));
  socket.onclose = () => {
    lost();
    if (!opened) by("fleet").textContent = `No connection to the fleet. If this page is behind a proxy, start the program with --page-origin ${location.origin}`;
    setTimeout(connect, Math.min(5000, 250 * 2 ** tries++));
  };
}

function lost() {
  const fleet = by("fleet");
  write(fleet, "No connection to the fleet. What you see is old, and the buttons reach nothing.");
  fleet.className = "lost";
  drive(false);
  connected(false);
}

// What cannot work looks so. While nothing comes, but the connection stands, orders look so, too, and say why when they are
// clicked; a stop is tried at any time.
function connected(on) {
  const open = socket.readyState === WebSocket.OPEN;
  document.body.classList.toggle("silent", open && !on);
  if (!open) focused ??= document.activeElement;
  enable(open);
  if (!open) return;
  if (focused && document.activeElement === document.body) focused.focus();
  focused = null;
}

const silent = () => performance.now() - heard > OLD_MS || ahead === -Infinity;
const refuse = (text) => answer({ ok: false, text });

// With the time when it was given, by the server's clock. An order that cannot arrive in time is not sent at all.
function say(line) {
  if (socket?.readyState !== WebSocket.OPEN) return refuse(`not sent, because there is no connection: ${line}`);
  const stop = STOP.test(line);
  if (silent() && !stop && !/^(look|messages|nodes (on|off))\b/.test(line)) return refuse(`not sent, because the fleet is not heard: ${line}`);
  if (!/^(look|drive|messages|nodes (on|off))\b/.test(line) && !timeline.recorded) given.order(line);
  if (!silent()) return socket.send(`@${Math.round(performance.now() + ahead)} ${line}`);
  socket.send(line);
  if (stop) refuse("sent, but the fleet is not heard: look whether it stands, and press the robots' own buttons if it does not");
}

// How far the server's clock is ahead of this one's: what the fastest scene said, given up slowly in case a clock drifts.
// A scene that took long would make an order seem older than it is, never younger.
function tick(now) {
  heard = performance.now();
  ahead = Math.max(now - heard, ahead - 0.1);
}

function hear(message) {
  if (message.t === "map") {
    events.clear();
    robots.clear();
    for (const e of all("[data-offer]")) e.hidden = !message.offers.includes(e.dataset.offer);
    by("off").hidden = !message.width;
    const same = by("mission").options[0];
    messages.writable(message.hears);
    by("mission").replaceChildren(same, ...message.missions.map((name) => new Option(name)));
    const replay = message.offers.includes("replay");
    document.body.classList.toggle("replay", replay);
    by("floor").classList.toggle("two", message.beside !== null);
    timeline.clear(replay);
    floor.setMap(message);
    if (message.beside) other.setMap({ ...message, ...message.beside });
  } else if (message.t === "scene") {
    tick(message.now);
    connected(true);
    show(timeline.note(message));
  } else if (message.t === "history") timeline.history(message);
  else if (message.t === "about") told(message);
  else if (message.t === "messages") messages.hear(message);
  else if (message.t === "nodes") nodes.hear(message);
  else if (message.t === "answer") answer(message);
}

// Over the map, and with its order in the list of those.
function answer({ ok, text, line }) {
  // The strip of time shows it.
  if (ok && timeline.recorded && !text.includes("\n")) return;
  const output = by("answer");
  output.textContent = text;
  output.className = ok ? "good" : "bad";
  if (line) given.answer(line, text, ok);
  if (line?.startsWith("send ")) messages.answered(text, ok);
  if (!ok) floor.ghost = null;
  by("toast").classList.remove("gone");
  clearTimeout(closing);
  if (ok && !text.includes("\n")) closing = setTimeout(close, GOOD_MS);
}

const close = () => by("toast").classList.add("gone");

// What is shown is old also where the connection stands and nothing comes.
setInterval(() => silent() && lost(), 500);

// Robots that move only in the presence of a person hear of one while the page is seen.
setInterval(() => {
  if (socket?.readyState === WebSocket.OPEN && !silent() && document.visibilityState === "visible")
    socket.send(`@${Math.round(performance.now() + ahead)} present`);
}, PRESENT_MS);

// Every scene is displayed by this function.
function show(next) {
  scene = next;
  floor.setScene(scene);
  if (scene.beside) other.setScene(scene.beside);
  const fleet = by("fleet");
  const real = floor.map.offers.includes("arm");
  const parts = [
    timeline.past !== null && "looking back",
    !real && `${scene.at_s.toFixed(1)} s`,
    scene.pace,
    real && scene.mission,
    scene.formation && `${scene.formation[0]} ${scene.formation[1].toFixed(1)} m`,
    real && `${scene.robots.filter((r) => r.alive).length} robots heard`,
    scene.leader ? `${scene.leader} leads` : "no leader",
    scene.error && `${scene.formed ? "formed" : "position error"} ${scene.error.map((e) => e.toFixed(2)).join("/")} m`,
  ];
  write(fleet, scene.notice ?? parts.filter(Boolean).join(" · "));
  fleet.className = scene.notice ? "lost" : "";
  // Who looks back is told of a stop, and gives orders, now.
  const now = timeline.newest ?? scene;
  by("stop").hidden = now.estop === null;
  if (now.estop !== null) write(by("held"), now.estop);
  controls(now);
  robots.show(scene, chosen, floor.frame);
  leads(scene);
  apart(scene, floor.frame);
  one(scene, chosen, floor);
  events.show(scene);
  messages.show(scene, chosen ?? null);
}

function choose(id) {
  drive(false);
  camera.show(null);
  unask();
  chosen = chosen === id ? null : id;
  floor.chosen = other.chosen = chosen;
  floor.ghost = null;
  nothing(floor);
  by("events").replaceChildren();
  open("tab-robot");
  say(`look ${chosen ?? ""}`);
  if (scene) show(scene);
}

// Where the robot is real a click shows where it would go, and a second one sends it.
function send(x, y) {
  const robot = scene?.robots.find((r) => r.id === chosen);
  if (timeline.recorded) return refuse("this is a recording: nothing in it can be sent anywhere");
  if (timeline.past !== null) return refuse("this is the past: press Now first");
  if (!robot) return refuse("choose a robot first");
  if (robot.bars) return refuse(`${chosen} cannot move: ${robot.bars}`);
  const go = () => {
    floor.ghost = { id: chosen, x, y };
    setTimeout((ghost) => floor.ghost === ghost && ((floor.ghost = null), floor.draw()), SENT_MS, floor.ghost);
    say(`goto ${chosen} ${x.toFixed(2)},${y.toFixed(2)}`);
    floor.draw();
  };
  if (!floor.map.offers.includes("arm")) return go();
  unask();
  floor.ghost = { id: chosen, x, y };
  floor.draw();
  const box = by("confirm");
  const [px, py] = floor.toPixel(x, y);
  box.hidden = false;
  answerable(box, `Send ${chosen} to ${x.toFixed(2)}, ${y.toFixed(2)}?`, "Send it", go, () => {
    box.hidden = true;
    floor.ghost = null;
    floor.draw();
    by("map").focus();
  });
  box.style.left = `${Math.max(8, Math.min(px + 16, floor.canvas.clientWidth - box.offsetWidth - 8))}px`;
  box.style.top = `${Math.max(8, Math.min(py + 16, floor.canvas.clientHeight - box.offsetHeight - 8))}px`;
  box.querySelector("button").focus();
}

function told(message) {
  if (message.id !== chosen || !scene?.robots.find((r) => r.id === chosen)?.alive) return;
  if (timeline.past !== null) return;
  floor.about = message;
  // It says itself where it goes.
  const goal = message.way.at(-1);
  if (floor.ghost && by("confirm").hidden && goal && Math.hypot(goal[0] - floor.ghost.x, goal[1] - floor.ghost.y) < 1) floor.ghost = null;
  about(message);
  floor.draw();
}

// Driving: a word every 100 ms while the mode is on and keys are held.
function drive(on) {
  if (on === driving) return;
  driving = floor.driving = on;
  by("drive").ariaPressed = on;
  held.end();
  clearInterval(timer);
  if (on) timer = setInterval(word, DRIVE_MS);
}

function word() {
  const way = held.way(performance.now());
  if (way) say(`drive ${chosen} ${way[0]} ${way[1]}`);
  else if (held.silent) {
    held.silent = false;
    refuse(`${chosen} stands: nothing was heard of the keys; let go of them, and press them again`);
  }
}

// The stop goes first; who drove does not drive on, and says nothing after it.
function estop() {
  say("estop");
  drive(false);
}

addEventListener("keydown", (e) => {
  if (e.key === "F8") {
    estop();
    e.preventDefault();
  }
  if (e.key === "Escape") {
    drive(false);
    close();
  }
  const typed = /INPUT|SELECT/.test(e.target.tagName);
  if (driving && (modified(e) || !typed) && held.down(e)) e.preventDefault();
});
addEventListener("keyup", (e) => held.up(e));
// What may take the release of a key away.
for (const name of ["blur", "focusin", "contextmenu", "visibilitychange"]) addEventListener(name, () => held.end());

by("estop").onclick = estop;
press(by("reset"), () => say("reset"), refuse);
// What is in force goes on with the options that it has; another mission is named.
press(by("start"), () => say(ordered("mission") ? `start ${by("mission").value}`.trim() : "start"), refuse);
press(by("form"), () => (ordered("shape", "spacing"), say(`formation ${by("shape").value} ${by("spacing").value}`.trim())), refuse);
press(by("drive"), () => drive(!driving), refuse);
by("speed").onchange = () => (ordered("speed"), say(`speed ${by("speed").value}`));
by("camera").onclick = () => camera.show(camera.on ? null : chosen);
by("sonar").onclick = () => {
  floor.sonar = !floor.sonar;
  by("sonar").ariaPressed = floor.sonar;
  floor.draw();
};
by("follow").onchange = (e) => ((floor.follow = e.target.checked), floor.draw());
by("trails").onchange = (e) => ((floor.trails = e.target.checked), floor.draw());
for (const b of all("[data-line]")) press(b, () => say(b.dataset.line), refuse);
for (const b of all("[data-one]")) press(b, () => say(`${b.dataset.one} ${chosen}`), refuse);
for (const b of all("[data-zoom]")) b.onclick = () => floor.zoom(Number(b.dataset.zoom));
for (const b of all("[data-fit]")) b.onclick = () => floor.showAll(b.dataset.fit);
by("close").onclick = close;
by("command").onsubmit = (e) => {
  e.preventDefault();
  const line = by("line");
  if (line.value.trim()) say(line.value.trim());
  line.value = "";
};

by("write").onsubmit = (e) => (e.preventDefault(), say(messages.written()));

follows("mission", "shape", "spacing", "speed");
reasons();
tabs((id) => {
  messages.open(id === "tab-messages");
  nodes.open(id === "tab-nodes");
});
by("legend").ontoggle = () => legend(by("legend").querySelector("ul"));
write(by("fleet"), "connecting …");
connect();
