// Values of a recording at the time that is shown: exact while time stands still, at the screen's rate while it goes on.

import { frames } from "./api.js";

const FRAMES_OF_BLOCK = 120;
const BLOCKS_KEPT = 40;
// Frames a second of the viewer's.
const RATE_HZ = 60;
// Pause behind an answer that failed.
const CALM_MS = 1000;

/** The fields that are shown of a recording, each with its place in a row of values. */
export class Columns {
  constructor(recording) {
    this.fields = [];
    this.learn(recording);
  }

  /** Takes the topics that the recording has by now. */
  learn(recording) {
    this.known = new Map(recording.topics.map((topic) => [topic.name, new Set(topic.fields.map((field) => field.path))]));
  }

  /** The place of a field; -1 where the recording has none. */
  add(topic, field) {
    if (!this.known.get(topic)?.has(field)) return -1;
    const found = this.fields.findIndex((other) => other.topic === topic && other.field === field);
    return found >= 0 ? found : this.fields.push({ topic, field }) - 1;
  }

  /** The places of several fields of a topic; null unless the recording has them all. */
  all(topic, fields) {
    const places = topic === undefined ? [-1] : fields.map((field) => this.add(topic, field));
    return places.includes(-1) ? null : places;
  }
}

export class Feed {
  #blocks = new Map();
  #exact = null;
  #asked = null;

  /** `report` gets the text of an error, and an empty text after the next success. */
  constructor(number, recording, fields, report) {
    Object.assign(this, { number, durationNs: recording.duration_ns, tickNs: recording.tick_ns ?? 1e6, fields, report });
  }

  /** The recording has come so far: frames behind its former end are asked for anew. */
  grow(durationNs) {
    for (const [key, { endNs }] of this.#blocks) if (endNs > this.durationNs) this.#blocks.delete(key);
    if (this.#exact?.timeNs >= this.durationNs) this.#exact = null;
    this.durationNs = durationNs;
  }

  /** There are more fields than before: rows that lack them are asked for anew. */
  widen() {
    this.#blocks.clear();
    this.#exact = null;
  }

  /** The row of values at the time of `playback`, with the time for which they hold; null while they are on their way. */
  row(playback) {
    const timeNs = Math.min(playback.timeNs, this.durationNs);
    return playback.isPlaying ? this.#playing(timeNs, playback.pace) : this.#standing(timeNs);
  }

  #standing(timeNs) {
    const time = Math.round(timeNs);
    if (this.#exact?.timeNs === time) return this.#exact;
    this.#ask(time);
    return null;
  }

  /** Asks for one frame; the newest wish wins. */
  async #ask(timeNs) {
    const isBusy = this.#asked !== null;
    this.#asked = timeNs;
    if (isBusy) return;
    while (this.#exact?.timeNs !== this.#asked) {
      const wish = this.#asked;
      const width = this.fields.length;
      const values = await this.#frames({ from_ns: wish, step_ns: 0, count: 1 });
      if (!values) break;
      // Fields that came meanwhile are not in it.
      if (width === this.fields.length) this.#exact = { timeNs: wish, values };
    }
    this.#asked = null;
  }

  async #frames(span) {
    try {
      const values = await frames({ recording: this.number, fields: this.fields, ...span });
      this.report("");
      return values;
    } catch (error) {
      this.report(error.message);
      await new Promise((resolve) => setTimeout(resolve, CALM_MS));
      return null;
    }
  }

  #playing(timeNs, pace) {
    const stepNs = Math.max(Math.round((pace * 1e9) / RATE_HZ / this.tickNs), 1) * this.tickNs;
    const frame = Math.floor(timeNs / stepNs);
    const number = Math.floor(frame / FRAMES_OF_BLOCK);
    this.#fetch(stepNs, number);
    this.#fetch(stepNs, number + 1);
    const block = this.#blocks.get(`${stepNs} ${number}`);
    if (!block?.values) return null;
    const width = this.fields.length;
    const place = frame - number * FRAMES_OF_BLOCK;
    return { timeNs: frame * stepNs, values: block.values.subarray(place * width, (place + 1) * width) };
  }

  async #fetch(stepNs, number) {
    const key = `${stepNs} ${number}`;
    const fromNs = number * FRAMES_OF_BLOCK * stepNs;
    if (this.#blocks.has(key) || fromNs > this.durationNs) return;
    const block = { values: null, endNs: fromNs + FRAMES_OF_BLOCK * stepNs };
    this.#blocks.set(key, block);
    if (this.#blocks.size > BLOCKS_KEPT) this.#blocks.delete(this.#blocks.keys().next().value);
    block.values = await this.#frames({ from_ns: fromNs, step_ns: stepNs, count: FRAMES_OF_BLOCK });
    if (!block.values) this.#blocks.delete(key);
  }
}
