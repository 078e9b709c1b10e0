// Which part of the floor the canvas shows. Metres on the floor, x right, y up; pixels on the canvas, y down.
const LEAST = 2, MOST = 400; // pixels a metre
const ROOM = 1.5; // metres round what is shown
const SMALLEST = 8; // metres; a fleet on one spot is not shown larger
const SHARE = 0.6; // of the whole floor: a fleet that takes more of it is shown with all of it

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.at = null; // {x, y, scale}: the middle of the picture, pixels a metre
    this.shows = "fleet"; // what it shows by itself, "all" the floor; null where a person has moved it
    this.stale = true; // whether that is to be found anew
    this.blind = true; // whether it was found before there was a fleet
  }

  // Takes the canvas's size, and says whether there is one.
  measure() {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (w === 0 || h === 0) return false;
    const dots = devicePixelRatio || 1;
    if (this.size?.w !== w || this.size?.h !== h || this.size.dots !== dots) {
      this.canvas.width = Math.round(w * dots);
      this.canvas.height = Math.round(h * dots);
      this.size = { w, h, dots };
      this.stale = true;
    }
    return true;
  }

  // Shows the whole floor, or these places of it, where a person has not chosen something else. What drives out of the picture
  // is brought back into it.
  fit(floor, places) {
    const [left, bottom, right, top] = floor;
    const settled = !this.stale && !(this.blind && places.length > 0) && places.every((place) => this.holds(place));
    if (this.at && (!this.shows || (this.shows === "fleet" && settled))) return;
    this.stale = false;
    this.blind = places.length === 0;
    if (this.shows === "all") return this.box(floor, 0.95);
    const [xs, ys] = [places.map(([x]) => x), places.map(([, y]) => y)];
    const fleet = [Math.min(...xs) - ROOM, Math.min(...ys) - ROOM, Math.max(...xs) + ROOM, Math.max(...ys) + ROOM];
    const small = places.length > 0 && fleet[2] - fleet[0] < SHARE * (right - left) && fleet[3] - fleet[1] < SHARE * (top - bottom);
    this.box(small ? fleet : floor, 0.95);
  }

  box([left, bottom, right, top], share) {
    const { w, h } = this.size;
    const [wide, high] = [Math.max(right - left, SMALLEST), Math.max(top - bottom, SMALLEST)];
    this.at = { x: (left + right) / 2, y: (bottom + top) / 2, scale: Math.max(LEAST, share * Math.min(w / wide, h / high)) };
  }

  holds([x, y]) {
    const [px, py] = this.toPixel(x, y);
    return px > 24 && py > 24 && px < this.size.w - 24 && py < this.size.h - 24;
  }

  toPixel(x, y) {
    const { at, size } = this;
    return [size.w / 2 + (x - at.x) * at.scale, size.h / 2 - (y - at.y) * at.scale];
  }

  toFloor(px, py) {
    const { at, size } = this;
    return [at.x + (px - size.w / 2) / at.scale, at.y - (py - size.h / 2) / at.scale];
  }

  // What is at the pixel stays there.
  zoom(factor, [px, py] = [this.size.w / 2, this.size.h / 2]) {
    const [x, y] = this.toFloor(px, py);
    const scale = Math.min(MOST, Math.max(LEAST, this.at.scale * factor));
    this.place(x, y, scale, px, py);
  }

  // Brings a place of the floor to a pixel.
  place(x, y, scale, px, py) {
    const { w, h } = this.size;
    this.shows = null;
    this.at = { scale, x: x - (px - w / 2) / scale, y: y + (py - h / 2) / scale };
  }

  middle(x, y) {
    Object.assign(this.at, { x, y });
  }
}
