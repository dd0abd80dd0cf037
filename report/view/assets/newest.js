// The newest values of a live run, which its recording holds up to a second later: those of the room and of the scopes.

import { newest } from "./api.js";

// Pause behind an answer without values: the recorder fills no ring yet, or the run has ended.
const CALM_MS = 250;

export class Newest {
  #isAsking = false;
  #calmUntil = 0;
  // The time of the last question; values in the rows, and those of their fields that are of the scopes.
  #askedMs = -Infinity;
  #values = [];
  #fields = null;

  /** `room` has the fields of the room; `scopes()` those of the scopes. `isMissing` is true if the last answer had no values. */
  constructor(room, scopes, report) {
    Object.assign(this, { room, scopes, report, rows: null, isMissing: false });
  }

  /** Asks for the newest values, `periodMs` behind the last question. One at a time: a slow server gets no queue of old ones. */
  async ask(heard, periodMs = 0) {
    const nowMs = performance.now();
    if (this.#isAsking || nowMs < this.#calmUntil || nowMs < this.#askedMs + periodMs) return;
    [this.#isAsking, this.#askedMs] = [true, nowMs];
    const [room, scopes] = [this.room.slice(), this.scopes()];
    try {
      const found = await newest({ fields: [...room, ...scopes] });
      this.report("");
      this.isMissing = found === null;
      // Fields that came meanwhile are not in it.
      const isWhole = room.length === this.room.length && scopes === this.scopes();
      if (found === null) this.#rest();
      else if (isWhole) this.#take(found, room.length, scopes);
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

  /** Takes an answer, unless it is that of the rows: whoever compares the rows sees if there is something new. */
  #take({ timeNs, values }, width, fields) {
    const isSame = this.rows?.timeNs === timeNs && this.#fields === fields && this.#values.every((value, index) => Object.is(value, values[index]));
    if (isSame && this.#values.length === values.length) return;
    [this.#fields, this.#values] = [fields, values];
    this.rows = { timeNs, room: { timeNs, values: values.slice(0, width), isNewest: true }, scopes: { timeNs, values: values.slice(width) } };
  }
}
