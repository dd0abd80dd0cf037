// Draws the profile that the page holds as JSON.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const profile = data.profile;

// Distinguishable also without colour vision (Okabe and Ito).
const COLOURS = { wait: "#c8ccd0", "wake-up": "#e69f00", compute: "#0072b2", publish: "#009e73" };
const PATH_COLOUR = "#d55e00";
// Named one by one, since plotly.js would add one that sends the data away.
const BUTTONS = ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"];
const CONFIG = { responsive: true, displaylogo: false, plotlyServerURL: "", modeBarButtons: [BUTTONS] };
const NUMBERS = { exponentformat: "none", separatethousands: true, automargin: true };
const QUANTILES = [["p50_us", "p50"], ["p90_us", "p90"], ["p99_us", "p99"], ["p99.9_us", "p99.9"], ["max_us", "max"]];

const element = (id) => document.getElementById(id);
const microseconds = (us) => us.toLocaleString("en", { maximumFractionDigits: 1, minimumFractionDigits: 1 });

function addRow(table, tag, cells, isFirst) {
  const row = table.insertRow();
  if (isFirst) row.className = "first";
  for (const cell of cells) {
    const field = document.createElement(tag);
    field.textContent = cell;
    row.append(field);
  }
}

// Rows of [name, times]; the headings before the quantiles are `names`.
function fillTable(id, names, rows) {
  const table = element(id);
  table.replaceChildren();
  addRow(table, "th", [...names, "count", ...QUANTILES.map(([, name]) => `${name} [µs]`)]);
  for (const [cells, times, isFirst] of rows) {
    const values = QUANTILES.map(([key]) => (times.count ? microseconds(times[key]) : "–"));
    addRow(table, "td", [...cells, times.count.toLocaleString("en"), ...values], isFirst);
  }
}

// Bins as a stepped line over a logarithmic axis in µs.
function steps(histogram, colour) {
  const edge = (bin) => 10 ** (bin / data.bins_per_decade) / 1000;
  const x = [];
  const y = [];
  let next = null;
  for (const [bin, count] of histogram.bins) {
    if (next !== null && bin > next) {
      x.push(edge(next), edge(bin));
      y.push(null, null);
    }
    x.push(edge(bin), edge(bin + 1));
    y.push(count, count);
    next = bin + 1;
  }
  return {
    x, y, name: histogram.name, mode: "lines", line: { color: colour, width: 2 },
    hovertemplate: "%{x:.3~s} µs: %{y}",
  };
}

function logarithmic(title, x, y) {
  return {
    title: { text: title, x: 0, xanchor: "left", font: { size: 14 } },
    xaxis: { type: "log", title: { text: x }, dtick: 1, ...NUMBERS },
    yaxis: { type: "log", title: { text: y }, dtick: 1, ...NUMBERS },
    margin: { l: 48, r: 12, t: 36, b: 44 },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 1, xanchor: "right", font: { size: 11 } },
    hovermode: "closest",
  };
}

// One legend for all histograms: in each it would take a fifth of the plot.
function drawLegend() {
  for (const part of data.parts) {
    const mark = document.createElement("span");
    mark.className = "mark";
    mark.style.background = COLOURS[part];
    element("legend").append(mark, `${part} `);
  }
}

function drawHistograms() {
  drawLegend();
  for (const node of data.nodes) {
    const plot = document.createElement("div");
    plot.className = "small";
    element("histograms").append(plot);
    const traces = node.parts.map((part) => steps(part, COLOURS[part.name]));
    const layout = { ...logarithmic(node.name, "µs", "ticks"), showlegend: false };
    Plotly.newPlot(plot, traces, layout, { ...CONFIG, displayModeBar: false });
  }
}

function drawNodes() {
  const parts = [["wait", "wait"], ["wake_up", "wake-up"], ["compute", "compute"], ["publish", "publish"]];
  const rows = profile.nodes.flatMap((node) =>
    parts.map(([key, name], index) => [[index ? "" : node.name, name], node[key], index === 0]));
  fillTable("nodes", ["node", "part"], rows);
}

function drawPath() {
  const rows = profile.critical_path.places.map((place) =>
    [[place.place, `${(100 * place.share).toFixed(1)} %`], place.time]);
  fillTable("path", ["place", "share"], [[["tick", ""], profile.critical_path.tick_time], ...rows]);
  const course = {
    x: data.course.map(([time]) => time), y: data.course.map(([, us]) => us),
    mode: "markers", marker: { size: 4, color: COLOURS.compute },
    hovertemplate: "%{x:.3f} s: %{y:.1f} µs<extra></extra>",
  };
  const layout = logarithmic("Tick time over the run", "simulated time in s", "µs");
  Object.assign(layout.xaxis, { type: "linear", dtick: undefined, zeroline: false });
  Plotly.newPlot("course", [course], layout, CONFIG);
}

function drawTimeline(slow) {
  const nodes = profile.nodes.map((node) => node.name);
  const bars = data.parts.map((part, index) => {
    const own = slow.bars.filter((bar) => bar[1] === index);
    const described = ([, , tick, , , whole, cause]) =>
      `tick ${tick}, ${part}: ${microseconds(whole)} µs` + (cause ? `<br>for ${cause}` : "");
    return {
      type: "bar", orientation: "h", name: part, marker: { color: COLOURS[part] },
      y: own.map(([node]) => nodes[node]), base: own.map((bar) => bar[3]), x: own.map((bar) => bar[4]),
      customdata: own.map(described), hovertemplate: "%{y}<br>%{customdata}<extra></extra>",
    };
  });
  // A hop belongs to the node that is reached by it.
  const line = { name: "critical path", mode: "lines", line: { color: PATH_COLOUR, width: 3 }, x: [], y: [], hoverinfo: "skip" };
  for (const stretch of slow.path) {
    line.x.push(stretch.start, stretch.end);
    line.y.push(stretch.node, stretch.node);
  }
  const layout = {
    barmode: "overlay", bargap: 0.35, hovermode: "closest",
    height: 130 + 44 * nodes.length,
    margin: { l: 60, r: 12, t: 40, b: 48 },
    xaxis: { title: { text: `µs from the start of the critical path of tick ${slow.tick}` }, ...NUMBERS },
    yaxis: { categoryorder: "array", categoryarray: [...nodes].reverse(), automargin: true, fixedrange: true },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  };
  Plotly.react("timeline", [...bars, line], layout, CONFIG);
  const table = element("stretches");
  table.replaceChildren();
  addRow(table, "th", ["on the critical path", "from [µs]", "for [µs]"]);
  for (const stretch of slow.path) {
    addRow(table, "td", [stretch.place, microseconds(stretch.start), microseconds(stretch.end - stretch.start)]);
  }
}

function offerTicks() {
  const select = element("tick");
  data.slowest.forEach((slow, index) => {
    select.add(new Option(`${slow.tick}: ${microseconds(slow.length_us)} µs`, index));
  });
  select.addEventListener("change", () => drawTimeline(data.slowest[select.value]));
  if (data.slowest.length) drawTimeline(data.slowest[0]);
}

function drawDeadlines() {
  if (!profile.pacing) {
    element("deadlines").remove();
    return;
  }
  const late = profile.pacing.overruns.filter((node) => node.ticks).map((node) => `${node.name} ${node.ticks}`);
  element("missed").textContent = `Missed: ${profile.pacing.missed_deadlines}. Grants late by a tick: ` +
    `${profile.pacing.late_grants}. Overruns: ${late.join(", ") || "none"}.`;
  Plotly.newPlot("jitter", [steps(data.jitter, COLOURS.compute)], logarithmic("Jitter: deadline to grant", "µs", "ticks"), CONFIG);
  fillTable("jitter-table", ["jitter"], [[["deadline to grant"], profile.pacing.jitter]]);
}

element("title").textContent = `${data.run}: where the time of a tick goes`;
element("summary").textContent = `${profile.ticks.toLocaleString("en")} ticks, ` +
  `${profile.noted.toLocaleString("en")} computations profiled` +
  (profile.left_out ? `, ${profile.left_out.toLocaleString("en")} not profiled because there were too many.` : ".");
offerTicks();
drawPath();
drawHistograms();
drawNodes();
fillTable("transport", ["topic", "reader"], profile.transport.map((hop) => [[hop.topic, hop.reader], hop.transport]));
fillTable("age", ["topic", "in", "time"], profile.age.flatMap((age) =>
  [[[age.source, age.command, "simulated"], age.simulated, true], [["", "", "host"], age.host]]));
drawDeadlines();
