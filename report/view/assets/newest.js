// The newest values of a live run, which its recording holds up to a second later: those of the room and of the scopes.

import { newest } from "./api.js";

// Pause behind an answer without values: the recorder fills no ring yet, or the run has ended.
const CALM_MS = 250;

export class Newest {
  #isAsking = false;
  #calmUntil = 0;

  /** `room` has the fields of the room; `scopes()` those of the scopes. `isMissing` is true if the last answer had no values. */
  constructor(room, scopes, report) {
    Object.assign(this, { room, scopes, report, rows: null, isMissing: false });
  }

  /** Asks for the newest values. One question at a time: a slow server gets no queue of old ones. */
  async ask(heard) {
    if (this.#isAsking || performance.now() < this.#calmUntil) return;
    this.#isAsking = true;
    const [room, scopes] = [this.room.slice(), this.scopes().slice()];
    try {
      const found = await newest({ fields: [...room, ...scopes] });
      this.report("");
      this.isMissing = found === null;
      // Fields that came meanwhile are not in it.
      const isWhole = room.length === this.room.length && scopes.length === this.scopes().length;
      if (found === null) this.#rest();
      if (found === null || isWhole) this.rows = found && this.#rows(found, room.length);
    } catch (error) {
      this.report(error.message);
      this.#rest();
    }
    this.#isAsking = false;
    if (this.rows) heard(this.rows);
  }

  #rest() {
    this.rows = null;
    this.#calmUntil = performance.now() + CALM_MS;
  }

  #rows({ timeNs, values }, width) {
    return { timeNs, room: { timeNs, values: values.slice(0, width), isNewest: true }, scopes: { timeNs, values: values.slice(width) } };
  }
}
