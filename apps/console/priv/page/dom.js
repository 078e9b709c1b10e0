// Words and elements that the parts of the page share. Text from the fleet is only ever set as text.
export const by = (id) => document.getElementById(id);
export const all = (selector) => [...document.querySelectorAll(selector)];
export const made = (tag, textContent = "", more = {}) => Object.assign(document.createElement(tag), { textContent, ...more });
export const words = (name) => name.replaceAll("_", " ");
export const metres = (m) => (m === null ? "" : `${m.toFixed(2)} m`);

// Only what differs is written, so that nothing is read aloud twice and no selection is lost.
export const write = (element, text) => element.textContent !== text && (element.textContent = text);
