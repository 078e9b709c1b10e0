// What is told only while it is looked at: its tab asks for it, and again after the connection was lost.
export class Watched {
  constructor(ask) {
    this.ask = ask; // (on): whether it is to be told
    this.on = false;
    this.entries = [];
    this.why = null;
  }

  open(on) {
    if (on === this.on) return;
    this.on = on;
    this.ask(on);
  }

  again() {
    if (this.on) this.ask(true);
  }

  hear({ entries, why }) {
    [this.entries, this.why] = [entries, why];
    this.draw();
  }
}
