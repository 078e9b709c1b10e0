// The page: a WebSocket to the fleet, the map, and the panels beside it. Text from the fleet is only ever set as text.
import { FloorView, colour } from "./map.js";
import { HeldKeys, modified } from "./keys.js";

const by = (id) => document.getElementById(id);
const DRIVE_MS = 100; // how often the keyboard says a word; the server stops after 300 ms without one
const PRESENT_MS = 250; // how often a person who sees the page is told of
const OLD_MS = 2000; // a scene comes ten times a second
// A stop is sent at any time; all else only while the fleet is heard.
const STOP = /^\s*(e+[\s-]?stop|stop|halt|emergenc|disarm)/i;
let heard = 0, ahead = -Infinity, socket, chosen, scene, told = 0, tries = 0, driving = false, timer, opened = false, focused = null;
const held = new HeldKeys();

// Reachable for tests and the curious.
const floor = window.floor = new FloorView(by("map"), {
  choose,
  send: (x, y) => (by("drive").hidden ? answer({ ok: false, text: "in lockstep robots take no places; start the demo without --speed" }) : chosen ? say(`goto ${chosen} ${x.toFixed(2)},${y.toFixed(2)}`) : answer({ ok: false, text: "choose a robot first" })),
  landmark: (x, y) => say(`landmark ${x.toFixed(2)},${y.toFixed(2)}`),
});

// Beside this page, wherever a proxy puts it; with its token, if its address has one.
const live = new URL(`live${location.search}`, location.href);
live.protocol = location.protocol === "https:" ? "wss:" : "ws:";

function connect() {
  socket = new WebSocket(live);
  socket.onopen = () => {
    tries = 0;
    opened = true;
    ahead = -Infinity;
    controls(true);
    if (chosen) say(`look ${chosen}`);
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
  fleet.textContent = "No connection to the fleet. What you see is old, and the buttons reach nobody.";
  fleet.className = "lost";
  drive(false);
  controls(false);
}

// What cannot work looks so. While nothing comes, but the connection stands, orders look so, too, and say why when they are
// clicked; a stop is tried at any time.
function controls(on) {
  const open = socket.readyState === WebSocket.OPEN;
  document.body.classList.toggle("silent", open && !on);
  if (!open) focused ??= document.activeElement;
  for (const set of document.querySelectorAll("fieldset")) set.disabled = !open;
  const label = by("estop");
  if (open !== (label.childElementCount === 0))
    label.replaceChildren(open ? label.textContent : Object.assign(document.createElement("s"), { textContent: label.textContent }));
  if (!open) return;
  if (focused && document.activeElement === document.body) focused.focus();
  focused = null;
}

const silent = () => performance.now() - heard > OLD_MS || ahead === -Infinity;
const refuse = (text) => answer({ ok: false, text });

// With the time when it was given, by the server's clock. An order that cannot arrive in time is not sent at all.
function say(line) {
  if (socket?.readyState !== WebSocket.OPEN) return refuse(`not sent, because there is no connection: ${line}`);
  if (!silent()) return socket.send(`@${Math.round(performance.now() + ahead)} ${line}`);
  const stop = STOP.test(line);
  if (!stop && !line.startsWith("look")) return refuse(`not sent, because the fleet is not heard: ${line}`);
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
    told = 0;
    by("stages").replaceChildren();
    by("robots").replaceChildren();
    for (const b of document.querySelectorAll("[data-offer]")) b.hidden = !message.offers.includes(b.dataset.offer);
    by("off").hidden = !message.width;
    const same = by("mission").options[0];
    by("mission").replaceChildren(same, ...message.missions.map((name) => new Option(name)));
    floor.setMap(message);
  } else if (message.t === "scene") {
    tick(message.now);
    controls(true);
    show(message);
  } else if (message.t === "about") about(message);
  else if (message.t === "answer") answer(message);
}

function answer({ ok, text }) {
  const output = by("answer");
  output.textContent = text;
  output.className = ok ? "good" : "bad";
}

// What is shown is old also where the connection stands and nothing comes.
setInterval(() => silent() && lost(), 500);

// Robots that move only in the presence of a person hear of one while the page is seen.
setInterval(() => {
  if (socket?.readyState === WebSocket.OPEN && !silent() && document.visibilityState === "visible")
    socket.send(`@${Math.round(performance.now() + ahead)} present`);
}, PRESENT_MS);

function show(next) {
  scene = next;
  floor.setScene(scene);
  const fleet = by("fleet");
  const parts = [
    scene.formation && `${scene.at_s.toFixed(1)} s`,
    scene.pace,
    scene.formation && `${scene.formation[0]} ${scene.formation[1].toFixed(1)} m`,
    scene.formation ? null : `${scene.robots.filter((r) => r.alive).length} robots heard`,
    scene.leader ? `${scene.leader} leads` + (scene.epoch === null ? "" : `, epoch ${scene.epoch}`) : "no leader",
    scene.error && `${scene.formed ? "formed" : "off by"} ${scene.error.map((e) => e.toFixed(2)).join("/")} m`,
  ];
  fleet.textContent = scene.notice ?? parts.filter(Boolean).join(" · ");
  fleet.className = scene.notice ? "lost" : "";
  by("held").hidden = scene.estop === null;
  if (scene.estop !== null) by("held").textContent = scene.estop;
  by("pace").hidden = scene.pace === null;
  scene.robots.forEach(row);
  leads();
  apart();
  one();
  stages();
}

// Who leads, and who follows: of a divided fleet each part has a leader.
function leads() {
  const text = scene.robots.filter((r) => r.alive && r.leader).map(({ id }) => {
    const others = scene.robots.filter((r) => r.alive && (r.follows === id || (r.slot && id === scene.leader)));
    const epoch = id === scene.leader && scene.epoch !== null ? ` epoch ${scene.epoch}` : "";
    return `${id} leads${epoch}; ${others.length === 0 ? "nobody follows" : `${others.map((r) => r.id).join(", ")} follow`}.`;
  }).join(" ") || "Nobody leads.";
  if (by("leads").textContent !== text) by("leads").textContent = text;
}

// Who is not on the map, because nobody knows where it is to those that are.
function apart() {
  const others = scene.robots.filter((r) => r.x !== null && r.frame !== floor.frame).map((r) => r.id);
  by("apart").hidden = others.length === 0;
  const text = `Not on this map, because their places on it are not known: ${others.join(", ")}. Choose one to see its own.`;
  if (by("apart").textContent !== text) by("apart").textContent = text;
}

// A row for each robot, made once, so that it keeps the focus.
function row(robot, index) {
  let tr = document.querySelector(`tr[data-id="${robot.id}"]`);
  if (!tr) {
    tr = document.createElement("tr");
    tr.dataset.id = robot.id;
    const mark = Object.assign(document.createElement("span"), { className: "mark" });
    mark.style.background = colour(index);
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: robot.id });
    button.onclick = () => choose(robot.id);
    const cells = [0, 1, 2, 3].map(() => document.createElement("td"));
    cells[0].append(mark, button);
    tr.append(...cells);
    by("robots").append(tr);
  }
  tr.children[2].hidden = scene.formation === null;
  const metres = (m) => (m === null ? "" : `${m.toFixed(2)} m`);
  tr.children[1].textContent = (robot.alive ? words(robot.state) : away(robot)) + (robot.alive && robot.leader ? " ★" : "");
  tr.children[2].textContent = robot.alive ? metres(robot.off) : "";
  tr.children[3].textContent = robot.alive && robot.unsure !== null ? `±${metres(robot.unsure)}` : "";
  tr.className = [!robot.alive && "dead", robot.state === "E-STOP" && "held", robot.frame !== floor.frame && "apart"].filter(Boolean).join(" ");
  tr.setAttribute("aria-selected", robot.id === chosen);
}

const away = (robot) => (robot.state === "not_heard" ? "not heard" : "dead");

function choose(id) {
  drive(false);
  camera(false);
  chosen = chosen === id ? null : id;
  floor.chosen = chosen;
  nothing();
  by("events").replaceChildren();
  say(`look ${chosen ?? ""}`);
  if (scene) show(scene);
}

// Of one that is newly chosen, or has gone, nothing is known that is of now.
function nothing() {
  floor.about = null;
  by("about").replaceChildren();
  by("camera").hidden = by("sonar").hidden = true;
}

function one() {
  const robot = scene.robots.find((r) => r.id === chosen);
  by("one").hidden = !robot;
  if (!robot) return;
  by("chosen").textContent = robot.id;
  by("acts").className = robot.alive ? "" : robot.state === "not_heard" ? "away" : "gone";
  if (!robot.alive) nothing();
  const where = robot.x === null ? "pose unknown"
    : `at ${robot.x.toFixed(2)}, ${robot.y.toFixed(2)}, ${Math.round((robot.a * 180) / Math.PI)}°`;
  by("doing").textContent = (robot.alive ? `${words(robot.state)}, ${where}` : `${away(robot)}, last ${where}`)
    + (robot.apart === null ? "" : `, in a frame of its own: ${robot.apart}`);
}

// Lines of a list, which is left alone while they are the same.
function list(id, lines) {
  const all = by(id);
  if (all.childElementCount === lines.length && all.lastChild?.textContent === lines.at(-1)) return;
  all.replaceChildren(...lines.map((textContent) => Object.assign(document.createElement("li"), { textContent })));
  all.scrollTop = all.scrollHeight;
}

const words = (name) => name.replaceAll("_", " ");
const length = (way) => way.slice(1).reduce((sum, [x, y], k) => sum + Math.hypot(x - way[k][0], y - way[k][1]), 0);

// Without the minus of -0.00.
const decimals = (number) => (Math.round(number * 100) / 100 + 0).toFixed(2);

// Why it does what it does: who wished, the chosen one first, what limits it, its way, its devices, and what it did.
function about(told) {
  if (told.id !== chosen || !scene?.robots.find((r) => r.id === chosen)?.alive) return;
  floor.about = told;
  const rows = [
    ["does", told.by && words(told.by)],
    ["wishes", told.wishes.map(([by, weight]) => `${words(by)} ${weight.toFixed(2)}`).join(", ")],
    ["way", told.way.length > 0 && `${length([told.pose, ...told.way]).toFixed(1)} m, by ${told.way.length} ${told.way.length === 1 ? "place" : "places"}`],
    ["speed", told.speed === null ? "unknown" : `${decimals(told.speed)} m/s` + (told.turn === null ? "" : `, ${decimals(told.turn)} rad/s`)],
    ["camera", [told.looks, told.sees].filter(Boolean).join(", ")],
    ["pictures", told.pictures],
    ["limited by", told.limits.map(words).join(", ")],
    ["fault", told.fault],
    ["note", told.notes.join("; ")],
    ["stopped", told.estop && "emergency stop, until it is reset"],
    ["offline", told.offline.join(", ")],
    ["battery", told.power !== null && `${told.power.toFixed(1)} V`],
  ].filter(([, text]) => text);
  const made = (tag, textContent) => Object.assign(document.createElement(tag), { textContent });
  by("about").replaceChildren(...rows.flatMap(([term, text]) => [made("dt", term), made("dd", text)]));
  list("events", told.events);
  by("camera").hidden = !told.camera && !told.pictures;
  by("camera").disabled = !told.camera;
  by("camera").title = told.pictures ? `pictures ${told.pictures}` : "";
  by("sonar").hidden = told.sonar.length === 0;
  floor.draw();
}

// At most five pictures a second, and only while somebody looks; each is asked for when the one before is there. One that does
// not come ends it: what is shown would be old.
const LOOK_MS = 200;
const PICTURE_MS = 3000;
let looking = false, looks = 0;

function camera(on) {
  if (looking === on) return;
  looking = on;
  by("camera").setAttribute("aria-pressed", on);
  by("picture").hidden = !on;
  if (on) picture(chosen);
}

async function picture(id) {
  const look = ++looks;
  const on = () => looking && look === looks;
  while (on()) {
    const begun = performance.now();
    try {
      const answer = await fetch(`camera/${id}`, { signal: AbortSignal.timeout(PICTURE_MS) });
      if (!answer.ok) throw new Error(await answer.text());
      const bitmap = await createImageBitmap(await answer.blob());
      if (on()) paint(bitmap);
    } catch (error) {
      if (!on()) return;
      hear({ t: "answer", ok: false, text: error.name === "TimeoutError" ? `no picture of ${id} for ${PICTURE_MS / 1000} s` : String(error.message) });
      return camera(false);
    }
    await new Promise((go) => setTimeout(go, Math.max(0, LOOK_MS - (performance.now() - begun))));
  }
}

function paint(bitmap) {
  const canvas = by("picture");
  const c = canvas.getContext("2d");
  [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
  c.drawImage(bitmap, 0, 0);
  const seen = floor.about?.seen;
  if (!seen) return;
  const [sx, sy] = [bitmap.width / seen.width, bitmap.height / seen.height];
  c.lineWidth = 2;
  c.strokeStyle = "#d55e00";
  c.fillStyle = "#d55e00";
  c.font = "11px system-ui, sans-serif";
  for (const [name, left, top, right, bottom] of seen.boxes) {
    c.strokeRect(left * sx, top * sy, (right - left + 1) * sx, (bottom - top + 1) * sy);
    c.fillText(name, left * sx, Math.max(10, top * sy - 3));
  }
}

function stages() {
  const list = by("stages");
  const fresh = Math.min(scene.told - told, scene.stages.length);
  for (const { line } of scene.stages.slice(scene.stages.length - Math.max(fresh, 0)))
    list.append(Object.assign(document.createElement("li"), { textContent: line }));
  if (fresh > 0) list.scrollTop = list.scrollHeight;
  told = scene.told;
}

// Driving: a word every 100 ms while the mode is on and keys are held.
function drive(on) {
  if (on === driving) return;
  driving = floor.driving = on;
  by("drive").setAttribute("aria-pressed", on);
  held.end();
  clearInterval(timer);
  if (on) timer = setInterval(word, DRIVE_MS);
}

function word() {
  const way = held.way(performance.now());
  if (way) say(`drive ${chosen} ${way[0]} ${way[1]}`);
  else if (held.silent) {
    held.silent = false;
    answer({ ok: false, text: `${chosen} stands: nothing was heard of the keys; let go of them, and press them again` });
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
  if (e.key === "Escape") drive(false);
  const typed = /INPUT|SELECT/.test(e.target.tagName);
  if (driving && (modified(e) || !typed) && held.down(e)) e.preventDefault();
});
addEventListener("keyup", (e) => held.up(e));
// What may take the release of a key away.
for (const name of ["blur", "focusin", "contextmenu", "visibilitychange"]) addEventListener(name, () => held.end());

function ask(question) {
  held.end();
  return confirm(question);
}

by("estop").onclick = estop;
by("reset").onclick = () =>
  ask("Reset the emergency stop? Robots may move again when they are started.") && say("reset");
by("form").onclick = () => say(`formation ${by("shape").value} ${by("spacing").value}`);
by("speed").onchange = () => say(`speed ${by("speed").value}`);
by("drive").onclick = () => drive(!driving);
by("camera").onclick = () => camera(!looking);
by("sonar").onclick = (e) => {
  floor.sonar = !floor.sonar;
  e.target.setAttribute("aria-pressed", floor.sonar);
  floor.draw();
};
by("follow").onchange = (e) => ((floor.follow = e.target.checked), floor.draw());
by("trails").onchange = (e) => ((floor.trails = e.target.checked), floor.draw());
by("start").onclick = () => say(`start ${by("mission").value}`.trim());
for (const b of document.querySelectorAll("[data-line]")) b.onclick = () => say(b.dataset.line);
for (const b of document.querySelectorAll("[data-one]")) 
  b.onclick = () => (!b.dataset.ask || ask(`${b.dataset.ask} ${chosen}?`)) && say(`${b.dataset.one} ${chosen}`);
for (const b of document.querySelectorAll("[data-zoom]")) b.onclick = () => floor.zoom(Number(b.dataset.zoom));
by("command").onsubmit = (e) => {
  e.preventDefault();
  const line = by("line");
  if (line.value.trim()) say(line.value.trim());
  line.value = "";
};

by("fleet").textContent = "connecting …";
connect();
