// The time that is shown, and whether it goes on by itself. Times are nanoseconds since the recording's first message.

/** Paces that are offered: simulated seconds in a second. */
export const PACES = [0.1, 0.25, 0.5, 1, 2, 5, 10];

export class Playback {
  #heard = [];

  constructor(durationNs, tickNs) {
    Object.assign(this, { durationNs, tickNs, timeNs: 0, pace: 1, isPlaying: false });
  }

  /** Calls `hear` after each change. */
  onChange(hear) {
    this.#heard.push(hear);
  }

  /** Goes to a time, at a tick within the recording. */
  seek(timeNs) {
    this.timeNs = this.#atTick(timeNs);
    this.#tell();
  }

  #atTick(timeNs) {
    const ticks = Math.round(timeNs / this.tickNs);
    return Math.min(Math.max(ticks * this.tickNs, 0), this.durationNs);
  }

  step(ticks) {
    this.isPlaying = false;
    this.seek(this.timeNs + ticks * this.tickNs);
  }

  toggle() {
    this.isPlaying = !this.isPlaying;
    if (!this.isPlaying) this.timeNs = this.#atTick(this.timeNs);
    else if (this.timeNs >= this.durationNs) this.timeNs = 0;
    this.#tell();
  }

  setPace(pace) {
    this.pace = pace;
    this.#tell();
  }

  /** Lets `ms` of the viewer's time pass. */
  pass(ms) {
    if (!this.isPlaying) return;
    // After a pause of the browser, time goes on where it was.
    this.timeNs += Math.min(ms, 100) * 1e6 * this.pace;
    if (this.timeNs >= this.durationNs) {
      this.timeNs = this.durationNs;
      this.isPlaying = false;
    }
    this.#tell();
  }

  #tell() {
    for (const hear of this.#heard) hear(this);
  }
}
