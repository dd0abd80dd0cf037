const { report, varied, figures, flights } = data;
const percent = (part) => `${(100 * part).toFixed(2)} %`;
const PASSED = "#2c7fb8";
const FAILED = "#d95f0e";

title(`Campaign ${report.campaign}`);
element("summary").textContent =
  `${report.passed} of ${report.flights} flights of ${report.manifest} passed: ${percent(report.pass_rate)} ` +
  `(${percent(report.interval[0])} to ${percent(report.interval[1])} at 95 %). ` +
  (report.flights < report.planned ? `${report.planned - report.flights} planned flights were not flown.` : "");

if (flights.length < report.flights) {
  element("summary").textContent += ` The plots show every ${Math.round(report.flights / flights.length)}th flight.`;
}

fillTable(
  "failures",
  ["flights", left("first failure"), "median time in s"],
  [
    ...report.failures.map((failure) => [failure.flights, left(failure.condition), number(failure.median_s)]),
    ...report.errors.map(([error, count]) => [count, long(error), "–"]),
  ],
);
fillTable(
  "figures",
  [left("figure"), "flights", "least", "5 %", "median", "95 %", "greatest"],
  report.figures.map((figure) => [left(figure.figure), figure.flights, ...figure.quantiles.map((value) => number(value))]),
);
fillTable(
  "influences",
  [left("varied value"), left("outcome or figure"), "rank correlation", "chance"],
  report.influences.map((it) => [left(it.varied), left(it.figure), it.rank_correlation.toFixed(2), number(it.chance)]),
);
fillTable(
  "worst",
  ["flight", left("reason"), left("command")],
  report.worst.map((worst) => [worst.flight, left(worst.reason), left(worst.command)]),
);

// A name that fits beside an axis.
const short = (name) => (name.length > 36 ? `${name.slice(0, 35)}…` : name);

// Flights that passed and flights that failed, as two traces.
function traces(make) {
  const groups = [["passed", PASSED, true], ["failed", FAILED, false]];
  return groups.map(([name, color, passed]) => ({ name, marker: { color, size: 4 }, ...make(flights.filter((it) => it.passed === passed)) }));
}

function drawHistogram() {
  const index = Number(element("figure").value);
  const values = flights.map((flight) => flight.figures[index]).filter((value) => value !== null);
  // Both traces share their bins.
  const [low, high] = ends(values);
  const size = (high - low) / 40 || 1;
  const bars = traces((group) => {
    const counts = Array(41).fill(0);
    for (const flight of group) if (flight.figures[index] !== null) counts[Math.floor((flight.figures[index] - low) / size)] += 1;
    return { type: "bar", x: counts.map((_, bin) => low + (bin + 0.5) * size), y: counts };
  });
  const more = { barmode: "stack", bargap: 0.05, showlegend: true };
  Plotly.react("histogram", bars, layout("", figures[index], "flights", more), CONFIG);
}

function drawScatter() {
  const [from, to] = [Number(element("varied").value), Number(element("against").value)];
  const points = traces((group) => ({ type: "scatter", mode: "markers", x: group.map((it) => it.drawn[from]), y: group.map((it) => it.figures[to]), text: group.map((it) => `flight ${it.flight}`) }));
  Plotly.react("scatter", points, layout("", varied[from], short(figures[to]), { showlegend: true }), CONFIG);
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
