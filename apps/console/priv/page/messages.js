// What robots say to each other, as a grid: the newest last, what is said again in one row with its count.
import { by, made, write } from "./dom.js";
import { Watched } from "./watched.js";

// The messages up to a time, of one robot (null: of all), the newest last. Pure.
export function told(entries, at_s, chosen) {
  const mine = (e) => chosen === null || e.from === chosen || e.to === "all" || e.to.includes(chosen);
  return entries.filter((e) => e.at_s <= at_s + 0.1 && mine(e));
}

export class Messages extends Watched {
  at_s = Infinity;
  chosen = null;

  // Another robot, or another time.
  show({ at_s }, chosen) {
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
