// Effects that flights show and the declared model lacks, and the residuals behind them.

const report = data.report;

const COLOURS = { measured: "--thing", before: "--curve-4", after: "--curve-0", noise: "--ink" };
const NAMES = { before: "declared", after: "new" };
const MODELS = Object.keys(NAMES);
const CHANNELS = ["position", "velocity", "attitude", "rates"];

const withUnit = (value, unit) => `${number(value)} ${shownUnit(unit)}`.trim();
// Of 20 000 resampled flights not one may undo a gain.
const chance = (value) => (value < 1e-4 ? "< 0.0001" : value.toFixed(4));

function change(before, after) {
  const percent = 100 * (after / before - 1);
  if (!Number.isFinite(percent)) return "–";
  const size = Math.abs(percent).toFixed(Math.abs(percent) < 10 ? 1 : 0);
  const sign = Number(size) === 0 ? "" : percent > 0 ? "+" : "−";
  return `${sign}${size} %`;
}

const addItem = (id, textContent) => add(element(id), "li", { textContent });

// Those of the verdict, and those that are fitted and not named.
const unworthyNames = Object.keys(report.without_worth);
const boundNames = Object.keys(report.at_limit);
const acceptedNames = [...report.verdict, ...report.prediction_only, ...unworthyNames, ...boundNames];
const accepted = acceptedNames.map((name) => [name, report.effects[name]]).filter(([, effect]) => effect);

const doubt = ({ determined, at_bound }) => (!determined ? ", not determined by these flights" : at_bound ? ", at its bound" : "");

const byEquations = ({ by_equations, unit }) => by_equations === undefined ? "" :
  `; by the equations of each moment ${withUnit(by_equations, unit)}: neither is sure to be a property of the vehicle`;

const estimateText = ([name, estimate]) => `${spaced(name)} = ${withUnit(estimate.value, estimate.unit)} ` +
  `(95 %: ${number(estimate.low)} to ${number(estimate.high)}${doubt(estimate)})${byEquations(estimate)}`;

const knowing = { "own trim": " with the flight's own trim", disturbance: " with the disturbance seen before" };

const lossText = ({ flight, horizon, channel, rival, other, unit, ...loss }) =>
  rival === "trim" ? `${spaced(channel)} of ${flight}: a constant ${withUnit(loss.new, unit)} is missing, more than ${withUnit(other, unit)} is no trim` :
  rival === "no model" ? `${spaced(channel)} at each moment of ${flight}: new ${withUnit(loss.new, unit)}, without any model ${withUnit(other, unit)}` :
  `${channel} after ${horizon} s of ${flight}: new ${withUnit(loss.new, unit)}${knowing[loss.knowing] ?? ""}, ${rival} ${withUnit(other, unit)}`;

function verdictText() {
  const isUndecided = !acceptedNames.length && report.validation_blocks < 12;
  if (report.stopped) return `The search was stopped before its end: effects may be missing or wrong. Found so far: ${acceptedNames.join(", ") || "nothing"}.`;
  if (report.losses.length && !isUndecided) {
    const names = [...report.verdict, ...report.prediction_only];
    const asked = names.length ? ` The equations ask for ${names.join(", ")}: not to be acted on.` : "";
    return `This vehicle file does not describe these flights: its predictions lose.${asked}`;
  }
  const kept = report.prediction_only.length ? ` Kept for predictions only, not a property of the vehicle: ${report.prediction_only.join(", ")}.` : "";
  if (report.verdict.length) return `The flights ask for ${report.verdict.join(", ")}.${kept}`;
  if (boundNames.length && !kept) return `The equations put the estimate of ${boundNames.join(", ")} at its bound: the cause is not known.`;
  if (unworthyNames.length && !kept) return `The equations fit better with ${unworthyNames.join(", ")}, but no prediction error falls noticeably.`;
  if (kept) return `The flights ask for nothing that is a property of the vehicle.${kept}`;
  if (isUndecided) {
    return `Undecided: the flights that effects are chosen on have ${report.validation_blocks} blocks of ${report.block_s} s, and with less than a dozen nothing is beyond chance.`;
  }
  return "The flights ask for nothing: no effect makes the equations fit better beyond chance.";
}

// What a pilot reads: sentences of the program.
function drawBrief() {
  const { answer, ...parts } = data.brief;
  element("answer").textContent = answer;
  for (const [id, sentences] of Object.entries(parts)) {
    element(`${id}-part`).hidden = !sentences.length;
    for (const sentence of sentences) addItem(id, sentence.replaceAll("`", ""));
  }
}

function drawSummary() {
  title(`${report.vehicle.split(/[\\/]/).pop().replace(/\.toml$/, "")}: what flights show beyond the declared model`);
  element("verdict").textContent = verdictText();
  for (const loss of report.losses) addItem("findings", `Loses: ${lossText(loss)}.`);
  for (const [effect, reason] of [report.without_worth, report.at_limit].flatMap(Object.entries)) addItem("findings", `Fitted and not named, ${effect}: ${reason}.`);
  for (const { effect, reason } of report.withdrawn) addItem("findings", `Withdrawn, ${effect}: ${reason}.`);
  for (const [name, effect] of accepted) {
    const estimates = Object.entries(effect.parameters).map(estimateText);
    const rivals = effect.confused_with.length ? `; cannot be told from ${effect.confused_with.join(", ")} here` : "";
    addItem("findings", `${name}: ${estimates.join("; ")}${rivals}.`);
  }
  for (const fault of report.faults) addItem("findings", `Fault of ${fault.flight}, ${fault.channel} (${fault.kind}): expected ${fault.expected}, found ${fault.found}; ${fault.consequence}; ${fault.advice}.`);
  if (report.trims.length) addItem("findings", "The flights differ in trim: a constant torque that no one vehicle explains.");
  for (const [name, { rms, before, unit }] of Object.entries(report.unexplained)) {
    addItem("findings", `Unexplained, ${spaced(name)}: ${withUnit(rms, unit)} are neither noise nor any ` +
      `effect's (${withUnit(before, unit)} with the declared model).`);
  }
  for (const { effect, needs } of report.not_identifiable) addItem("findings", `Cannot be seen here: ${effect}. It needs ${needs}.`);
}

function drawFlights() {
  fillTable("flights", [left("flight"), left("used to"), "compared [s]", "windows [s]", left("equations")], report.flights.map((flight) =>
    [left(flight.name), left(flight.role), flight.compared_s.toFixed(1), flight.window_s.toFixed(3), long(list(flight.equations.map(spaced)))]));
  // Notes of the reader; a note that holds for several flights is shown once.
  const flightsOf = new Map();
  for (const { name, assumed, notes } of report.flights) {
    for (const note of [...assumed.map((what) => `assumed: ${what}`), ...notes]) flightsOf.set(note, [...(flightsOf.get(note) ?? []), name]);
  }
  for (const [note, names] of flightsOf) {
    const of = names.length === report.flights.length && names.length > 1 ? "all flights" : names.join(", ");
    addItem("notes", `${of}: ${note.replaceAll("`", "")}`);
  }
}

// A table within a part of the page that is there only where the table has rows.
function fillPart(id, headings, rows) {
  element(`${id}-part`).hidden = !rows.length;
  fillTable(id, headings, rows);
}

function drawClocks() {
  const ms = (value) => number(1e3 * value);
  const rows = (channels) => Object.entries(channels).filter(([, offset]) => offset).map(([channel, { value, low, high, taken_off }]) =>
    [left(channel), ms(value), `${ms(low)} to ${ms(high)}`, ms(taken_off)]);
  fillPart("clocks", [left("flight"), left("channel"), "late by [ms]", "95 % interval [ms]", "taken off [ms]"],
    Object.entries(report.time_offsets_s).flatMap(([flight, channels]) => grouped(flight, rows(channels))));
}

function drawFaults() {
  fillPart("faults", ["flight", "channel", "kind", "expected", "found", "consequence", "advice"].map(left), report.faults.map((fault) =>
    [left(fault.flight), left(fault.channel), left(fault.kind), ...["expected", "found", "consequence", "advice"].map((key) => long(fault[key]))]));
  fillPart("trims", [left("flight"), "roll", "pitch", "yaw"], report.trims.map((trim) => [left(trim.flight),
    ...trim.angular_acceleration_rad_s2.map((torque, axis) => `${number(torque)} ± ${trim.deviation_rad_s2[axis].toPrecision(2)}`)]));
}

function drawWinds() {
  const along = ({ value, low, high }) => [number(value), `${number(low)} to ${number(high)}`];
  fillPart("winds", [left("flight"), ...["x", "y"].flatMap((axis) => [axis, "95 % interval"])],
    report.winds.map(({ flight, x, y }) => [left(flight), ...[x, y].flatMap(along)]));
}

// One row per parameter; the effect stands in the first.
function effectRows([name, effect]) {
  const { before, after } = effect.held_out;
  const figures = [number(before), number(after), change(before, after), chance(effect.chance), long(list(effect.confused_with))];
  const judged = effect.accepted ? "yes" : effect.linearised ? "no, linearised" : "no";
  const rows = Object.entries(effect.parameters).map(([parameter, { value, unit, low, high }], index) => {
    const label = long([spaced(parameter), shownUnit(unit) && `[${shownUnit(unit)}]`].join(" "));
    return [left(index ? "" : judged), label, number(value), `${number(low)} to ${number(high)}`, ...(index ? [] : figures)];
  });
  for (const after of [...new Set(effect.worth.map(({ horizon_s }) => horizon_s))].sort((a, b) => a - b)) {
    const worth = effect.worth.filter(({ horizon_s }) => horizon_s === after).map(({ channel, without, with: by, unit }) =>
      `${channel} ${number(without)} → ${number(by)} ${unit}`);
    rows.push([left(""), long(`Prediction errors without it → with it, after ${after} s: ${worth.join(", ")}.`, 8)]);
  }
  if (effect.experiment) rows.push([left(""), long(`To tell it from ${effect.confused_with[0]}: ${effect.experiment}.`, 8)]);
  return grouped(name, rows).map(({ cells, className }) => ({ cells, className: effect.accepted ? className : `${className} left-out` }));
}

function drawEffects() {
  const others = Object.entries(report.effects).filter(([, effect]) => !effect.accepted);
  others.sort(([, a], [, b]) => a.held_out.after / a.held_out.before - b.held_out.after / b.held_out.before);
  fillTable("effects", [left("effect"), left("accepted"), left("parameter"), "estimate", "95 % interval",
    "without", "with", "change", "chance", left("cannot be told from")], [...accepted, ...others].flatMap(effectRows));
}

const horizons = (flights) => [...new Set(Object.values(flights).flatMap(Object.keys))].sort((a, b) => a - b);
const floorOf = (channel, horizon) => report.noise_floor[channel]?.prediction[horizon];

function fillErrors(id, flights) {
  const hasWinds = report.winds.length > 0;
  const rows = (flight, errors) => horizons({ errors }).flatMap((horizon) => CHANNELS.filter((name) => errors[horizon][name]).map((channel) => {
    const { before, after, persistence, own_trim, disturbance, own_wind, measured_attitude, by_axis, unit } = errors[horizon][channel];
    const flown = data.bus?.flights[flight]?.[horizon]?.[channel];
    return [horizon, left(channel), number(before), number(after), ...by_axis.map((error) => number(error)), number(own_trim), number(disturbance), ...(hasWinds ? [number(own_wind)] : []), number(measured_attitude),
      number(persistence), left(shownUnit(unit)), change(before, after),
      number(floorOf(channel, horizon)), ...(data.bus ? [number(flown?.before), number(flown?.after)] : [])];
  }));
  const onBus = data.bus ? ["declared, on the bus", "new, on the bus"] : [];
  fillTable(id, [left("flight"), "horizon [s]", left("channel"), "declared", "new", "x", "y", "z", "own trim", "disturbance seen", ...(hasWinds ? ["wind seen"] : []),
    "attitude as measured", "persistence", left("unit"), "change", "by noise alone", ...onBus],
    Object.entries(flights).flatMap(([flight, errors]) => grouped(flight, rows(flight, errors))));
}

// The errors of one channel at one horizon, flight by flight; a line where noise alone would put them.
function drawBars(channel, horizon, rows) {
  const unit = shownUnit(rows[0][1][horizon][channel].unit);
  const bars = MODELS.map((model) => ({
    type: "bar", name: NAMES[model], marker: { color: COLOURS[model] },
    x: rows.map(([flight]) => flight), y: rows.map(([, errors]) => errors[horizon][channel][model]),
    // Beside a great error a small one is no bar to be seen.
    text: rows.map(([, errors]) => number(errors[horizon][channel][model], 3)), textposition: "outside", cliponaxis: false,
    hovertemplate: `%{x}<br>${NAMES[model]}: %{y:.4~g} ${unit}<extra></extra>`,
  }));
  const floor = floorOf(channel, horizon);
  addPlot("errors", "small", bars, layout(`${channel} after ${horizon} s`, "", unit, {
    xaxis: { tickangle: 0, showticklabels: rows.length < 5 }, yaxis: { rangemode: "tozero", nticks: 5 }, bargap: 0.3,
    shapes: floor === undefined ? [] : [level(floor, { color: COLOURS.noise, width: 1.5, dash: "dot" })],
  }), SMALL);
}

function drawErrors() {
  addLegend("errors-legend", [[COLOURS.before, "declared"], [COLOURS.after, "new"], [COLOURS.noise, "what noise alone makes (dotted)"]]);
  for (const channel of CHANNELS) {
    for (const horizon of horizons(report.held_out)) {
      const rows = Object.entries(report.held_out).filter(([, errors]) => errors[horizon]?.[channel]);
      if (rows.length) drawBars(channel, horizon, rows);
    }
  }
  fillErrors("held-out", report.held_out);
  fillErrors("fitted", { ...report.selected, ...report.fitted });
}

function drawLimits() {
  const part = (value) => `${(100 * value).toFixed(0)} %`;
  fillTable("limits", [left("channel"), "the flight's own trim", "a disturbance seen before", "noise of the sensors", "unknown"],
    CHANNELS.filter((channel) => report.limits[channel]).map((channel) => {
      const { trim, disturbance, noise, unknown } = report.limits[channel];
      return [left(channel), part(trim), part(disturbance), part(noise), part(unknown)];
    }));
}

function drawNoise() {
  const ahead = horizons(report.held_out);
  const units = Object.fromEntries(Object.values(report.held_out).flatMap(Object.values).flatMap(Object.entries).map(([channel, { unit }]) => [channel, unit]));
  fillTable("noise", [left("channel"), "deviation", left("unit"), ...ahead.map((horizon) => `error after ${horizon} s`), left("unit")],
    Object.entries(report.noise_floor).map(([channel, { value, unit, prediction }]) =>
      [left(spaced(channel)), number(value), left(shownUnit(unit)), ...ahead.map((horizon) => number(prediction[horizon])), left(shownUnit(units[channel] ?? { attitude: "deg", rates: "rad/s" }[channel] ?? ""))]));
}

function drawWhiteness() {
  const cells = (model, { rms, no_model, persistent, unit, beyond_bound, p_value }) =>
    [left(NAMES[model]), number(rms), number(no_model), number(persistent), left(shownUnit(unit)), `${(100 * beyond_bound).toFixed(0)} %`, chance(p_value)];
  fillTable("whiteness", [left("equation"), left("model"), "RMS", "no model", "common to neighbours", left("unit"), "beyond bound", "p"],
    Object.keys(report.whiteness.before).flatMap((name) =>
      grouped(spaced(name), MODELS.map((model) => cells(model, report.whiteness[model][name])))));
}

// Returns the choice: a flight, an equation of it, a component of that, and the input that it is drawn over.
function chosen() {
  const flight = data.flights[element("flight").value];
  const equation = flight.equations[element("equation").value];
  const component = equation.components[element("component").value];
  const measured = { name: `measured ${equation.name}`, unit: equation.unit, cloud: component.cloud.measured };
  const inputs = [measured, ...flight.inputs];
  const at = Math.min(element("input").value, inputs.length - 1);
  const windowS = report.flights.find(({ name }) => name === flight.name).window_s;
  return { equation, component, unit: shownUnit(equation.unit), input: inputs[at], cross: component.cross[at], windowS };
}

const redraw = (id, traces, ...axes) => plotAt(id, traces, layout(...axes), CONFIG);

// The curve with nothing between two points that have a gap between them.
const broken = (values, breaks) => values.flatMap((value, at) => (breaks.includes(at) ? [null, value] : [value]));

function line(curve, key, values, width) {
  const [x, y] = [curve.time, values].map((numbers) => broken(numbers, curve.breaks));
  return { mode: "lines", name: NAMES[key] ?? key, x, y, line: { color: COLOURS[key], width }, hovertemplate: "%{x:.3f} s: %{y:.4~g}" };
}

function cloud(x, y, key, hovertemplate) {
  return { mode: "markers", name: NAMES[key], x, y, marker: { color: COLOURS[key], size: 4, opacity: 0.5 }, hovertemplate };
}

// Prediction of a model: the measured values less its residual.
const predicted = (curve, model) => curve.measured.map((value, at) => value - curve[model][at]);

function drawOverTime({ equation, component: { name, curve }, unit }) {
  const label = `${equation.name}, ${name}`;
  const residuals = MODELS.map((model) => line(curve, model, curve[model], 1.2));
  redraw("residual", residuals, `Residual: ${label}`, "time in s", unit);
  const sides = [line(curve, "measured", curve.measured, 3), ...MODELS.map((model) => line(curve, model, predicted(curve, model), 1.2))];
  redraw("sides", sides, `Measured and model: ${label}`, "time in s", unit);
}

function drawClouds({ component: { cloud: points }, unit, input }) {
  const against = MODELS.map((model) => cloud(input.cloud, points[model], model, "%{x:.4~g}: %{y:.4~g}"));
  redraw("against", against, "Residual against an input", `${input.name} in ${shownUnit(input.unit)}`, `residual in ${unit}`);
  const agreement = MODELS.map((model) => cloud(predicted(points, model), points.measured, model, "model %{x:.4~g}, measured %{y:.4~g}"));
  const same = { mode: "lines", x: ends(points.measured), y: ends(points.measured), line: { color: COLOURS.noise, width: 1 }, hoverinfo: "skip" };
  redraw("agreement", [same, ...agreement], "Measured against model", `model in ${unit}`, `measured in ${unit}`);
}

function boundLines(bounds) {
  const grey = "--faint";
  const shapes = Object.entries(bounds).flatMap(([share, bound]) =>
    [bound, -bound].map((y) => level(y, { color: grey, width: 1, dash: share === "95" ? "dash" : "dot" })));
  // Within and beyond, since the two bounds are close to each other.
  const annotations = Object.entries(bounds).map(([share, y]) => ({
    text: `${share} %`, xref: "paper", x: 1, xanchor: "right", y, yanchor: share === "95" ? "top" : "bottom", showarrow: false, font: { size: 10, color: grey },
  }));
  return { shapes, annotations };
}

function drawCorrelation(id, text, x, values, bounds) {
  const traces = MODELS.map((model) => ({
    mode: "lines+markers", name: NAMES[model], x, y: values[model], line: { color: COLOURS[model], width: 1.5 }, marker: { size: 4 },
    hovertemplate: "%{x:.3~g} s: %{y:.3f}",
  }));
  redraw(id, traces, text, "lag in s", "correlation", boundLines(bounds));
}

// At lag zero every residual agrees with itself.
const beyondZero = (auto) => Object.fromEntries(MODELS.map((model) => [model, auto[model].slice(1)]));

function drawCorrelations({ component: { auto, bounds }, input, cross, windowS }) {
  const beyond = beyondZero(auto);
  const count = beyond.before.length;
  drawCorrelation("auto", "Autocorrelation of the residual", beyond.before.map((_, at) => (at + 1) * windowS), beyond, bounds);
  const lags = cross.before.map((_, at) => (at - count) * windowS);
  drawCorrelation("cross", `Correlation of the residual with ${input.name}`, lags, cross, bounds);
}

function describe({ component: { rms, auto, bounds }, unit, windowS }) {
  const [before, after] = MODELS.map((model) => beyondZero(auto)[model].filter((value) => Math.abs(value) > bounds["99"]).length);
  element("size").textContent = `RMS ${number(rms[0])} ${unit} with the declared model, ${number(rms[1])} ${unit} with the new one ` +
    `(${change(...rms)}). Autocorrelations beyond the 99 % bound: ${before} and ${after} of ${auto.before.length - 1}, ` +
    `in windows of ${windowS.toFixed(3)} s.`;
}

function draw() {
  const choice = chosen();
  for (const part of [describe, drawOverTime, drawClouds, drawCorrelations]) part(choice);
}

const named = (things) => things.map(({ name }) => name);

function offerEquations() {
  offer("equation", named(data.flights[element("flight").value].equations));
  offerComponents();
}

function offerComponents() {
  const flight = data.flights[element("flight").value];
  offer("component", named(flight.equations[element("equation").value].components));
  offer("input", ["measured", ...named(flight.inputs)]);
}

// The component of a held-out flight that the new model makes smaller than any other: what the report is about.
function chooseTelling() {
  const all = data.flights.flatMap((flight, f) => flight.equations.flatMap((equation, e) =>
    equation.components.map(({ rms: [before, after] }, c) => ({ at: [f, e, c], isTest: flight.role === "test", left: before > 0 ? after / before : 1 }))));
  const [{ at: [flight, equation, component] }] = all.sort((a, b) => b.isTest - a.isTest || a.left - b.left);
  element("flight").value = flight;
  offerEquations();
  element("equation").value = equation;
  offerComponents();
  element("component").value = component;
}

function drawResiduals() {
  addLegend("legend", [[COLOURS.before, "declared"], [COLOURS.after, "new"], [COLOURS.measured, "measured"]]);
  offer("flight", data.flights.map((flight) => `${flight.name} (${flight.role})`));
  chooseTelling();
  const changed = { flight: offerEquations, equation: offerComponents, component: () => {}, input: () => {} };
  for (const [id, follow] of Object.entries(changed)) element(id).addEventListener("change", () => { follow(); draw(); });
  draw();
  zoomTogether(["residual", "sides"].map(element));
}

for (const part of [drawBrief, drawSummary, drawFlights, drawClocks, drawFaults, drawWinds, drawEffects, drawErrors, drawLimits, drawNoise, drawWhiteness, drawResiduals]) part();
