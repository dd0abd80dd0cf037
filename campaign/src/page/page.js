const { report, varied, figures, flights } = data;
const percent = (part) => `${(100 * part).toFixed(2)} %`;
const PASSED = "--curve-0";
const FAILED = "--curve-1";
// Letters of the bar of a pass rate of 100 %.
const BAR = 20;
// A smaller chance has no meaning.
const chance = (value) => (value < 1e-3 ? "< 0.001" : number(value, 2));

title(`Campaign ${report.campaign}`);
element("summary").textContent =
  `${report.passed} of ${report.flights} flights of ${report.manifest} passed: ${percent(report.pass_rate)} ` +
  `(${percent(report.interval[0])} to ${percent(report.interval[1])} at 95 %). ` +
  (report.flights < report.planned ? `${report.planned - report.flights} planned flights were not flown. ` : "") +
  `Flown by hummingbus ${report.version}.`;

if (flights.length < report.flights) {
  element("summary").textContent += ` The plots show every ${Math.round(report.flights / flights.length)}th flight.`;
}

const missing = report.flights > report.broken ? report.figures.filter((it) => !it.flights) : [];
if (missing.length) {
  element("summary").textContent += ` No flight has a value of: ${missing.map((it) => it.figure).join("; ")}.`;
}

// Reasons that the table lists.
const REASONS = 10;
const others = report.errors.slice(REASONS).reduce((sum, it) => sum + it.flights, 0);

fillTable(
  "failures",
  ["flights", left("first failure"), "median time in s"],
  [
    ...report.failures.map((failure) => [failure.flights, left(failure.condition), number(failure.median_s)]),
    ...(report.broken ? [[report.broken, left("without figures, for these reasons:"), "–"]] : []),
    ...report.errors.slice(0, REASONS).map((it) => [it.flights, wrapped(`${it.flights > 1 ? "such as " : ""}flight ${it.flight}: ${it.error}`), "–"]),
    ...(others ? [[others, left("more; report.json has all reasons"), "–"]] : []),
  ],
);
fillTable(
  "figures",
  [left("figure"), "flights", "least", "5 %", "median", "95 %", "greatest", left("unit")],
  report.figures.map((it) => {
    const quantiles = it.quantiles.length ? it.quantiles.map((value) => number(value)) : Array(5).fill("–");
    return [left(it.figure), it.flights, ...quantiles, left(shownUnit(it.unit))];
  }),
);
element("chosen").hidden = !report.choices.length;
fillTable(
  "choices",
  [left("varied value"), left("choice"), "flights", "passed", "pass rate", "from", "to", ...report.figures.map((it) => wrapped(`median ${it.figure}`))],
  report.choices.map((it) => [
    left(it.varied), left(it.choice), it.flights, it.passed, percent(it.pass_rate), ...it.interval.map(percent), ...it.medians.map((value) => number(value)),
  ]),
);
fillTable(
  "influences",
  [left("varied value"), left("outcome or figure"), "rank correlation", "chance", left("test")],
  report.influences.map((it) =>
    [left(it.varied), left(it.figure), it.rank_correlation.toFixed(2).replace("-", "−"), chance(it.chance), left(it.test.replace("-", " "))]),
);
element("rated").hidden = !report.pass_rates.some((it) => it.groups.length);
fillTable(
  "rates",
  [left("varied value"), "chance", "from", "to", "flights", "passed", "pass rate", left("")],
  report.pass_rates.flatMap(({ varied: name, chance: value, groups }) => groups.map((group, index) => ({
    cells: [
      left(index ? "" : name), index ? "" : value === null ? "–" : chance(value),
      number(group.low), number(group.high), group.flights, group.passed, percent(group.pass_rate), left("█".repeat(Math.round(BAR * group.pass_rate))),
    ],
    className: index ? "" : "first",
  }))),
);
fillTable(
  "worst",
  ["flight", left("reason"), left("command")],
  report.worst.map((worst) => [worst.flight, wrapped(worst.reason), wrapped(worst.command)]),
);

// Letters of a line beside an axis, and lines.
const [LETTERS, LINES] = [34, 3];

// The text in lines that fit beside an axis. Of a longer one the middle is left out: the names of figures differ at their ends.
function inLines(text) {
  const lines = [];
  for (const word of text.split(" ")) {
    const joined = lines.length ? `${lines.at(-1)} ${word}` : word;
    if (lines.length && joined.length <= LETTERS) lines[lines.length - 1] = joined;
    else lines.push(word);
  }
  return lines.length > LINES ? [...lines.slice(0, LINES - 1), `… ${lines.at(-1)}`] : lines;
}

// The name of a figure with its unit, for an axis.
function inUnit(name, index) {
  const unit = shownUnit(report.figures[index].unit);
  return unit ? `${name} in ${unit}` : name;
}

// Flights that passed and flights that failed, as two traces.
function traces(make) {
  const groups = [["passed", PASSED, true], ["failed", FAILED, false]];
  return groups.map(([name, color, passed]) => make(flights.filter((it) => it.passed === passed), { name, marker: { color } }));
}

// Bins of a histogram: the square root of the number of flights, since many bins of few flights show no shape.
const [BINS_MIN, BINS_MAX] = [5, 40];
// Ticks of an axis at most: with fewer flights in the highest bar, plotly.js would put some at half flights.
const TICKS = 10;

// The least of 1, 2 or 5 times a power of ten that is not below `least`.
function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= least * (1 - 1e-9));
}

function drawHistogram() {
  const index = Number(element("figure").value);
  const values = flights.map((flight) => flight.figures[index]).filter((value) => value !== null);
  const bins = Math.min(BINS_MAX, Math.max(BINS_MIN, Math.round(Math.sqrt(values.length))));
  // Both traces share their bins.
  const [low, high] = ends(values);
  const size = (high - low) / bins || 1;
  const heights = Array(bins).fill(0);
  const bars = traces((group, trace) => {
    const counts = Array(bins).fill(0);
    for (const { figures: found } of group) {
      if (found[index] === null) continue;
      // The greatest value ends the last bin.
      const bin = Math.min(bins - 1, Math.floor((found[index] - low) / size));
      counts[bin] += 1;
      heights[bin] += 1;
    }
    return { ...trace, type: "bar", x: counts.map((_, bin) => low + (bin + 0.5) * size), y: counts };
  });
  // With few bins, plotly.js would put the ticks in the middles of the bars, at odd numbers.
  const xaxis = bins < 2 * TICKS && high > low ? { tick0: 0, dtick: roundStep((high - low) / TICKS) } : {};
  const yaxis = Math.max(...heights) < TICKS ? { dtick: 1 } : {};
  const more = { barmode: "stack", bargap: 0.05, showlegend: true, xaxis, yaxis };
  plotAt("histogram", bars, layout("", inUnit(figures[index], index), "flights", more), CONFIG);
}

function drawScatter() {
  const [from, to] = [Number(element("varied").value), Number(element("against").value)];
  const points = traces((group, { name, marker }) => ({
    name, type: "scatter", mode: "markers", marker: { ...marker, size: 5, opacity: 0.75 },
    // The few are drawn over the many.
    zorder: 2 * group.length < flights.length ? 2 : 1,
    x: group.map((it) => it.drawn[from]), y: group.map((it) => it.figures[to]), text: group.map((it) => `flight ${it.flight}`),
  }));
  const label = inLines(inUnit(figures[to], to)).join("<br>");
  plotAt("scatter", points, layout("", varied[from], label, { showlegend: true }), CONFIG);
}

for (const [id, names, draw] of [["figure", figures, drawHistogram], ["varied", varied, drawScatter], ["against", figures, drawScatter]]) {
  offer(id, names);
  element(id).addEventListener("change", draw);
}
// The strongest relation is shown first.
const strongest = report.influences.find((it) => figures.includes(it.figure));
if (strongest) {
  element("varied").value = varied.indexOf(strongest.varied);
  element("against").value = figures.indexOf(strongest.figure);
  element("figure").value = figures.indexOf(strongest.figure);
}
if (figures.length && flights.length) drawHistogram();
if (varied.length && figures.length && flights.length) drawScatter();
