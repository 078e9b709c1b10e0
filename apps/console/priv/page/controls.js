// Controls that show what is in force, that say why they do nothing now, and that ask before they do something.
import { all, by, made, write } from "./dom.js";

// Greys a control and says why, to the pointer, the keyboard and screen readers; without a reason it works.
export function bar(control, why) {
  if (control.dataset.stop !== undefined) return;
  if (why) {
    if (control.title !== why) control.title = why;
    control.ariaDisabled = "true";
  } else if (control.ariaDisabled) {
    control.removeAttribute("title");
    control.ariaDisabled = null;
  }
}

// Runs `work` when the control is pressed; one that is barred says why instead. One that asks first does it in its own place:
// no dialog ever stands before the emergency stop.
export function press(control, work, refuse) {
  control.onclick = () => {
    if (control.ariaDisabled) refuse(control.title);
    else if (control.dataset.ask) ask(control, control.dataset.ask, control.dataset.yes, work);
    else work();
  };
}

let open = null;

function ask(control, question, yes, work) {
  open?.();
  const box = made("span", "", { className: "asked", role: "group", ariaLabel: question });
  open = answerable(box, question, yes, work, () => {
    box.remove();
    control.hidden = false;
    control.focus();
  });
  control.hidden = true;
  control.after(box);
  box.querySelector("button").focus();
}

// A question with its two answers, in a box; returns what ends it without an answer. A key that is held answers nothing.
export function answerable(box, question, yes, work, end) {
  const over = () => {
    if (open === over) open = null;
    end();
  };
  const go = made("button", yes, { type: "button", onclick: () => (over(), work()) });
  const no = made("button", "Cancel", { type: "button", onclick: over });
  box.replaceChildren(made("span", question), go, no);
  box.classList.add("asked");
  box.onkeydown = (e) => {
    if (e.repeat) e.preventDefault();
    if (e.key === "Escape") over();
  };
  return over;
}

export const unask = () => open?.();

// A reason that the pointer finds by the title shows itself where the keyboard comes to it.
export function reasons() {
  const why = by("why");
  const show = (e) => {
    const control = e.target.closest?.("[aria-disabled=true]");
    why.hidden = !control || !control.matches(":focus-visible");
    if (why.hidden) return;
    write(why, control.title);
    const box = control.getBoundingClientRect();
    why.style.left = `${Math.max(4, Math.min(box.left, innerWidth - why.offsetWidth - 8))}px`;
    why.style.top = `${box.bottom + 6 + why.offsetHeight > innerHeight ? box.top - why.offsetHeight - 6 : box.bottom + 6}px`;
  };
  addEventListener("focusin", show);
  addEventListener("focusout", () => (why.hidden = true));
}

// A control follows what is in force until a person changes it, and again when that was ordered.
export function follows(...ids) {
  for (const id of ids) by(id).addEventListener("input", () => by(id).classList.add("edited"));
}

// Whether a person had changed one of them.
export function ordered(...ids) {
  const edited = ids.some((id) => by(id).classList.contains("edited"));
  for (const id of ids) by(id).classList.remove("edited");
  return edited;
}

// What is not known is shown as such.
function follow(id, value) {
  const control = by(id);
  if (control.classList.contains("edited") || control.value === value) return;
  if (control.tagName === "SELECT" && ![...control.options].some((option) => option.value === value)) control.add(new Option(value));
  control.value = value;
}

// What is in force, and what cannot be ordered now. Stops always can.
export function controls(scene) {
  const alive = scene.robots.filter((r) => r.alive);
  follow("mission", scene.mission ?? "");
  follow("shape", scene.formation?.[0] ?? "");
  follow("spacing", scene.formation?.[1].toFixed(1) ?? "");
  if (scene.speed) follow("speed", scene.speed);
  const none = alive.length === 0 && "no robot is alive";
  const bars = alive.map((r) => r.bars);
  const still = alive.length > 0 && bars.every(Boolean) && (new Set(bars).size === 1 ? `no robot can move: ${bars[0]}` : "no robot can move: the list says why");
  bar(by("start"), none || still);
  bar(by("form"), none || still || (by("shape").value === "" && "choose a shape first"));
  bar(document.querySelector("[data-line='kill leader']"), !scene.leader && "there is no leader to kill yet");
  by("pace").hidden = scene.pace === null;
  bar(document.querySelector("[data-line=pause]"), scene.paused && "it is paused already");
  bar(document.querySelector("[data-line=resume]"), !scene.paused && "it is not paused");
}

// What cannot work without a connection.
export function enable(on) {
  for (const set of all("fieldset")) set.disabled = !on;
  const label = by("estop");
  if (on !== (label.childElementCount === 0)) label.replaceChildren(on ? label.textContent : made("s", label.textContent));
}
