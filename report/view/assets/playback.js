// The time that is shown, and whether it goes on by itself. Times are nanoseconds since the recording's first message.

/** Paces that are offered: simulated seconds in a second. */
export const PACES = [0.01, 0.03, 0.1, 0.25, 0.5, 1, 2, 5, 10];

// A recorder writes what it has each second. Where time is to be the newest and falls farther behind, it goes on from there.
const BEHIND_NS = 2.5e9;
const AT_ONCE_NS = 1e9;
// A run that tells its newest time moves time by itself; after such a silence, time goes on as in a recording.
const REACHED_MS = 500;

export class Playback {
  #heard = [];

  constructor(durationNs, tickNs) {
    Object.assign(this, { durationNs, tickNs, timeNs: 0, pace: 1, isPlaying: false, isGrowing: false, isNewest: false, reachedMs: -Infinity });
  }

  /** Calls `hear` after each change. */
  onChange(hear) {
    this.#heard.push(hear);
  }

  /** Goes to a time, at a tick within the recording. */
  seek(timeNs) {
    this.timeNs = this.#atTick(timeNs);
    // Whoever goes to the end of a recording that grows stays with it.
    this.isNewest = this.isGrowing && this.timeNs >= this.durationNs;
    this.#notify();
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
    else if (this.timeNs >= this.durationNs && !this.isGrowing) this.timeNs = 0;
    this.#notify();
  }

  /** The recording has come so far, and may go on. */
  grow(durationNs, isGrowing) {
    // The run may be ahead of its recording.
    this.durationNs = isGrowing ? Math.max(durationNs, this.durationNs) : durationNs;
    this.isGrowing = isGrowing;
    this.timeNs = Math.min(this.timeNs, this.durationNs);
    this.#notify();
  }

  /** True while time is to be the newest of a run. */
  get isFollowing() {
    return this.isNewest && this.isPlaying && this.isGrowing;
  }

  /** True if the newest time of a run is shown, ahead of its recording. */
  get isReached() {
    return this.isFollowing && performance.now() - this.reachedMs < REACHED_MS;
  }

  /** The run has come to this time, which is shown while time is to be the newest. */
  reach(timeNs) {
    if (!this.isFollowing || timeNs < this.durationNs) return;
    this.reachedMs = performance.now();
    if (timeNs === this.timeNs) return;
    Object.assign(this, { timeNs, durationNs: timeNs });
    this.#notify();
  }

  setPace(pace) {
    this.pace = pace;
    this.#notify();
  }

  /** Lets `ms` of the viewer's time pass. */
  pass(ms) {
    if (!this.isPlaying || this.isReached) return;
    // After a pause of the browser, time goes on where it was. The time of a frame that comes late may lie before it was asked for.
    this.timeNs += Math.min(Math.max(ms, 0), 100) * 1e6 * this.pace;
    if (this.isNewest && this.timeNs < this.durationNs - BEHIND_NS) this.timeNs = this.durationNs - AT_ONCE_NS;
    if (this.timeNs >= this.durationNs) {
      this.timeNs = this.durationNs;
      // At the end of a recording that grows, time waits for more.
      this.isPlaying = this.isGrowing;
    }
    this.#notify();
  }

  #notify() {
    for (const hear of this.#heard) hear(this);
  }
}
