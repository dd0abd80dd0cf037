// Curves over time, and paths in space.

const SPACE = config(["toImage", "zoom3d", "pan3d", "orbitRotation", "tableRotation", "resetCameraDefault3d"]);
const SOLID = "--thing";
// Layers of the lines: an estimator's noise must not hide the flown line, nor that the line that was asked for.
const LAYERS = { estimated: 1, measured: 2, flown: 3, asked: 4 };
const BAND_PX = 6;
// Beside the curves a legend would leave a narrow page nothing to draw on: there it is below them.
const NARROW = matchMedia("(max-width: 700px)");
const LEGEND_ROW = 22;
const WIDE_PX = 320;
const LEGEND = { font: { size: 12 }, itemwidth: 30, traceorder: "normal" };
const LEGEND_BELOW = { ...LEGEND, orientation: "h", x: 0, xanchor: "left", y: 0, yref: "container", yanchor: "bottom" };
const LEGEND_BESIDE = { ...LEGEND, x: 1.01, y: 1 };

// Names in the legend: lines of a role that all have the colours of other lines share one.
function legendNames(lines, shared) {
  const isShared = ({ role }) => shared.some((other) => other.role === role);
  return [...lines.filter((line) => !isShared(line)), ...shared].map(({ name }) => name);
}

// So wide that the longest name has room, and the same for all plots: their axes of time are then as long.
const LEGEND_WIDTH = 7 * Math.max(12, ...data.panels.flatMap((panel) => panel.axes)
  .flatMap((axes) => legendNames(axes.curves, axes.shared)).map((name) => name.length)) + 60;

const trails = [...data.trails].sort((a, b) => LAYERS[a.role] - LAYERS[b.role]);
const column = (rows, index) => rows.map((row) => row[index]);

// An estimate is a band, which is seen on both sides of the flown line.
function look({ role, colour, is_darker: isDarker, is_band: isBand }) {
  if (isBand) return { color: `${colour} 0.5`, width: BAND_PX };
  if (role === "flown") return { color: colour, width: 2 };
  return { color: isDarker ? `${colour} inked` : colour, width: 1.2, dash: role === "asked" ? "dash" : "solid" };
}

// What a line has to do with the legend. A click on a shared name hides all lines of its role.
const inLegend = ({ role }, shared) => (shared.some((other) => other.role === role) ? { legendgroup: role, showlegend: false } : {});

// Lines without points: the shared names of the legend.
function sharedTraces(type, lines, shared) {
  const nowhere = type === "scatter3d" ? { x: [null], y: [null], z: [null] } : { x: [null], y: [null] };
  return shared.map(({ role, name }) => {
    const line = lookAs(type, { ...lines.find((line) => line.role === role), colour: "--ink", is_darker: false });
    return { type, mode: "lines", name, ...nowhere, line, legendgroup: role, hoverinfo: "skip", meta: "legend" };
  });
}

// Height that names need in a legend below the curves, at the present width.
function heightBelow(id, names) {
  const width = Math.max(element(id).clientWidth - 20, 200);
  let [rows, used] = [1, 0];
  for (const name of names) {
    const needed = 7 * name.length + 50;
    if (used > 0 && used + needed > width) [rows, used] = [rows + 1, 0];
    used += needed;
  }
  return rows * LEGEND_ROW;
}

function drawAxes(axes) {
  const traces = axes.curves.map((curve) => ({
    mode: "lines", name: curve.name, x: curve.x, y: curve.y, line: look(curve), zorder: LAYERS[curve.role], ...inLegend(curve, axes.shared),
    hovertemplate: `%{x:.3f} ${data.across.unit}: %{y:.5~g} ${axes.unit}<br>${curve.topic} ${curve.field}<extra>${curve.name}</extra>`,
  }));
  const below = NARROW.matches ? heightBelow("time", legendNames(axes.curves, axes.shared)) : 0;
  const room = below ? { l: 56, r: 8, t: 36, b: 64 + below } : { l: 76, r: LEGEND_WIDTH, t: 36, b: 50 };
  const all = [...traces, ...sharedTraces("scatter", axes.curves, axes.shared)];
  return addPlot("time", below ? "" : "wide", all, layout(axes.title, data.across.label, `${axes.label} [${axes.unit}]`, {
    // A copy: plotly.js changes the one that it is given.
    xaxis: { range: [...data.across.range], zeroline: false, title: { text: data.across.label, standoff: below ? 12 : undefined } }, yaxis: { zeroline: false, automargin: false },
    margin: { ...room, autoexpand: false }, legend: below ? LEGEND_BELOW : LEGEND_BESIDE, showlegend: true,
    ...(below ? { height: WIDE_PX + below } : {}),
  }), CONFIG);
}

async function drawPanel(panel) {
  for (const plot of element("time").children) Plotly.purge(plot);
  element("time").replaceChildren();
  zoomTogether(await Promise.all(panel.axes.map(drawAxes)));
}

function offerVehicles() {
  offer("vehicle", data.panels.map((panel) => panel.vehicle));
  element("choice").hidden = data.panels.length < 2;
  element("vehicle").addEventListener("change", () => drawPanel(data.panels[element("vehicle").value]));
}

function hasWebGl() {
  const canvas = document.createElement("canvas");
  return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
}

function solidTraces(solid) {
  const [x, y, z] = [0, 1, 2].map((axis) => column(solid.corners, axis));
  const [i, j, k] = [0, 1, 2].map((corner) => column(solid.faces, corner));
  const along = (axis) => solid.edges.flatMap(([a, b]) => [a[axis], b[axis], null]);
  return [
    { type: "mesh3d", name: solid.name, x, y, z, i, j, k, color: SOLID, opacity: 0.15, flatshading: true, hoverinfo: "name" },
    { type: "scatter3d", mode: "lines", name: `${solid.name} edges`, x: along(0), y: along(1), z: along(2), line: { color: SOLID, width: 2 }, showlegend: false, hoverinfo: "skip" },
  ];
}

// The look of lines of this type: bands would hide other lines in space, where the nearest is in front.
const lookAs = (type, line) => look(type === "scatter3d" ? { ...line, is_band: false } : line);

// A path and its start; lines in space look half as wide.
function trailTraces(type, trail, points) {
  const [line, size, widen] = [lookAs(type, trail), ...(type === "scatter3d" ? [4, 2] : [8, 1])];
  const first = Object.fromEntries(Object.entries(points).map(([axis, values]) => [axis, values.slice(0, 1)]));
  return [
    { type, mode: "lines", name: trail.name, ...points, line: { ...line, width: widen * line.width }, ...inLegend(trail, data.shared) },
    { type, mode: "markers", name: `start of ${trail.name}`, showlegend: false, ...first, marker: { color: line.color, size } },
  ];
}

// The vehicle at some places of its path.
function airframeTrace(type, airframe, points) {
  return {
    type, mode: "lines", name: airframe.name, ...points, line: { color: `${airframe.colour} inked`, width: type === "scatter3d" ? 2 : 1 },
    showlegend: false, hoverinfo: "name", connectgaps: false,
  };
}

function ground() {
  const corners = data.solids.flatMap((solid) => solid.corners);
  const [[left, right], [near, far]] = ["x", "y"].map((axis, index) => {
    const [low, high] = ends([...data.trails.flatMap((trail) => trail[axis]), ...column(corners, index)]);
    return [low - 0.5, high + 0.5];
  });
  return {
    type: "mesh3d", name: "ground", x: [left, right, right, left], y: [near, near, far, far], z: [0, 0, 0, 0],
    i: [0, 0], j: [1, 2], k: [2, 3], color: "--floor", opacity: 0.5, hoverinfo: "skip",
  };
}

function drawPath() {
  const paths = trails.flatMap(({ x, y, z, ...trail }) => trailTraces("scatter3d", trail, { x, y, z }));
  const airframes = data.airframes.map((airframe) =>
    airframeTrace("scatter3d", airframe, { x: airframe.x, y: airframe.y, z: airframe.z }));
  const axis = (name) => ({
    title: { text: `${name} [m]` }, exponentformat: "none", backgroundcolor: "--ground", gridcolor: "--line", zerolinecolor: "--thing",
  });
  const camera = { eye: { x: 1.0, y: -1.8, z: 1.0 }, center: { x: 0, y: 0, z: -0.2 } };
  const names = sharedTraces("scatter3d", data.trails, data.shared);
  return plotAt("path", [ground(), ...data.solids.flatMap(solidTraces), ...airframes, ...paths, ...names], {
    ...GROUND, scene: { xaxis: axis("x"), yaxis: axis("y"), zaxis: axis("z"), aspectmode: "data", camera },
    margin: { l: 0, r: 0, t: 40, b: 0 }, legend: NARROW.matches ? LEGEND_BELOW : LEGEND_BESIDE, showlegend: true,
  }, SPACE);
}

function drawFlat(id, text, up) {
  // With a gap between two lines.
  const along = (lines, axis) => lines.flatMap((line) => [...column(line, axis), null]);
  const outlines = data.solids.map((solid) => ({
    type: "scatter", mode: "lines", fill: "toself", fillcolor: `${SOLID} 0.3`, line: { color: SOLID, width: 1 },
    name: solid.name, hoverinfo: "name", x: along(solid[id], 0), y: along(solid[id], 1),
  }));
  const paths = trails.flatMap((trail) => trailTraces("scatter", trail, { x: trail.x, y: trail[up] }));
  const airframes = data.airframes.map((airframe) => airframeTrace("scatter", airframe, { x: airframe.x, y: airframe[up] }));
  const axes = { xaxis: { zeroline: false }, yaxis: { zeroline: false, scaleanchor: "x", scaleratio: 1 } };
  return plotAt(id, [...outlines, ...airframes, ...paths], layout(text, "x [m]", `${up} [m]`, axes), CONFIG);
}

const VIEWS = { path: drawPath, top: () => drawFlat("top", "From above", "y"), side: () => drawFlat("side", "From the side", "z") };

function drawSpace() {
  let shown = Object.keys(VIEWS).filter((view) => data.views.includes(view));
  if (shown.includes("path") && !hasWebGl()) {
    shown = ["top", "side"];
    element("space-note").textContent =
      "This browser has no WebGL, which draws in three dimensions: here are the paths from above and from the side.";
  }
  for (const view of Object.keys(VIEWS)) element(view).hidden = !shown.includes(view);
  element("space").hidden = !shown.length;
  return Promise.all(shown.map((view) => VIEWS[view]()));
}

async function draw() {
  title(data.title);
  const [from, to] = data.span_s.map((time) => time.toFixed(3));
  element("summary").textContent = `${data.recording}, ${from} s to ${to} s of simulated time. ` +
    "Dashed: asked for. Wide and pale: estimated. Thin: measured. Drag to zoom, double-click to see all; a click on a name hides its curve.";
  offerVehicles();
  const drawShown = () => data.panels.length && drawPanel(data.panels[element("vehicle").value || 0]);
  await drawShown();
  await drawSpace();
  NARROW.addEventListener("change", () => Promise.resolve(drawShown()).then(drawSpace));
  // For whoever waits until everything is there.
  document.body.dataset.drawn = "true";
}

draw();
