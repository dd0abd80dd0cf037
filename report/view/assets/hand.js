// Set points by hand: sliders, keys and a gamepad ask for roll, pitch, yaw and altitude of a live run.

import { fly } from "./api.js";

// Host time between two set points; the run holds to its fallback after 250 ms without one.
const PERIOD_MS = 25;
const YAW_RATE_DEG_S = 60;
const CLIMB_M_S = 0.8;
// Sticks at rest are never quite at zero.
const DEAD_BAND = 0.1;
// By key: the channel, and the deflection while it is held.
const KEYS = {
  j: ["roll", -1], l: ["roll", 1], i: ["pitch", 1], k: ["pitch", -1],
  u: ["yaw", 1], o: ["yaw", -1], PageUp: ["altitude", 1], PageDown: ["altitude", -1],
};
// By channel: the axis of a gamepad of the standard layout, and its sign. The left stick climbs and turns, the right one tilts.
const AXES = { yaw: [0, -1], altitude: [1, -1], roll: [2, 1], pitch: [3, -1] };
const UNITS = { roll: "°", pitch: "°", yaw: "°", altitude: " m" };
const CHANNELS = Object.keys(UNITS);

const get = (id) => document.getElementById(id);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const radians = (degrees) => (degrees * Math.PI) / 180;
const turned = (degrees) => degrees - 360 * Math.round(degrees / 360);

/** The deflections of the first gamepad, each within ±1; null without one. */
function gamepad() {
  const pad = [...navigator.getGamepads()].find((one) => one?.connected);
  if (!pad) return null;
  const deflection = ([axis, sign]) => {
    const value = sign * (pad.axes[axis] ?? 0);
    return Math.abs(value) < DEAD_BAND ? 0 : clamp(value, -1, 1);
  };
  return { id: pad.id, sticks: Object.fromEntries(CHANNELS.map((channel) => [channel, deflection(AXES[channel])])) };
}

export class Hand {
  #held = new Set();
  #timer = null;
  #last = 0;
  #isAsking = false;
  #wasTilted = { roll: false, pitch: false };

  constructor() {
    this.asked = { roll: 0, pitch: 0, yaw: 0, altitude: 0 };
    this.sent = 0;
    this.operators = [];
    this.#listen();
  }

  get isOn() {
    return this.#timer !== null;
  }

  /** Takes the processes that can be flown by hand; without one there is nothing to see. */
  learn(operators) {
    this.operators = operators;
    get("hand").hidden = operators.length === 0;
    get("hand-process").replaceChildren(...operators.map(({ process }) => Object.assign(document.createElement("option"), { textContent: process })));
    get("hand-process-label").hidden = operators.length < 2;
    if (operators.length) this.#choose();
  }

  #choose() {
    this.operator = this.operators[Math.max(get("hand-process").selectedIndex, 0)];
    const { altitudes_m: [low, high], tilt_max_deg: tilt, initial_altitude_m: altitude } = this.operator;
    Object.assign(this.asked, { roll: 0, pitch: 0, yaw: 0, altitude });
    for (const channel of ["roll", "pitch"]) Object.assign(get(`hand-${channel}`), { min: -tilt, max: tilt });
    Object.assign(get("hand-altitude"), { min: low, max: high });
    this.#show();
  }

  #show() {
    for (const channel of CHANNELS) {
      const text = `${this.asked[channel].toFixed(channel === "altitude" ? 2 : 1)}${UNITS[channel]}`;
      get(`hand-${channel}`).value = this.asked[channel];
      get(`hand-${channel}`).setAttribute("aria-valuetext", text);
      get(`hand-${channel}-value`).textContent = text;
    }
  }

  #say(text, isWrong = false) {
    const place = get("hand-say");
    if (place.textContent !== text) place.textContent = text;
    place.classList.toggle("wrong", isWrong);
  }

  start() {
    if (this.isOn || !this.operator) return;
    this.#last = performance.now();
    this.#timer = setInterval(() => this.#pass(), PERIOD_MS);
    get("hand-on").checked = true;
    this.#say("");
  }

  /** Lets go; `why`, if it was not the user who let go. */
  stop(why = "") {
    if (!this.isOn) return;
    clearInterval(this.#timer);
    this.#timer = null;
    this.#held.clear();
    get("hand-on").checked = false;
    this.#say(`${why}${why && " "}No more set points are sent: the run answers by its fallback, ${this.operator.fallback}.`, why !== "");
  }

  /** Moves what is asked for by sticks and keys, and asks. */
  #pass() {
    const now = performance.now();
    const seconds = Math.min((now - this.#last) / 1000, 0.1);
    this.#last = now;
    const pad = gamepad();
    get("hand-pad").textContent = pad ? `Gamepad: ${pad.id}` : "No gamepad: connect one, and press one of its buttons.";
    const sticks = Object.fromEntries(CHANNELS.map((channel) => [channel, pad?.sticks[channel] ?? 0]));
    for (const key of this.#held) sticks[KEYS[key][0]] = clamp(sticks[KEYS[key][0]] + KEYS[key][1], -1, 1);
    const { altitudes_m: [low, high], tilt_max_deg: tilt } = this.operator;
    for (const channel of ["roll", "pitch"]) {
      const isTilted = sticks[channel] !== 0;
      // A stick that is let go comes back to the middle; a slider stays where it is.
      if (isTilted || this.#wasTilted[channel]) this.asked[channel] = sticks[channel] * tilt;
      this.#wasTilted[channel] = isTilted;
    }
    this.asked.yaw = turned(this.asked.yaw + sticks.yaw * YAW_RATE_DEG_S * seconds);
    this.asked.altitude = clamp(this.asked.altitude + sticks.altitude * CLIMB_M_S * seconds, low, high);
    this.#show();
    this.#ask();
  }

  /** Asks for the newest values. One question at a time: a slow server gets no queue of old ones. */
  async #ask() {
    if (this.#isAsking) return;
    this.#isAsking = true;
    const { roll, pitch, yaw, altitude } = this.asked;
    try {
      await fly({ process: this.operator.process, altitude_m: altitude, roll_rad: radians(roll), pitch_rad: radians(pitch), yaw_rad: radians(yaw) });
      this.sent += 1;
    } catch (error) {
      this.stop(`${error.message}.`);
    }
    this.#isAsking = false;
  }

  #listen() {
    get("hand-on").addEventListener("change", ({ target }) => (target.checked ? this.start() : this.stop()));
    get("hand-process").addEventListener("change", () => this.#choose());
    get("hand-level").addEventListener("click", () => {
      Object.assign(this.asked, { roll: 0, pitch: 0 });
      this.#show();
    });
    for (const channel of CHANNELS) {
      get(`hand-${channel}`).addEventListener("input", ({ target }) => {
        this.asked[channel] = Number(target.value);
        this.#show();
      });
    }
    document.addEventListener("keydown", (event) => {
      const isTyping = event.target.closest("select, dialog[open], textarea, input:not([type=range], [type=checkbox])");
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (!this.isOn || isTyping || event.ctrlKey || event.altKey || event.metaKey || !KEYS[key]) return;
      event.preventDefault();
      this.#held.add(key);
    });
    document.addEventListener("keyup", (event) => this.#held.delete(event.key.length === 1 ? event.key.toLowerCase() : event.key));
    addEventListener("blur", () => this.#held.clear());
    // A browser slows down what is not seen.
    document.addEventListener("visibilitychange", () => document.hidden && this.stop("The page was hidden."));
    addEventListener("gamepaddisconnected", () => this.stop("The gamepad has gone."));
  }
}
