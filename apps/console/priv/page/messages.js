// What robots say to each other, as a grid: the newest last, what is said again in one row with its count. Below it a person
// writes to their missions.
import { by, made, write } from "./dom.js";
import { Watched } from "./watched.js";

// The messages up to a time, of one robot (null: of all), the newest last. Pure.
export function told(entries, at_s, chosen) {
  const mine = (e) => chosen === null || e.from === chosen || e.to === "all" || e.to.includes(chosen);
  return entries.filter((e) => e.at_s <= at_s + 0.1 && mine(e));
}

export class Messages extends Watched {
  constructor(ask) {
    super(ask);
    this.at_s = Infinity;
    this.chosen = null;
    this.hears = []; // of each mission that hears people: {mission, kinds: [{kind, fields: [{name, allowed}]}]}
    this.kinds = [];
    by("write-kind").onchange = () => this.fields();
  }

  writable(hears) {
    this.hears = hears;
    this.offer(null);
  }

  // The kinds of the mission in force, or of all where that is not known here.
  offer(mission) {
    const known = this.hears.filter((h) => h.mission === mission?.split(":")[0]);
    const of = mission && !known.length ? [] : mission ? known : this.hears;
    this.kinds = of.flatMap((h) => h.kinds);
    this.mission = mission;
    const barred = this.kinds.length === 0;
    for (const e of by("write").querySelectorAll("label, button, span")) e.hidden = barred;
    const which = this.hears.map((h) => h.mission).join(", ");
    const why = which ? `${mission} hears no messages of people; these do: ${which}.` : "No mission here hears messages of people.";
    write(by("write-note"), barred ? why : "");
    by("write-kind").replaceChildren(...this.kinds.map(({ kind }) => new Option(kind)));
    this.fields();
  }

  // A field for each that the message has, with what is allowed in it.
  fields() {
    const kind = this.kinds[by("write-kind").selectedIndex];
    const field = ({ name, allowed }) => {
      const label = made("label", name);
      label.append(made("input", "", { name, placeholder: allowed, title: allowed, spellcheck: false, maxLength: 300 }));
      return label;
    };
    by("write-fields").replaceChildren(...(kind?.fields ?? []).map(field));
  }

  // The line of what was written.
  written() {
    write(by("write-answer"), "");
    const fields = [...by("write-fields").querySelectorAll("input")].filter((i) => i.value.trim());
    const said = fields.map((i) => `${i.name}=${i.value.trim()}`).join(",");
    return `send ${by("write-to").value} ${by("write-kind").value}${said && ":"}${said}`;
  }

  answered(text, ok) {
    write(by("write-answer"), text);
    by("write-answer").className = ok ? "good" : "bad";
  }

  // Who may be written to: all, and the robots that live; at first the chosen one.
  addressees(robots, chosen) {
    const to = by("write-to");
    const names = ["all", ...robots.filter((r) => r.alive).map((r) => r.id)];
    const was = chosen === this.chosen ? to.value : (chosen ?? "all");
    if (names.join() !== [...to.options].map((o) => o.value).join()) to.replaceChildren(...names.map((name) => new Option(name)));
    const value = names.includes(was) ? was : "all";
    if (to.value !== value) to.value = value;
  }

  // Another robot, or another time.
  show({ at_s, mission, robots }, chosen) {
    if ((mission ?? null) !== this.mission) this.offer(mission ?? null);
    this.addressees(robots, chosen);
    const later = (than) => this.entries.at(-1)?.at_s > than;
    const same = chosen === this.chosen && !later(at_s) && !later(this.at_s);
    [this.at_s, this.chosen] = [at_s, chosen];
    if (!same) this.draw();
  }

  draw() {
    if (!this.on) return;
    const shown = told(this.entries, this.at_s, this.chosen);
    const whose = this.chosen === null ? "of all robots" : `from and to ${this.chosen}`;
    write(by("said-note"), this.why ? `Not known here: ${this.why}.` : `The newest messages ${whose}, without heartbeats, which every robot sends all the time.`);
    const panel = by("panel-messages");
    const down = panel.scrollHeight - panel.scrollTop - panel.clientHeight < 30;
    by("said").closest("table").hidden = shown.length === 0;
    by("said").replaceChildren(...shown.map(row));
    if (down) panel.scrollTop = panel.scrollHeight;
  }
}

const seconds = (s) => `${s.toFixed(1)} s`;

function row({ at_s, last_s, count, from, to, kind, text }) {
  const tr = made("tr", "", { title: kind });
  const said = made("td", text || kind);
  if (count > 1) said.append(made("span", `${count} times, until ${seconds(last_s)}`, { className: "count" }));
  tr.append(made("td", seconds(at_s)), made("td", `${from} → ${to === "all" ? "all" : to.join(", ")}`), said);
  return tr;
}
