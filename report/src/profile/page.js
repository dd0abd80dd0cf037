// Host time of a run's ticks, by its use.

const profile = data.profile;

const COLOURS = { wait: "--grid", "wake-up": "--curve-4", compute: "--curve-0", publish: "--curve-2" };
const PATH_COLOUR = "--curve-1";
const QUANTILES = ["p50", "p90", "p99", "p99.9", "max"];
const NODE_PARTS = [["wait", "wait"], ["wake_up", "wake-up"], ["compute", "compute"], ["publish", "publish"]];
const LOG = { type: "log", dtick: 1, separatethousands: true };

const microseconds = (us) => us.toLocaleString("en", { maximumFractionDigits: 1, minimumFractionDigits: 1 });

const COUNTED = ["count", ...QUANTILES.map((name) => `${name} [µs]`)];
const counted = (times) =>
  [times.count.toLocaleString("en"), ...QUANTILES.map((name) => (times.count ? microseconds(times[`${name}_us`]) : "–"))];

// Bins as a stepped line over a logarithmic axis in µs.
function steps(histogram, colour) {
  const edge = (bin) => 10 ** (bin / data.bins_per_decade) / 1000;
  const [x, y] = [[], []];
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
  return { x, y, name: histogram.name, mode: "lines", line: { color: colour, width: 2 }, hovertemplate: "%{x:.3~s} µs: %{y}" };
}

function drawTimeline(slow) {
  const nodes = profile.nodes.map((node) => node.name);
  const described = ([, part, tick, , , whole, cause]) =>
    `tick ${tick}, ${data.parts[part]}: ${microseconds(whole)} µs` + (cause ? `<br>for ${cause}` : "");
  const bars = data.parts.map((part, index) => {
    const shown = slow.bars.filter((bar) => bar[1] === index);
    return {
      type: "bar", orientation: "h", name: part, marker: { color: COLOURS[part] },
      y: shown.map(([node]) => nodes[node]), base: shown.map((bar) => bar[3]), x: shown.map((bar) => bar[4]),
      customdata: shown.map(described), hovertemplate: "%{y}<br>%{customdata}<extra></extra>",
    };
  });
  // A hop belongs to the node that is reached by it.
  const line = {
    name: "critical path", mode: "lines", line: { color: PATH_COLOUR, width: 3 }, hoverinfo: "skip",
    x: slow.path.flatMap(({ start, end }) => [start, end]), y: slow.path.flatMap(({ node }) => [node, node]),
  };
  plotAt("timeline", [...bars, line], layout(`Tick ${slow.tick}`, "µs from the start of its critical path", "", {
    barmode: "overlay", bargap: 0.35, height: 100 + 44 * nodes.length,
    xaxis: { separatethousands: true }, yaxis: { categoryorder: "array", categoryarray: [...nodes].reverse(), fixedrange: true },
  }), CONFIG);
  fillTable("stretches", [left("on the critical path"), "from [µs]", "for [µs]"],
    slow.path.map(({ place, start, end }) => [left(place), microseconds(start), microseconds(end - start)]));
}

function drawSlowest() {
  addLegend("timeline-legend", [...data.parts.map((part) => [COLOURS[part], part]), [PATH_COLOUR, "critical path"]]);
  offer("tick", data.slowest.map((slow) => `${slow.tick}: ${microseconds(slow.length_us)} µs`));
  element("tick").addEventListener("change", () => drawTimeline(data.slowest[element("tick").value]));
  if (data.slowest.length) drawTimeline(data.slowest[0]);
}

function drawPath() {
  const { places, tick_time } = profile.critical_path;
  const shares = places.map(({ place, share, time }) => [left(place), `${(100 * share).toFixed(1)} %`, ...counted(time)]);
  fillTable("path", [left("place"), "share", ...COUNTED], [[left("tick"), "", ...counted(tick_time)], ...shares]);
  const course = {
    x: data.course.map(([time]) => time), y: data.course.map(([, us]) => us),
    mode: "markers", marker: { size: 4, color: COLOURS.compute }, hovertemplate: "%{x:.3f} s: %{y:.1f} µs<extra></extra>",
  };
  const axes = { xaxis: { zeroline: false }, yaxis: LOG };
  plotAt("course", [course], layout("Tick time over the run", "simulated time in s", "µs", axes), CONFIG);
}

function drawNodes() {
  addLegend("legend", data.parts.map((part) => [COLOURS[part], part]));
  for (const node of data.nodes) {
    const traces = node.parts.map((part) => steps(part, COLOURS[part.name]));
    addPlot("histograms", "small", traces, layout(node.name, "µs", "ticks", { xaxis: LOG, yaxis: LOG }), SMALL);
  }
  fillTable("nodes", [left("node"), left("part"), ...COUNTED], profile.nodes.flatMap((node, index) =>
    grouped(data.nodes[index].name, NODE_PARTS.map(([key, name]) => [left(name), ...counted(node[key])]))));
}

function drawHops() {
  fillTable("transport", [left("topic"), left("reader"), ...COUNTED],
    profile.transport.map((hop) => [left(hop.topic), left(hop.reader), ...counted(hop.transport)]));
  fillTable("age", [left("topic"), left("in"), left("time"), ...COUNTED], profile.age.flatMap((age) =>
    grouped(age.source, [[left(age.command), left("simulated"), ...counted(age.simulated)], ["", left("host"), ...counted(age.host)]])));
}

function drawDeadlines() {
  const { pacing } = profile;
  element("deadlines").hidden = !pacing;
  if (!pacing) return;
  const late = pacing.overruns.filter((node) => node.ticks).map((node) => `${node.name} ${node.ticks}`);
  element("missed").textContent = `Missed: ${pacing.missed_deadlines}. Grants late by a tick: ${pacing.late_grants}. ` +
    `Overruns: ${late.join(", ") || "none"}.`;
  const jitter = steps(data.jitter, COLOURS.compute);
  plotAt("jitter", [jitter], layout("Jitter: deadline to grant", "µs", "ticks", { xaxis: LOG, yaxis: LOG }), CONFIG);
  fillTable("jitter-table", [left("jitter"), ...COUNTED], [[left("deadline to grant"), ...counted(pacing.jitter)]]);
}

title(`${data.run}: where the time of a tick goes`);
element("summary").textContent = `${profile.ticks.toLocaleString("en")} ticks, ` +
  `${profile.noted.toLocaleString("en")} computations profiled` +
  (profile.first_tick ? ` from tick ${profile.first_tick.toLocaleString("en")} on` : "") +
  (profile.left_out ? `, ${profile.left_out.toLocaleString("en")} not profiled because there were too many.` : ".");
drawSlowest();
drawPath();
drawNodes();
drawHops();
drawDeadlines();
