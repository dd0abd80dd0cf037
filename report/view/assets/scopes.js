// Scopes: fields over time, several to a plot, all plots over the same window.

import { curves } from "./api.js";
import { Feed } from "./feed.js";
import { curveColour, onTheme, pageColour } from "./palette.js";
import uPlot from "./vendor/uplot.min.js";

const HEIGHT = 150;
const CALM_MS = 60;
// While the overview is being made, it is asked for again.
const AGAIN_MS = 700;
const VALUES_MS = 150;
const DEGREES = 180 / Math.PI;
const SYNC = "hummingbus";
// A limit within so many spans of the curves is shown with them.
const LIMIT_REACH = 1.5;
// Distance at which a mark is under the pointer, and marks that are told of at once.
const NEAR_PX = 5;
const HINTS_MAX = 4;
// A take-over of the live run within this time of a planned swap is that swap.
const SAME_S = 0.05;
// A fault is a strip at the top of a plot, in which the pointer finds its text.
const FAULT_PX = 4;
const ROTORS_MAX = 12;

/** Unit and factor of a field as people read it: angles in degrees, rotor speeds in revolutions a minute. */
function readable({ path, unit }) {
  if (unit === "rad") return { unit: "deg", factor: DEGREES };
  if (unit !== "rad/s") return { unit, factor: 1 };
  return path.startsWith("rotor_speed") ? { unit: "rpm", factor: 30 / Math.PI } : { unit: "deg/s", factor: DEGREES };
}

/** A value with three digits if it is small, and with four otherwise: more are noise at rest. */
function shortened(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  return size >= 1e4 ? String(Math.round(value)) : Number(value.toPrecision(size < 0.1 ? 3 : 4)).toString();
}

/** The part of their paths that several fields share, such as `position` of its three coordinates; empty for none. */
function sharedPath(fields) {
  const [first, ...others] = new Set(fields.map((field) => field.replace(/(\.[^.]+|\[\d+\])$/, "")));
  return others.length || new Set(fields).size < 2 || fields.includes(first) ? "" : first;
}

const clipped = (text, length) => (text.length > length ? `${text.slice(0, length - 1)}…` : text);

/** The plots that a recording starts with. */
export function defaultPlots(recordings) {
  const [first] = recordings;
  const has = (recording, topic, field) => recording.topics.find(({ name }) => name === topic)?.fields.some(({ path }) => path === field);
  const plot = (topic, fields) => recordings.flatMap((recording, number) =>
    fields.filter((field) => has(recording, topic, field)).map((field) => ({ recording: number, topic, field })));
  const vehicle = first.vehicles[0];
  if (!vehicle) return first.topics.slice(0, 3).map(({ name, fields }) => plot(name, fields.slice(0, 3).map(({ path }) => path)));
  const { state, topics, shadows } = vehicle;
  const perRotor = (field) => Array.from({ length: ROTORS_MAX }, (_, index) => `${field}[${index}]`);
  const place = ["position.x", "position.y", "position.z"];
  const beams = [0, 1, 2, 3, 4].map((index) => `distance[${index}]`);
  return [
    [...plot(state, place), ...plot(topics.measured, place), ...plot(topics.status ?? topics.set_point, ["altitude_set_point", "altitude"])],
    plot(state, ["attitude.roll", "attitude.pitch", "attitude.yaw"]),
    topics.ranges ? plot(topics.ranges, beams) : plot(state, ["velocity.x", "velocity.y", "velocity.z"]),
    plot(state, perRotor("rotor_speed")),
    // A shadow of the controller is there to be compared: its commands beside those that flew.
    shadows.command ? [...plot(shadows.command.flown, perRotor("command")), ...plot(shadows.command.topic, perRotor("command"))] : [],
  ].filter((fields) => fields.length > 0);
}

/** One plot: its curves, and the names and values above them. */
class Plot {
  constructor(scopes, fields) {
    this.scopes = scopes;
    this.root = document.createElement("div");
    this.root.className = "plot";
    this.head = document.createElement("div");
    this.head.className = "plot-head";
    this.edit = Object.assign(document.createElement("button"), { type: "button", textContent: "Edit" });
    this.edit.addEventListener("click", () => scopes.edit(this));
    this.area = document.createElement("div");
    this.root.append(this.head, this.edit, this.area);
    this.set(fields);
  }

  set(fields) {
    const { recordings } = this.scopes;
    this.curves = fields.flatMap((field) => {
      const topic = recordings[field.recording]?.topics.find(({ name }) => name === field.topic);
      const known = topic?.fields.find(({ path }) => path === field.field);
      return known ? [{ ...field, ...readable(known) }] : [];
    });
    this.#colour();
    this.#heading();
    this.build();
  }

  /** Two curves of one field, such as measured and simulated, have one colour; the second is dashed. */
  #colour() {
    const twins = (curve) => this.curves.filter(({ field }) => field === curve.field);
    let colours = 0;
    for (const curve of this.curves) {
      const [first, second, third] = twins(curve);
      const isSecond = curve === second && third === undefined;
      curve.colour = isSecond ? first.colour : colours++;
      curve.isDashed = isSecond || curve.recording > 0;
    }
  }

  #heading() {
    const units = [...new Set(this.curves.map(({ unit }) => unit))];
    const topics = [...new Set(this.curves.map(({ topic }) => topic))];
    const { recordings } = this.scopes;
    // Names of recordings are long: the key has them once.
    const others = [...new Set(this.curves.map(({ recording }) => recording))].filter((recording) => recording > 0);
    const keys = others.map((recording) => Object.assign(document.createElement("span"), {
      className: "unit", textContent: `(${recording + 1}): ${clipped(recordings[recording].name, 40)}`,
    }));
    const paths = new Map(topics.map((topic) => [topic, sharedPath(this.curves.filter((curve) => curve.topic === topic).map(({ field }) => field))]));
    const names = new Map();
    this.values = this.curves.map((curve) => {
      const dash = document.createElement("span");
      dash.className = curve.isDashed ? "dash ghost" : "dash";
      dash.style.borderColor = curveColour(curve.colour);
      const value = Object.assign(document.createElement("span"), { className: "value" });
      const unit = units.length > 1 && curve.unit ? ` [${clipped(curve.unit, 16)}]` : "";
      const of = curve.recording > 0 ? `(${curve.recording + 1})` : "";
      // The values of one field of several recordings stand beside each other, under one name.
      const key = JSON.stringify([curve.topic, curve.field]);
      const known = names.get(key);
      const name = known ?? Object.assign(document.createElement("span"), { className: "name" });
      names.set(key, name);
      name.title = `${known ? `${name.title}, ` : `${curve.topic} ${curve.field} of `}${recordings[curve.recording].name}`;
      const field = curve.field.slice(paths.get(curve.topic).length).replace(/^\./, "");
      name.append(dash, ...[known ? "" : `${clipped(field, 60)}${unit}`, of].filter(Boolean), value);
      return { name, value, topic: curve.topic };
    });
    // A topic and the path that its fields share stand once, before them.
    const unit = units.length === 1 && units[0] ? ` [${clipped(units[0], 16)}]` : "";
    const groups = topics.flatMap((topic) => [
      Object.assign(document.createElement("span"), { className: "unit", textContent: `${[clipped(topic, 60), paths.get(topic)].join(" ").trim()}${unit}` }),
      ...new Set(this.values.filter((shown) => shown.topic === topic).map(({ name }) => name)),
    ]);
    this.head.replaceChildren(...groups, ...keys);
    this.edit.setAttribute("aria-label", `Edit the plot of ${this.curves.map(({ field }) => field).join(", ")}`);
  }

  /** Makes the drawing anew: for other curves, another width or other colours. */
  build() {
    this.drawing?.destroy();
    this.area.replaceChildren();
    const width = Math.floor(this.area.clientWidth || this.root.clientWidth - 14);
    if (width < 50) return;
    const { scopes } = this;
    const axis = { stroke: pageColour("faint"), grid: { stroke: pageColour("line"), width: 1 }, ticks: { stroke: pageColour("line"), width: 1 }, font: "11px system-ui" };
    const series = this.curves.map((curve) => ({
      stroke: curveColour(curve.colour), width: 1.25, dash: curve.isDashed ? [5, 4] : undefined, spanGaps: true, points: { show: false },
    }));
    const options = {
      width, height: HEIGHT, legend: { show: false }, padding: [8, 12, 0, 0],
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false, setScale: false }, points: { show: false } },
      scales: { x: { time: false, range: () => scopes.windowS() }, y: { range: (plot, low, high) => this.#range(low, high) } },
      axes: [{ ...axis, size: 26 }, { ...axis, size: 54 }],
      series: [{}, ...series],
      hooks: { draw: [(plot) => this.#marks(plot)], setSelect: [(plot) => this.#selected(plot)], setCursor: [(plot) => this.#point(plot)] },
    };
    this.hint = Object.assign(document.createElement("div"), { className: "mark-hint", hidden: true });
    this.drawing = new uPlot(options, [[], ...this.curves.map(() => [])], this.area);
    this.now = document.createElement("div");
    // A layer of its own: it moves with each frame, and the plot below it is not painted anew.
    this.now.style.cssText = `position:absolute;top:0;bottom:0;left:0;width:1px;pointer-events:none;will-change:transform;background:${pageColour("accent")}`;
    this.drawing.over.append(this.now, this.hint);
    this.drawing.over.addEventListener("dblclick", () => scopes.zoom(null));
    this.#clicks();
    this.#touches();
    this.bins = Math.max(Math.round((width - 66) / 1.5), 20);
  }

  /** A click that is no drag goes to its time. */
  #clicks() {
    const { over } = this.drawing;
    let downX = null;
    over.addEventListener("mousedown", (event) => (downX = event.clientX));
    over.addEventListener("click", (event) => {
      if (downX === null || Math.abs(event.clientX - downX) > 3) return;
      this.scopes.seekS(this.drawing.posToVal(event.clientX - over.getBoundingClientRect().left, "x"));
    });
  }

  /** A finger that goes along the plot zooms, as the mouse does; one that goes up or down scrolls the page. */
  #touches() {
    const { over } = this.drawing;
    let downX = null;
    const place = ({ clientX }) => clientX - over.getBoundingClientRect().left;
    const select = (left, width) => this.drawing.setSelect({ left, width, top: 0, height: over.clientHeight }, false);
    over.addEventListener("pointerdown", (event) => (downX = event.pointerType === "touch" && event.isPrimary ? place(event) : null));
    over.addEventListener("pointermove", (event) => {
      if (downX !== null) select(Math.min(downX, place(event)), Math.abs(place(event) - downX));
    });
    over.addEventListener("pointerup", () => {
      if (downX !== null) this.#selected(this.drawing);
      downX = null;
    });
    over.addEventListener("pointercancel", () => {
      downX = null;
      select(0, 0);
    });
  }

  #selected(plot) {
    const { left, width } = plot.select;
    if (width < 4) return;
    this.scopes.zoom([left, left + width].map((place) => plot.posToVal(place, "x")));
    plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  }

  /** The range of the values, with the limits that are not far from them. */
  #range(low, high) {
    if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
    const reach = LIMIT_REACH * Math.max(high - low, 0.02 * Math.max(Math.abs(low), Math.abs(high)));
    const near = this.#limits().map(({ value }) => value).filter((value) => value > low - reach && value < high + reach);
    const [least, most] = [Math.min(low, ...near), Math.max(high, ...near)];
    const room = 0.06 * (most - least) || 0.05 * Math.abs(most) || 1;
    return [least - room, most + room];
  }

  /** Limits of pass conditions on these curves within the window, in the curves' units. */
  #limits() {
    const [start, end] = this.scopes.windowS();
    return this.scopes.marks.flatMap((mark) => {
      const factor = mark.kind === "pass" ? this.#factorOf(mark) : null;
      const [fromS, toS] = [mark.from_s, mark.to_s ?? this.scopes.endS];
      if (factor === null || fromS > end || toS < start) return [];
      const limit = (bound, sign) => ({ mark, fromS, toS, value: mark[bound] * factor, text: `${mark.text || mark.statistic}: ${sign} ${mark[bound]} ${mark.unit}`.trim() });
      return [mark.min !== null && limit("min", "≥"), mark.max !== null && limit("max", "≤")].filter(Boolean);
    });
  }

  /** Draws limits of pass conditions on these fields, swaps, faults and missed deadlines. */
  #marks(plot) {
    const { ctx: context, bbox } = plot;
    const [x, y] = [(seconds) => plot.valToPos(seconds, "x", true), (value) => plot.valToPos(value, "y", true)];
    const [top, bottom] = [bbox.top, bbox.top + bbox.height];
    context.save();
    context.beginPath();
    context.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    context.clip();
    context.lineWidth = devicePixelRatio;
    context.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const { kind, from_s: from, to_s: to } of this.scopes.marks) {
      if (kind === "late") this.#stretch(context, [x(from), x(to)], [top, bottom]);
      if (kind === "fault") this.#strip(context, [x(from), x(to ?? this.scopes.endS)], top);
      if (kind === "swap") this.#line(context, pageColour("ink"), [x(from), top], [x(from), bottom]);
    }
    for (const { fromS, toS, value, text } of this.#limits()) {
      const place = y(value);
      this.#line(context, pageColour("warn"), [x(fromS), place], [x(toS), place]);
      // One that is far from the curves is told of at the edge.
      if (place < top || place > bottom) this.#edge(context, Math.max(x(fromS), bbox.left), place < top ? top : bottom, place < top, text);
    }
    context.restore();
  }

  /** A stretch of time, at least so wide that it is seen. */
  #stretch(context, [from, to], [top, bottom]) {
    context.fillStyle = pageColour("late");
    context.fillRect(from, top, Math.max(to - from, 2 * devicePixelRatio), bottom - top);
  }

  #strip(context, [from, to], top) {
    context.fillStyle = pageColour("warn");
    context.fillRect(from, top, to - from, FAULT_PX * devicePixelRatio);
  }

  #edge(context, left, place, isTop, text) {
    context.fillStyle = pageColour("warn");
    context.font = `${11 * devicePixelRatio}px system-ui`;
    context.textBaseline = isTop ? "top" : "bottom";
    context.fillText(`${isTop ? "▲" : "▼"} ${text}`, left + 4 * devicePixelRatio, place);
  }

  /** Says which mark is under the pointer. */
  #point(plot) {
    const { left, top } = plot.cursor;
    const isNear = (value, axis, place) => Math.abs(plot.valToPos(value, axis) - place) < NEAR_PX;
    const isIn = (from, to) => left >= plot.valToPos(from, "x") - NEAR_PX && left <= plot.valToPos(to, "x") + NEAR_PX;
    const isUnder = ({ kind, from_s: from, to_s: to }) =>
      kind === "fault" ? top <= FAULT_PX + NEAR_PX && isIn(from, to ?? this.scopes.endS) : kind !== "pass" && isIn(from, to ?? from);
    const timed = this.scopes.marks.filter(isUnder);
    const limits = this.#limits().filter(({ value, fromS, toS }) => isIn(fromS, toS) && isNear(value, "y", top));
    const texts = left < 0 ? [] : [...new Set([...timed.map(({ text }) => text), ...limits.map(({ text }) => text)])];
    this.hint.hidden = texts.length === 0;
    if (texts.length === 0) return;
    this.hint.textContent = texts.slice(0, HINTS_MAX).join("\n");
    const isLeft = left < plot.over.clientWidth / 2;
    Object.assign(this.hint.style, { left: isLeft ? `${left + 10}px` : "", right: isLeft ? "" : `${plot.over.clientWidth - left + 10}px` });
  }

  #line(context, colour, from, to) {
    context.strokeStyle = colour;
    context.beginPath();
    context.moveTo(...from);
    context.lineTo(...to);
    context.stroke();
  }

  /** From the unit of a condition to that of the curve it limits; null where no curve is of its field. */
  #factorOf({ recording, topic, field, unit }) {
    const curve = this.curves.find((other) => other.recording === recording && other.topic === topic && other.field === field);
    if (!curve) return null;
    if (unit === curve.unit) return 1;
    if (unit === "rad" && curve.unit === "deg") return DEGREES;
    return unit === "rad/s" && curve.unit === "deg/s" ? DEGREES : null;
  }

  /** Reads the curves of the window; the part of the recordings that was read for them. */
  async read(fromNs, toNs, signal) {
    if (!this.drawing || this.curves.length === 0) return 1;
    const { bins } = this;
    const numbers = [...new Set(this.curves.map(({ recording }) => recording))];
    let least = 1;
    const lines = this.curves.map(() => []);
    await Promise.all(numbers.map(async (recording) => {
      const mine = this.curves.map((curve, index) => ({ ...curve, index })).filter((curve) => curve.recording === recording);
      const fields = mine.map(({ topic, field }) => ({ topic, field }));
      const { values, read } = await curves({ recording, from_ns: fromNs, to_ns: toNs, bins, fields }, signal);
      least = Math.min(least, read);
      mine.forEach(({ index, factor }, place) => {
        const line = values.subarray(2 * bins * place, 2 * bins * (place + 1));
        lines[index] = Array.from(line, (value) => (Number.isNaN(value) ? null : value * factor));
      });
    }));
    const stepS = ((toNs - fromNs) * 1e-9) / bins;
    const startS = this.scopes.startS + fromNs * 1e-9;
    const times = Array.from({ length: 2 * bins }, (_, index) => startS + stepS * (Math.floor(index / 2) + (index % 2 ? 0.75 : 0.25)));
    this.drawing.setData([times, ...lines]);
    return least;
  }

  showTime(seconds) {
    if (!this.drawing) return;
    // A live run is ahead of the curves, which end with its recording.
    const end = this.scopes.newest ? this.scopes.windowS()[1] : Infinity;
    const place = this.drawing.valToPos(Math.min(seconds, end), "x");
    this.now.style.transform = `translateX(${place}px)`;
    // Not the width of the element: asking for it would lay out the page in each frame.
    this.now.hidden = !(place >= 0 && place <= this.drawing.bbox.width / devicePixelRatio);
  }

  showValues(rows, places) {
    this.curves.forEach((curve, index) => {
      const row = rows[curve.recording];
      // Those on their way follow.
      if (!row) return;
      const value = row[places(curve)];
      const text = shortened(value * curve.factor);
      if (this.values[index].value.textContent !== text) this.values[index].value.textContent = text;
    });
  }
}

export class Scopes {
  #timer = null;
  #running = null;
  #valuesAt = 0;
  // Some values are on their way, or have come too soon behind others.
  #isLate = false;
  /** Values of the live run ahead of its recording. */
  newest = null;

  constructor(recordings, playback, picker, plots, { report, changed, liveMarks = [] }) {
    Object.assign(this, { recordings, playback, picker, report, changed, liveMarks, window: null, list: document.getElementById("plots") });
    this.startS = recordings[0].start_s;
    this.endS = this.startS + playback.durationNs * 1e-9;
    this.plots = [];
    for (const fields of plots) this.#add(fields);
    this.#feeds();
    document.getElementById("add-plot").addEventListener("click", () => this.edit(null));
    document.getElementById("whole").addEventListener("click", () => this.zoom(null));
    this.#keys();
    onTheme(() => this.#rebuild());
    let width = this.list.clientWidth;
    new ResizeObserver(() => {
      if (this.list.clientWidth === width) return;
      width = this.list.clientWidth;
      this.#rebuild();
    }).observe(this.list);
    this.refresh();
  }

  /** Keys zoom as the mouse does. */
  #keys() {
    const keys = { z: ({ shiftKey }) => this.zoomBy(shiftKey ? 2 : 0.5), w: () => this.zoom(null) };
    document.addEventListener("keydown", (event) => {
      const key = event.key.toLowerCase();
      const isTyping = event.target.closest("select, dialog[open], textarea, input:not([type=range], [type=checkbox])");
      if (isTyping || event.ctrlKey || event.altKey || event.metaKey || !Object.hasOwn(keys, key)) return;
      event.preventDefault();
      keys[key](event);
    });
  }

  /** Marks of the recordings and of the live run; one that two recordings share is drawn once. */
  get marks() {
    const [first, ...others] = this.recordings;
    const texts = new Set(first.marks.map((mark) => JSON.stringify(mark)));
    const own = others.flatMap((recording, index) => recording.marks
      .filter((mark) => !texts.has(JSON.stringify(mark)))
      .map((mark) => ({ ...mark, recording: index + 1, text: `${mark.text} of ${recording.name}` })));
    // A swap of the manifest is a mark of the recording, too.
    const isPlanned = ({ process, from_s: from }) => first.marks.some((mark) => mark.text === `swap of ${process}` && Math.abs(mark.from_s - from) < SAME_S);
    return [...first.marks.map((mark) => ({ ...mark, recording: 0 })), ...own, ...this.liveMarks.filter((mark) => !isPlanned(mark))];
  }

  #add(fields) {
    const plot = new Plot(this, []);
    this.plots.push(plot);
    this.list.append(plot.root);
    plot.set(fields);
    return plot;
  }

  /** Opens the choice of fields for a plot; for a new one without. */
  edit(plot) {
    const chosen = plot?.curves.map(({ recording, topic, field }) => ({ recording, topic, field })) ?? [];
    this.picker.open(chosen, (fields) => {
      if (fields.length === 0) this.#remove(plot);
      else if (plot) plot.set(fields);
      else this.#add(fields);
      this.#feeds();
      this.refresh();
      this.changed(this.layout());
    });
  }

  /** Shows the plots of a layout; fields that the recordings lack are left out. */
  take(layout) {
    for (const plot of [...this.plots]) this.#remove(plot);
    for (const plot of layout) this.#add(plot.map(([recording, topic, field]) => ({ recording, topic, field })));
    for (const plot of this.plots.filter(({ curves: shown }) => shown.length === 0)) this.#remove(plot);
    this.report(this.plots.length ? "" : "The recording has no field of this layout.");
    this.#feeds();
    this.refresh();
    this.changed(this.layout());
  }

  #remove(plot) {
    if (!plot) return;
    plot.drawing?.destroy();
    plot.root.remove();
    this.plots.splice(this.plots.indexOf(plot), 1);
  }

  layout() {
    return this.plots.map(({ curves: shown }) => shown.map(({ recording, topic, field }) => [recording, topic, field]));
  }

  /** Feeds of the values at the time that is shown. */
  #feeds() {
    this.feeds = this.recordings.map((recording, number) => {
      const shown = this.plots.flatMap(({ curves: all }) => all).filter((curve) => curve.recording === number);
      const keys = [...new Map(shown.map(({ topic, field }) => [`${topic} ${field}`, { topic, field }])).values()];
      return new Feed(number, recording, keys, this.report);
    });
  }

  /** The recordings have come so far. */
  grow() {
    // A person who pauses looks at curves: they stand still until time goes on.
    if (this.playback.isPlaying || !this.playback.isGrowing) this.#showAll();
    for (const [number, feed] of this.feeds.entries()) feed.grow(this.recordings[number].duration_ns);
    this.refresh();
  }

  /** The plots reach to the end of what is there by now. */
  #showAll() {
    this.endS = this.startS + this.playback.durationNs * 1e-9;
  }

  windowS() {
    const [from, to] = this.window ?? [this.startS, this.endS];
    return to > from ? [from, to] : [from, from + 1e-3];
  }

  /** Shows a window of time, in seconds; all of it for null. */
  zoom(window) {
    if (window) {
      const [from, to] = [Math.max(window[0], this.startS), Math.min(window[1], this.endS)];
      if (to - from < 2e-9 * this.playback.tickNs) return;
      this.window = [from, to];
    } else {
      this.window = null;
    }
    document.getElementById("whole").disabled = this.window === null;
    this.refresh();
  }

  /** Shows `factor` of the window. The present time keeps its place in it; the middle does if that time is not in it. */
  zoomBy(factor) {
    const [from, to] = this.windowS();
    const nowS = this.#nowS();
    const span = (to - from) * factor;
    // Doubled halves may be the whole but for their rounding.
    if (span > (1 - 1e-9) * (this.endS - this.startS)) {
      this.zoom(null);
      return;
    }
    const fixedS = nowS >= from && nowS <= to ? nowS : (from + to) / 2;
    const start = fixedS - (fixedS - from) * factor;
    const first = Math.min(Math.max(start, this.startS), this.endS - span);
    this.zoom([first, first + span]);
  }

  #nowS() {
    return this.startS + this.playback.timeNs * 1e-9;
  }

  seekS(seconds) {
    this.playback.seek((seconds - this.startS) * 1e9);
  }

  #rebuild() {
    for (const plot of this.plots) plot.build();
    this.refresh();
  }

  /** Reads all curves anew, soon. */
  refresh(afterMs = CALM_MS) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#read(), afterMs);
  }

  async #read() {
    this.#running?.abort();
    this.#running = new AbortController();
    const { signal } = this.#running;
    const [from, to] = this.windowS();
    const [fromNs, toNs] = [Math.max(Math.round((from - this.startS) * 1e9), 0), Math.round((to - this.startS) * 1e9) + 1];
    try {
      const parts = await Promise.all(this.plots.map((plot) => plot.read(fromNs, toNs, signal)));
      const read = Math.min(1, ...parts);
      this.report(read < 1 ? `Reading the recording: ${Math.floor(100 * read)} %` : "");
      if (read < 1) this.refresh(AGAIN_MS);
      this.isDrawn = true;
      this.showTime();
    } catch (error) {
      if (error.name !== "AbortError") this.report(error.message);
    }
  }

  /** Moves the line of time, and the window where it runs out of it. */
  showTime() {
    const seconds = this.#nowS();
    // The time that is shown has left plots that stood still. The newest samples are ahead of the curves.
    if (!this.newest && seconds > this.endS) {
      this.#showAll();
      this.refresh();
    }
    if (this.window && this.playback.isPlaying && (seconds > this.window[1] || seconds < this.window[0])) {
      const span = this.window[1] - this.window[0];
      this.zoom([seconds, seconds + span]);
    }
    for (const plot of this.plots) plot.showTime(seconds);
    this.#showValues();
  }

  /** Shows values that have come since the last call of `showTime`. */
  showLate() {
    if (this.#isLate) this.#showValues();
  }

  #showValues() {
    const now = performance.now();
    if (this.playback.isPlaying && now - this.#valuesAt < VALUES_MS) {
      this.#isLate = true;
      return;
    }
    const still = { timeNs: this.playback.timeNs, isPlaying: false };
    const rowOf = (feed) => (feed.fields.length > 0 ? feed.row(still)?.values : undefined);
    const rows = this.newest ? [this.newest.values] : this.feeds.map(rowOf);
    this.#isLate = rows.some((row, number) => !row && this.feeds[number].fields.length > 0);
    this.#valuesAt = now;
    for (const plot of this.plots) {
      plot.showValues(rows, ({ recording, topic, field }) =>
        this.feeds[recording].fields.findIndex((other) => other.topic === topic && other.field === field));
    }
  }
}
