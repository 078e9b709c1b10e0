// Searches the index: each word that is typed stands in the module's name, in what is said of it, or in what it has.
const box = document.querySelector("#search input");
const modules = [...document.querySelectorAll("#index li")].map((item) => {
  const has = [...item.querySelectorAll(".has a")];
  return { item, has, text: item.textContent.toLowerCase(), own: item.querySelector("a").textContent.toLowerCase() };
});

function search() {
  const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const { item, has, text, own } of modules) {
    const found = words.every((word) => text.includes(word));
    item.hidden = !found;
    count += found;
    const more = found && words.length > 0 && has.filter((a) => words.some((word) => !own.includes(word) && a.textContent.toLowerCase().includes(word)));
    for (const a of has) a.hidden = !more || !more.includes(a);
    item.querySelector(".has").hidden = !more || more.length === 0;
  }
  for (const part of document.querySelectorAll("#index section, .room")) part.hidden = !part.querySelector("li:not([hidden])");
  document.querySelector("#found").textContent = words.length ? `${count} of ${modules.length} modules` : "";
}

document.querySelector("#search").hidden = false;
box.oninput = search;
search();
box.focus();
