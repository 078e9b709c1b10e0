// The nodes of the fleet, the robots on each, and the programs that run on these, which start and end here.
import { by, made, write } from "./dom.js";
import { Watched } from "./watched.js";

export class Nodes extends Watched {
  constructor(ask, say) {
    super(ask);
    this.say = say;
  }

  // A button that was pressed stays the focused one.
  draw() {
    if (!this.on) return;
    const focused = document.activeElement?.dataset?.program;
    write(by("nodes-note"), this.why ? `Not known here: ${this.why}.` : "Programs answer other programs, and end with their robot.");
    by("nodes").closest("table").hidden = this.entries.length === 0;
    by("nodes").replaceChildren(...this.entries.flatMap((node) => this.node(node)));
    if (focused) by("nodes").querySelector(`[data-program="${CSS.escape(focused)}"]`)?.focus();
  }

  node({ node, state, robots }) {
    const head = made("tr", "", { className: "node" });
    const name = made("th", node, { colSpan: 4, scope: "rowgroup" });
    name.append(made("span", state, { className: "count" }));
    head.append(name);
    return [head, ...robots.flatMap((robot) => this.robot(robot))];
  }

  robot({ id, why, programs }) {
    const rows = programs.map(({ name, runs, ours }) => {
      const tr = made("tr");
      const act = made("td", ours ? "" : "with its robot");
      if (ours) {
        const button = made("button", runs ? "End" : "Start", { type: "button", ariaLabel: `${runs ? "End" : "Start"} ${name} on ${id}` });
        button.dataset.program = `${id} ${name}`;
        button.onclick = () => this.say(`program ${id} ${runs ? "end" : "start"} ${name}`);
        act.append(button);
      }
      tr.append(made("td", id), made("td", name), made("td", runs ? "runs" : "ended"), act);
      return tr;
    });
    if (why || rows.length === 0) {
      const tr = made("tr");
      tr.append(made("td", id), made("td", why ?? "no programs", { colSpan: 3 }));
      rows.unshift(tr);
    }
    return rows;
  }
}
