// The live run: its state as the server tells it, and its controls.

import { ask, described, GONE } from "./api.js";
import { Hand } from "./hand.js";
import { Schedule } from "./schedule.js";

/** Paces that are offered beside the present one: the words of `hummingbus ctl pace`. */
const PACES = ["0.1", "0.25", "0.5", "realtime", "2", "5", "10", "free"];
const STEP_MANY = 100;
// Simulated time between two missed deadlines of one stretch.
const STRETCH_S = 1;
// Time between two writings of the tick of a run that flies: each lays out the page.
const TICK_MS = 500;
// States in which a run takes no more requests.
const OVER = ["ended", "stopping"];

const get = (id) => document.getElementById(id);
const option = (value) => Object.assign(document.createElement("option"), { value, textContent: /\d/.test(value) ? `×${value}` : value });
const ticksText = (ticks) => (ticks === 1 ? "1 tick" : `${ticks} ticks`);

/** The answer of a run in words; each warning begins a line. */
const words = ({ answer, text, reason, warnings = [] }) =>
  [answer === "done" ? text : `Refused: ${reason}`, ...warnings.map((warning) => `warning: ${warning}`)].join("\n");

/** Hears the server for as long as the page is open, and calls `heard` with each of its events. */
export function hear(heard, report) {
  const source = new EventSource("api/events");
  source.addEventListener("message", (event) => {
    report("");
    heard(JSON.parse(event.data));
  });
  // It tries again by itself.
  source.addEventListener("error", () => report(GONE));
  addEventListener("pagehide", () => source.close());
}

export class RunControls {
  #heardPace = [];
  #writtenMs = -Infinity;

  constructor() {
    /** Marks on the axis of time that no recording has: take-overs, and missed deadlines. */
    this.marks = [];
    this.status = null;
    this.facts = null;
    this.hand = new Hand();
    this.schedule = new Schedule(() => this.isOver);
    this.asking = 0;
    this.#listen();
    this.#listenToDialogs();
    this.#listenToKeys();
  }

  /** Calls `hear` with the pace of the run, and with each other one that it has later. */
  onPace(hear) {
    this.#heardPace.push(hear);
    if (this.status) hear(this.status.pace);
  }

  /** Takes the state of the run; null where there is none, or none that can be steered. */
  async take(status, takeOvers) {
    const before = this.status;
    this.status = status;
    get("run").hidden = status === null;
    if (status === null) return;
    if (before && before.state !== "ended") this.#sayEnd();
    this.#markLate(before);
    this.#markTakeOvers(takeOvers);
    if (before?.pace !== status.pace) {
      this.#choosePace(status.pace);
      for (const hear of this.#heardPace) hear(status.pace);
    }
    this.#show(before);
    if (OVER.includes(status.state)) this.hand.stop("The run has ended.");
    // A node that is starting may not yet say that it can be flown by hand.
    if (this.facts === null && status.state !== "starting") {
      this.facts = {};
      this.facts = await described();
      const { processes, operators } = this.facts;
      this.hand.learn(operators);
      get("swap-process").replaceChildren(...processes.map((name) => Object.assign(document.createElement("option"), { textContent: name })));
    }
  }

  /** Marks the time since the state `before`, if a deadline was missed in it; misses that follow each other have one mark. */
  #markLate(before) {
    const { missed_deadlines: missed, time_s: timeS } = this.status;
    if (!before || !(missed > before.missed_deadlines) || timeS <= before.time_s) return;
    const last = this.marks.findLast(({ kind }) => kind === "late");
    const isSame = last && before.time_s - last.to_s < STRETCH_S;
    const mark = isSame ? last : { kind: "late", from_s: before.time_s, count: 0 };
    mark.count += missed - before.missed_deadlines;
    Object.assign(mark, { to_s: timeS, text: `${mark.count} ${mark.count === 1 ? "deadline" : "deadlines"} missed` });
    if (!isSame) this.marks.push(mark);
  }

  get isOver() {
    return this.status === null || OVER.includes(this.status.state);
  }

  get isHeld() {
    return ["paused", "pausing", "stepping"].includes(this.status?.state);
  }

  /** Says that the run has ended, if it has: that is the last word on whatever it was asked for. */
  #sayEnd() {
    if (this.status?.state !== "ended") return;
    Object.assign(get("run-answer"), { textContent: `The run has ended at tick ${this.status.tick}.`, className: "" });
  }

  #choosePace(pace) {
    const paces = PACES.includes(pace) ? PACES : [pace, ...PACES];
    get("run-pace").replaceChildren(...paces.map(option));
    get("run-pace").value = pace;
  }

  #show(before) {
    const nowMs = performance.now();
    if (before?.state === "running" && this.status.state === "running" && nowMs - this.#writtenMs < TICK_MS) return;
    this.#writtenMs = nowMs;
    const { state, tick, end_tick: endTick, time_s: timeS, missed_deadlines: missed } = this.status;
    const chip = get("run-state");
    if (chip.textContent !== state) {
      chip.textContent = state;
      chip.dataset.state = state;
    }
    const late = missed ? ` · ${missed} ${missed === 1 ? "deadline" : "deadlines"} missed` : "";
    get("run-tick").textContent = `tick ${tick} of ${endTick} · ${timeS.toFixed(3)} s${late}`;
    get("run-pause").textContent = this.isHeld ? "Go on" : "Pause";
    for (const id of ["run-pause", "run-step", "run-ticks", "run-pace", "run-swap", "run-stop"]) get(id).disabled = this.isOver;
  }

  /** Asks the run, and shows its answer in words; true if it has done what it was asked for. */
  async ask(request, doing, place = get("run-answer")) {
    const say = (text, isWrong) => {
      place.textContent = text;
      place.classList.toggle("wrong", isWrong);
    };
    this.asking += 1;
    const number = this.asking;
    say(doing, false);
    try {
      const answer = await ask(request);
      const isDone = answer.answer === "done";
      // A later request has the place by now.
      if (number === this.asking || !isDone) say(words(answer), !isDone);
      // The news of the end may have come before.
      if (isDone) this.#sayEnd();
      return isDone;
    } catch (error) {
      say(error.message, true);
      return false;
    }
  }

  /** Marks each process that has taken over: by a swap of anybody, as a standby, or started again. */
  #markTakeOvers(takeOvers) {
    const marked = this.marks.filter(({ kind }) => kind === "swap").length;
    for (const { process, generation, time_s: timeS } of takeOvers.slice(marked)) {
      this.marks.push({ kind: "swap", process, from_s: timeS, text: `${process}.${generation} takes over` });
    }
  }

  toggle() {
    if (this.isHeld) this.ask({ request: "resume" }, "going on…");
    else this.ask({ request: "pause" }, "pausing…");
  }

  step(ticks) {
    const isNumber = Number.isInteger(ticks) && ticks >= 1 && ticks < 2 ** 32;
    if (isNumber) this.ask({ request: "step", ticks }, `stepping ${ticksText(ticks)}…`);
    else Object.assign(get("run-answer"), { textContent: "Refused: the number of ticks to step is to be a whole number of at least 1", className: "wrong" });
  }

  pace(pace) {
    this.ask({ request: "pace", pace }, `changing the pace to ${pace}…`);
  }

  #listen() {
    get("run-pause").addEventListener("click", () => this.toggle());
    get("run-step").addEventListener("click", () => this.step(Number(get("run-ticks").value)));
    get("run-ticks").addEventListener("keydown", ({ key }) => key === "Enter" && get("run-step").click());
    get("run-pace").addEventListener("change", ({ target }) => this.pace(target.value));
    get("run-swap").addEventListener("click", () => this.#openSwap());
    get("run-stop").addEventListener("click", () => get("stop").showModal());
  }

  #openSwap() {
    get("swap-answer").textContent = "";
    get("swap").showModal();
  }

  #listenToDialogs() {
    get("stop-no").addEventListener("click", () => get("stop").close());
    get("stop-yes").addEventListener("click", () => {
      get("stop").close();
      this.ask({ request: "stop" }, "stopping…");
    });
    get("swap-no").addEventListener("click", () => get("swap").close());
    get("swap-form").addEventListener("submit", async (event) => {
      event.preventDefault();
      const number = (id) => (get(id).value === "" ? null : Number(get(id).value));
      const [process, answer] = [get("swap-process").value, get("swap-answer")];
      const request = { request: "swap", process, with: get("swap-with").value, shadow_ticks: number("swap-shadow"), at_tick: number("swap-at") };
      get("swap-yes").disabled = true;
      const isDone = await this.ask(request, `swapping ${process}…`, answer);
      get("swap-yes").disabled = false;
      if (!isDone) return;
      get("swap").close();
      Object.assign(get("run-answer"), { textContent: answer.textContent, className: "" });
    });
  }

  #listenToKeys() {
    const keys = {
      p: () => this.toggle(),
      s: () => this.step(1),
      S: () => this.step(STEP_MANY),
      f: () => this.pace("free"),
      r: () => this.pace("realtime"),
      x: () => get("stop").showModal(),
    };
    document.addEventListener("keydown", (event) => {
      const isTyping = event.target.closest("select, dialog[open], textarea, input:not([type=range], [type=checkbox])");
      if (isTyping || this.isOver || event.repeat || event.ctrlKey || event.altKey || event.metaKey || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }
}
