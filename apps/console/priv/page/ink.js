// The colours and the writing of the map.
export const FONT = "12px system-ui, sans-serif";

// The page's colours, read once for each look that the browser has.
const inks = new Map();

export function ink(name) {
  const look = matchMedia("(prefers-color-scheme: dark)").matches;
  const key = name + look;
  if (!inks.has(key)) inks.set(key, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return inks.get(key);
}

// Over whatever is behind it.
export function text(c, words, x, y) {
  c.font = FONT;
  c.textAlign = "center";
  c.lineWidth = 3;
  c.lineJoin = "round";
  c.strokeStyle = ink("--panel");
  c.fillStyle = ink("--text");
  c.strokeText(words, x, y);
  c.fillText(words, x, y);
}

export function dashed(c, hue, path) {
  c.strokeStyle = hue;
  c.setLineDash([3, 3]);
  c.beginPath();
  path();
  c.stroke();
  c.setLineDash([]);
}
