// Draws the identification that the page holds as JSON.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const report = data.report;

// Distinguishable also without colour vision (Okabe and Ito).
const COLOURS = { measured: "#8a8f94", before: "#e69f00", after: "#0072b2", noise: "#1a1a1a" };
const NAMES = { before: "declared", after: "new" };
// Named one by one, since plotly.js would add one that sends the data away.
const BUTTONS = ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"];
const CONFIG = { responsive: true, displaylogo: false, plotlyServerURL: "", modeBarButtons: [BUTTONS] };
const AXIS = { exponentformat: "none", automargin: true, gridcolor: "#e6e6e6", zerolinecolor: "#999" };
const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

const element = (id) => document.getElementById(id);
const raised = (text) => [...String(text)].map((sign) => SUPERSCRIPTS[sign]).join("");
// A pure number has none.
const withUnit = (text) => (text === "1" ? "" : text.replace(/\^(-?\d+)/g, (_, exponent) => raised(exponent)).replaceAll("*", "·"));
const words = (name) => name.replaceAll("_", " ");
const list = (items) => items.join(", ") || "–";

function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-4 && size < 10 ** digits) return value.toPrecision(digits).replace("-", "−");
  if (size >= 10 ** digits && size < 1e7) return value.toFixed(0).replace("-", "−");
  const [mantissa, exponent] = value.toExponential(3).split("e");
  return `${mantissa.replace("-", "−")}·10${raised(Number(exponent))}`;
}

function change(before, after) {
  const percent = 100 * (after / before - 1);
  if (!Number.isFinite(percent)) return "–";
  const size = Math.abs(percent).toFixed(Math.abs(percent) < 10 ? 1 : 0);
  const sign = Number(size) === 0 ? "" : percent > 0 ? "+" : "−";
  return `${sign}${size} %`;
}

// Of 20 000 resampled flights not one may undo a gain.
const chance = (value) => (value < 1e-4 ? "< 0.0001" : value.toFixed(4));

// A cell is text, or {text, words, long, span}: words are set to the left, long ones are broken.
function addRow(table, tag, cells, className = "") {
  const row = table.insertRow();
  row.className = className;
  for (const cell of cells) {
    const { text = cell, words: isWords, long: isLong, span = 1 } = cell;
    const field = document.createElement(tag);
    field.textContent = text;
    field.className = isLong ? "long" : isWords ? "words" : "";
    field.colSpan = span;
    row.append(field);
  }
}

const left = (text) => ({ text, words: true });
const long = (text, span = 1) => ({ text, long: true, span });

function addItem(id, text) {
  const item = document.createElement("li");
  item.textContent = text;
  element(id).append(item);
}

const accepted = report.verdict.map((name) => [name, report.effects[name]]).filter(([, effect]) => effect);

const doubt = ({ determined, at_bound }) => (!determined ? ", not determined by these flights" : at_bound ? ", at its bound" : "");

function estimateText(name, own) {
  const { value, unit, low, high } = own;
  return `${words(name)} = ${`${number(value)} ${withUnit(unit)}`.trim()} (95 %: ${number(low)} to ${number(high)}${doubt(own)})`;
}

function drawSummary() {
  const vehicle = report.vehicle.split(/[\\/]/).pop().replace(/\.toml$/, "");
  element("title").textContent = `${vehicle}: what flights show beyond the declared model`;
  const undecided = `Undecided: the flights to test on have ${report.test_blocks} blocks of ${report.block_s} s, and with less than a dozen nothing is beyond chance.`;
  element("verdict").textContent = report.verdict.length
    ? `The flights ask for ${report.verdict.join(", ")}.`
    : report.test_blocks < 12 ? undecided : "The flights ask for nothing: no effect makes the prediction of flights that nothing was fitted on better beyond chance.";
  for (const [name, effect] of accepted) {
    const estimates = Object.entries(effect.parameters).map(([parameter, own]) => estimateText(parameter, own));
    const rivals = effect.confused_with.length ? `; cannot be told from ${effect.confused_with.join(", ")} here` : "";
    addItem("findings", `${name}: ${estimates.join("; ")}${rivals}.`);
  }
  for (const fault of report.faults) addItem("findings", `Fault, ${fault.channel} (${fault.kind}): ${fault.finding}; ${fault.consequence}.`);
  if (report.trims.length) addItem("findings", "The flights differ in trim; their mean torques were left out.");
  for (const [name, own] of Object.entries(report.unexplained)) {
    addItem("findings", `Unexplained, ${words(name)}: ${number(own.rms)} ${withUnit(own.unit)} are neither noise nor any ` +
      `effect's (${number(own.before)} ${withUnit(own.unit)} with the declared model).`);
  }
  for (const { effect, needs } of report.not_identifiable) addItem("findings", `Cannot be seen here: ${effect}. It needs ${needs}.`);
}

function drawFlights() {
  const table = element("flights");
  addRow(table, "th", [left("flight"), left("used to"), "compared [s]", "windows [s]", left("equations")]);
  for (const flight of report.flights) {
    const equations = long(list(flight.equations.map(words)));
    addRow(table, "td", [left(flight.name), left(flight.role), flight.compared_s.toFixed(1), flight.window_s.toFixed(3), equations]);
  }
  drawNotes();
}

// What the reader noticed; what holds for several flights is said once.
function drawNotes() {
  const flightsOf = new Map();
  for (const flight of report.flights) {
    for (const note of [...flight.assumed.map((own) => `assumed: ${own}`), ...flight.notes]) {
      flightsOf.set(note, [...(flightsOf.get(note) ?? []), flight.name]);
    }
  }
  for (const [note, names] of flightsOf) {
    const of = names.length === report.flights.length && names.length > 1 ? "all flights" : names.join(", ");
    addItem("notes", `${of}: ${note.replaceAll("`", "")}`);
  }
}

function drawClocks() {
  const offsets = Object.entries(report.time_offsets_s).flatMap(([flight, own]) =>
    Object.entries(own).filter(([, offset]) => offset).map(([channel, offset]) => ({ flight, channel, ...offset })));
  element("clocks-part").hidden = !offsets.length;
  addRow(element("clocks"), "th", [left("flight"), left("channel"), "late by [ms]", "95 % interval [ms]", "taken off [ms]"]);
  const ms = (value) => number(1e3 * value);
  offsets.forEach(({ flight, channel, value, low, high, taken_off }, index) => {
    const isFirst = flight !== offsets[index - 1]?.flight;
    const cells = [ms(value), `${ms(low)} to ${ms(high)}`, ms(taken_off)];
    addRow(element("clocks"), "td", [left(isFirst ? flight : ""), left(channel), ...cells], isFirst ? "first" : "");
  });
}

function drawFaults() {
  element("faults-part").hidden = !report.faults.length;
  addRow(element("faults"), "th", ["channel", "kind", "finding", "consequence"].map(left));
  for (const fault of report.faults) addRow(element("faults"), "td", [left(fault.channel), left(fault.kind), long(fault.finding), long(fault.consequence)]);
  element("trims-part").hidden = !report.trims.length;
  addRow(element("trims"), "th", [left("flight"), "roll", "pitch", "yaw"]);
  for (const trim of report.trims) {
    const deviations = trim.deviation_rad_s2;
    const values = trim.angular_acceleration_rad_s2.map((own, axis) => `${number(own)} ± ${deviations[axis].toPrecision(2)}`);
    addRow(element("trims"), "td", [left(trim.flight), ...values]);
  }
}

// One row per parameter; the effect stands in the first.
function drawEffect(table, name, effect) {
  const kind = effect.accepted ? "" : "left-out";
  const { before, after } = effect.held_out;
  const own = [number(before), number(after), change(before, after), chance(effect.chance), long(list(effect.confused_with))];
  const judged = effect.accepted ? "yes" : effect.linearised ? "no, linearised" : "no";
  const parameters = Object.entries(effect.parameters);
  parameters.forEach(([parameter, { value, unit, low, high }], index) => {
    const label = [words(parameter), withUnit(unit) && `[${withUnit(unit)}]`].join(" ");
    const cells = [left(label), number(value), `${number(low)} to ${number(high)}`];
    const figures = index ? ["", "", "", "", ""] : own;
    const heads = index ? [left(""), left("")] : [left(name), left(judged)];
    addRow(table, "td", [...heads, ...cells, ...figures], index ? kind : `first ${kind}`);
  });
  if (effect.experiment) addRow(table, "td", [left(""), left(""), long(`To tell it from ${effect.confused_with[0]}: ${effect.experiment}.`, 8)], kind);
}

function drawEffects() {
  const table = element("effects");
  addRow(table, "th", [left("effect"), left("accepted"), left("parameter"), "estimate", "95 % interval",
    "without", "with", "change", "chance", left("cannot be told from")]);
  for (const [name, effect] of accepted) drawEffect(table, name, effect);
  const others = Object.entries(report.effects).filter(([, effect]) => !effect.accepted);
  others.sort(([, a], [, b]) => a.held_out.after / a.held_out.before - b.held_out.after / b.held_out.before);
  for (const [name, effect] of others) drawEffect(table, name, effect);
}

const CHANNELS = ["position", "velocity", "attitude", "rates"];
const horizons = (flights) => [...new Set(Object.values(flights).flatMap(Object.keys))].sort((a, b) => a - b);
const floorOf = (channel, horizon) => report.noise_floor[channel]?.prediction[horizon];

function fillErrors(id, flights) {
  const table = element(id);
  const onBus = data.bus ? ["declared, on the bus", "new, on the bus"] : [];
  addRow(table, "th", [left("flight"), "horizon [s]", left("channel"), "declared", "new", left("unit"), "change", "by noise alone", ...onBus]);
  for (const [flight, own] of Object.entries(flights)) {
    let isFirst = true;
    for (const horizon of horizons({ own })) {
      for (const channel of CHANNELS.filter((name) => own[horizon][name])) {
        const { before, after, unit } = own[horizon][channel];
        const cells = [horizon, left(channel), number(before), number(after), left(withUnit(unit)), change(before, after), number(floorOf(channel, horizon))];
        const flown = data.bus?.flights[flight]?.[horizon]?.[channel];
        if (data.bus) cells.push(number(flown?.before), number(flown?.after));
        addRow(table, "td", [left(isFirst ? flight : ""), ...cells], isFirst ? "first" : "");
        isFirst = false;
      }
    }
  }
}

// The errors of one channel at one horizon, flight by flight; a line where noise alone would put them.
function drawBars(channel, horizon) {
  const plot = document.createElement("div");
  plot.className = "small";
  element("errors").append(plot);
  const rows = Object.entries(report.held_out).filter(([, own]) => own[horizon]?.[channel]);
  const unit = withUnit(rows[0][1][horizon][channel].unit);
  const bars = ["before", "after"].map((model) => ({
    type: "bar", name: NAMES[model], marker: { color: COLOURS[model] },
    x: rows.map(([flight]) => flight), y: rows.map(([, own]) => own[horizon][channel][model]),
    // Beside a great error a small one is no bar to be seen.
    text: rows.map(([, own]) => number(own[horizon][channel][model], 3)), textposition: "outside", cliponaxis: false,
    hovertemplate: `%{x}<br>${NAMES[model]}: %{y:.4~g} ${unit}<extra></extra>`,
  }));
  const floor = floorOf(channel, horizon);
  const line = { type: "line", xref: "paper", x0: 0, x1: 1, y0: floor, y1: floor, line: { color: COLOURS.noise, width: 1.5, dash: "dot" } };
  const layout = {
    title: heading(`${channel} after ${horizon} s`), showlegend: false, shapes: floor === undefined ? [] : [line],
    xaxis: { automargin: true, tickangle: 0, showticklabels: rows.length < 5 },
    yaxis: { ...AXIS, title: { text: unit }, rangemode: "tozero", nticks: 5 },
    margin: { l: 52, r: 8, t: 30, b: 24 }, bargap: 0.3,
  };
  Plotly.newPlot(plot, bars, layout, { ...CONFIG, displayModeBar: false });
}

function drawErrors() {
  addMarks("errors-legend", [["before", "declared"], ["after", "new"], ["noise", "what noise alone makes (dotted)"]]);
  const all = Object.values(report.held_out);
  for (const channel of CHANNELS) {
    for (const horizon of horizons(report.held_out)) {
      if (all.some((own) => own[horizon]?.[channel])) drawBars(channel, horizon);
    }
  }
  fillErrors("held-out", report.held_out);
  fillErrors("fitted", report.fitted);
}

function drawNoise() {
  const ahead = horizons(report.held_out);
  addRow(element("noise"), "th", [left("channel"), "deviation", left("unit"), ...ahead.map((horizon) => `error after ${horizon} s`), left("unit")]);
  const units = Object.fromEntries(Object.values(report.held_out).flatMap(Object.values).flatMap(Object.entries).map(([channel, own]) => [channel, own.unit]));
  for (const [channel, own] of Object.entries(report.noise_floor)) {
    const errors = ahead.map((horizon) => number(own.prediction[horizon]));
    addRow(element("noise"), "td", [left(words(channel)), number(own.value), left(withUnit(own.unit)), ...errors, left(withUnit(units[channel] ?? ""))]);
  }
}

function drawWhiteness() {
  const table = element("whiteness");
  addRow(table, "th", [left("equation"), left("model"), "RMS", "common to neighbours", left("unit"), "beyond bound", "p"]);
  for (const name of Object.keys(report.whiteness.before)) {
    for (const model of ["before", "after"]) {
      const own = report.whiteness[model][name];
      const p = own.p_value < 1e-4 ? "< 0.0001" : own.p_value.toFixed(4);
      const cells = [number(own.rms), number(own.persistent), left(withUnit(own.unit)), `${(100 * own.beyond_bound).toFixed(0)} %`, p];
      const isFirst = model === "before";
      addRow(table, "td", [left(isFirst ? words(name) : ""), left(NAMES[model]), ...cells], isFirst ? "first" : "");
    }
  }
}

function addMarks(id, marks) {
  for (const [key, name] of marks) {
    const [mark, label] = ["mark", "label"].map((kind) => Object.assign(document.createElement("span"), { className: kind }));
    mark.style.background = COLOURS[key];
    label.append(mark, name);
    element(id).append(label, " ");
  }
}

function heading(text) {
  return { text, x: 0, xanchor: "left", font: { size: 14 } };
}

function layoutOf(title, x, y) {
  return {
    title: heading(title), showlegend: false, hovermode: "closest",
    xaxis: { ...AXIS, title: { text: x } }, yaxis: { ...AXIS, title: { text: y } },
    margin: { l: 64, r: 12, t: 36, b: 48 },
  };
}

// What is chosen: a flight, an equation of it, a component of that, and what it is looked at against.
function chosen() {
  const flight = data.flights[element("flight").value];
  const equation = flight.equations[element("equation").value];
  const component = equation.components[element("component").value];
  const measured = { name: `measured ${equation.name}`, unit: equation.unit, cloud: component.cloud.measured };
  const inputs = [measured, ...flight.inputs];
  const at = Math.min(element("input").value, inputs.length - 1);
  const windowS = report.flights.find((own) => own.name === flight.name).window_s;
  return { flight, equation, component, unit: withUnit(equation.unit), inputs, input: inputs[at], cross: component.cross[at], windowS };
}

// The curve with nothing between two points that have a gap between them.
function broken(values, breaks) {
  const parts = values.slice();
  for (const at of [...breaks].reverse()) parts.splice(at, 0, null);
  return parts;
}

function line(curve, key, values, width) {
  const [x, y] = [curve.time, values].map((own) => broken(own, curve.breaks));
  return { mode: "lines", name: NAMES[key] ?? key, x, y, line: { color: COLOURS[key], width }, hovertemplate: "%{x:.3f} s: %{y:.4~g}" };
}

function cloud(x, y, key, hover) {
  return { mode: "markers", name: NAMES[key], x, y, marker: { color: COLOURS[key], size: 4, opacity: 0.5 }, hovertemplate: hover };
}

function drawOverTime({ equation, component, unit }) {
  const { curve } = component;
  const models = ["before", "after"];
  const label = `${equation.name}, ${component.name}`;
  const residuals = models.map((model) => line(curve, model, curve[model], 1.2));
  Plotly.react("residual", residuals, layoutOf(`Residual: ${label}`, "time in s", unit), CONFIG);
  const predicted = (model) => curve.measured.map((own, at) => own - curve[model][at]);
  const sides = [line(curve, "measured", curve.measured, 3), ...models.map((model) => line(curve, model, predicted(model), 1.2))];
  Plotly.react("sides", sides, layoutOf(`Measured and model: ${label}`, "time in s", unit), CONFIG);
}

function drawClouds({ component, unit, input }) {
  const models = ["before", "after"];
  const own = component.cloud;
  const against = models.map((model) => cloud(input.cloud, own[model], model, "%{x:.4~g}: %{y:.4~g}"));
  const inputLabel = `${input.name} in ${withUnit(input.unit)}`;
  Plotly.react("against", against, layoutOf("Residual against an input", inputLabel, `residual in ${unit}`), CONFIG);
  const agreement = models.map((model) => cloud(own.measured.map((value, at) => value - own[model][at]), own.measured, model, "model %{x:.4~g}, measured %{y:.4~g}"));
  const ends = own.measured.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
  agreement.unshift({ mode: "lines", x: ends, y: ends, line: { color: COLOURS.noise, width: 1 }, hoverinfo: "skip" });
  Plotly.react("agreement", agreement, layoutOf("Measured against model", `model in ${unit}`, `measured in ${unit}`), CONFIG);
}

function boundLines(bounds) {
  const all = Object.entries(bounds).flatMap(([level, bound]) => [bound, -bound].map((y) => ({ level, y })));
  const shapes = all.map(({ level, y }) => ({
    type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { color: "#555", width: 1, dash: level === "95" ? "dash" : "dot" },
  }));
  // Within and beyond, since the two bounds are close to each other.
  const annotations = all.filter(({ y }) => y > 0).map(({ level, y }) => ({
    text: `${level} %`, xref: "paper", x: 1, xanchor: "right", y, yanchor: level === "95" ? "top" : "bottom", showarrow: false, font: { size: 10, color: "#555" },
  }));
  return { shapes, annotations };
}

function drawCorrelation(id, title, lags, values, bounds) {
  const traces = ["before", "after"].map((model) => ({
    mode: "lines+markers", name: NAMES[model], x: lags, y: values[model], line: { color: COLOURS[model], width: 1.5 }, marker: { size: 4 },
    hovertemplate: "%{x:.3~g} s: %{y:.3f}",
  }));
  const layout = { ...layoutOf(title, "lag in s", "correlation"), ...boundLines(bounds) };
  Plotly.react(id, traces, layout, CONFIG);
}

function drawCorrelations({ component, input, cross, windowS }) {
  const { auto, bounds } = component;
  const count = auto.before.length - 1;
  // At lag zero every residual agrees with itself.
  const beyond = Object.fromEntries(Object.entries(auto).map(([model, values]) => [model, values.slice(1)]));
  drawCorrelation("auto", "Autocorrelation of the residual", beyond.before.map((_, at) => (at + 1) * windowS), beyond, bounds);
  const lags = cross.before.map((_, at) => (at - count) * windowS);
  drawCorrelation("cross", `Correlation of the residual with ${input.name}`, lags, cross, bounds);
}

function describe({ component, unit, windowS }) {
  const [before, after] = component.rms;
  const beyond = (model) => component.auto[model].slice(1).filter((own) => Math.abs(own) > component.bounds["99"]).length;
  const lags = component.auto.before.length - 1;
  element("size").textContent = `RMS ${number(before)} ${unit} with the declared model, ${number(after)} ${unit} with the new one ` +
    `(${change(before, after)}). Autocorrelations beyond the 99 % bound: ${beyond("before")} and ${beyond("after")} of ${lags}, ` +
    `in windows of ${windowS.toFixed(3)} s.`;
}

function draw() {
  const choice = chosen();
  describe(choice);
  drawOverTime(choice);
  drawClouds(choice);
  drawCorrelations(choice);
}

// Fills a selector; what was chosen by name stays chosen.
function offer(id, names) {
  const select = element(id);
  const before = select.selectedOptions[0]?.textContent;
  select.replaceChildren(...names.map((name, index) => new Option(name, index)));
  select.value = Math.max(names.indexOf(before), 0);
}

function offerEquations() {
  offer("equation", data.flights[element("flight").value].equations.map((own) => own.name));
  offerComponents();
}

function offerComponents() {
  const flight = data.flights[element("flight").value];
  offer("component", flight.equations[element("equation").value].components.map((own) => own.name));
  offer("input", ["measured", ...flight.inputs.map((own) => own.name)]);
}

// The component of a held-out flight that the new model makes smaller than any other: what the report is about.
function chooseTelling() {
  const all = data.flights.flatMap((flight, f) => flight.equations.flatMap((equation, e) =>
    equation.components.map(({ rms: [before, after] }, c) => ({ at: [f, e, c], isTest: flight.role === "test", left: before > 0 ? after / before : 1 }))));
  const [best] = all.sort((a, b) => b.isTest - a.isTest || a.left - b.left);
  element("flight").value = best.at[0];
  offerEquations();
  element("equation").value = best.at[1];
  offerComponents();
  element("component").value = best.at[2];
}

function zoomTogether(plots) {
  let isFollowing = false;
  for (const plot of plots) {
    plot.on("plotly_relayout", async () => {
      if (isFollowing) return;
      isFollowing = true;
      const range = [...plot.layout.xaxis.range];
      const others = plots.filter((other) => other !== plot && String(other.layout.xaxis.range) !== String(range));
      await Promise.all(others.map((other) => Plotly.relayout(other, { "xaxis.range": range })));
      isFollowing = false;
    });
  }
}

function drawResiduals() {
  addMarks("legend", [["before", "declared"], ["after", "new"], ["measured", "measured"]]);
  offer("flight", data.flights.map((flight) => `${flight.name} (${flight.role})`));
  chooseTelling();
  element("flight").addEventListener("change", () => { offerEquations(); draw(); });
  element("equation").addEventListener("change", () => { offerComponents(); draw(); });
  for (const id of ["component", "input"]) element(id).addEventListener("change", draw);
  draw();
  zoomTogether(["residual", "sides"].map(element));
}

drawSummary();
drawFlights();
drawClocks();
drawFaults();
drawEffects();
drawErrors();
drawNoise();
drawWhiteness();
drawResiduals();
