// The tick of a live run as planned beside the tick as it goes: a row for each process, in the order in which they compute.

import { schedule } from "./api.js";

const PERIOD_MS = 1000;
// Ends of the axis of the bars, µs: a few, so that the bars of two seconds are comparable.
const AXES_US = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000];

const get = (id) => document.getElementById(id);
const number = (value, digits = 1) => (value === null || value === undefined ? "–" : value.toFixed(digits));

/** Number of each node in the order of the tick: that of the longest chain of samples of the same tick that ends in it. */
export function orders(nodes) {
  const found = nodes.map(() => null);
  const of = (index) => {
    if (found[index] === null) {
      found[index] = 0;
      found[index] = nodes[index].after.reduce((most, before) => Math.max(most, of(before) + 1), 0);
    }
    return found[index];
  };
  return nodes.map((_, index) => of(index));
}

/** Start of each node's computation, µs, if samples took no time between processes: a group and a core do one thing at a time. */
export function starts(nodes, order) {
  const ends = nodes.map(() => 0);
  const free = new Map();
  const begun = nodes.map(() => 0);
  const inOrder = nodes.map((_, index) => index).sort((a, b) => order[a] - order[b] || a - b);
  for (const index of inOrder) {
    const { group, core, after, seen } = nodes[index];
    const shared = [group !== null && `group ${group}`, core !== null && `core ${core}`].filter(Boolean);
    begun[index] = Math.max(0, ...after.map((before) => ends[before]), ...shared.map((place) => free.get(place) ?? 0));
    ends[index] = begun[index] + (seen.step_p50_us ?? 0);
    for (const place of shared) free.set(place, ends[index]);
  }
  return { begun, ends };
}

export class Schedule {
  #isOver;
  #rows = [];
  #isAsking = false;

  /** `isOver` says that the run has ended. */
  constructor(isOver) {
    this.#isOver = isOver;
    get("schedule").addEventListener("toggle", () => this.#look());
    setInterval(() => this.#look(), PERIOD_MS);
  }

  async #look() {
    const isSeen = get("schedule").open && !document.hidden;
    if (!isSeen || this.#isAsking || (this.#isOver() && this.#rows.length > 0)) return;
    this.#isAsking = true;
    try {
      const found = await schedule();
      if (found) this.#show(found);
      else get("schedule-facts").textContent = "The run is starting, or has no control segment.";
    } catch (error) {
      get("schedule-facts").textContent = error.message;
    }
    this.#isAsking = false;
  }

  #show({ tick_us: tickUs, pace, real_time_factor: factor, clock, nodes }) {
    const order = orders(nodes);
    const { begun, ends } = starts(nodes, order);
    const last = Math.max(...ends, ...nodes.map(({ seen }, index) => begun[index] + (seen.step_p99_us ?? 0)));
    const axisUs = AXES_US.find((end) => end >= last) ?? last;
    const chain = number(Math.max(...ends));
    const free = factor > 0 ? `A tick takes ${number(tickUs / factor)} µs of host time` : "No tick went by in the last second";
    const whole = pace === "free" ? free : `A tick has ${number(tickUs / (Number(pace) || 1))} µs of host time`;
    get("schedule-facts").textContent = `${whole}; the longest chain of computations in it takes ${chain} µs. Clock: core ${clock.core ?? "any"}, ${clock.seen?.state ?? ""}.`;
    get("schedule-axis").textContent = `Computation, 0 to ${axisUs} µs`;
    const inOrder = nodes.map((_, index) => index).sort((a, b) => order[a] - order[b] || a - b);
    if (this.#rows.length !== nodes.length) this.#make(nodes.length);
    inOrder.forEach((index, place) => this.#fill(this.#rows[place], nodes[index], order[index], begun[index], axisUs, nodes));
  }

  #make(count) {
    this.#rows = Array.from({ length: count }, () => {
      const row = document.createElement("tr");
      const name = Object.assign(document.createElement("th"), { scope: "row" });
      const cells = Array.from({ length: 11 }, () => document.createElement("td"));
      const [bar, tail] = ["bar", "tail"].map((className) => Object.assign(document.createElement("div"), { className }));
      cells[5].className = "lane";
      cells[5].append(tail, bar);
      for (const cell of [cells[0], cells[2], cells[3], ...cells.slice(6, 10)]) cell.className = "number";
      row.append(name, ...cells);
      return { row, name, cells, bar, tail };
    });
    get("schedule-rows").replaceChildren(...this.#rows.map(({ row }) => row));
  }

  #fill({ row, name, cells, bar, tail }, node, order, begunUs, axisUs, nodes) {
    const { seen } = node;
    const awaited = node.after.map((index) => nodes[index].name);
    name.textContent = node.name;
    row.title = awaited.length ? `waits for ${awaited.join(", ")} of the same tick` : "waits for no sample of the same tick";
    const planned = [order + 1, node.group ?? "own process", node.core ?? "any", node.period_ticks, node.computing_time ?? "–"];
    planned.forEach((value, index) => (cells[index].textContent = value));
    const median = seen.step_p50_us ?? 0;
    Object.assign(bar.style, { left: `${(100 * begunUs) / axisUs}%`, width: `${(100 * median) / axisUs}%` });
    Object.assign(tail.style, { left: `${(100 * begunUs) / axisUs}%`, width: `${(100 * Math.max(seen.step_p99_us ?? 0, median)) / axisUs}%` });
    const going = [number(seen.step_p50_us), number(seen.step_p99_us), number(seen.cpu_share === null ? null : seen.cpu_share * 100, 0), seen.late, seen.state];
    going.forEach((value, index) => (cells[6 + index].textContent = value));
  }
}
