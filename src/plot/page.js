// Draws what the page holds as JSON: curves over time, and paths in space.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);

// Named one by one, since plotly.js would add one that sends the data away.
const CONFIG = { responsive: true, displaylogo: false, plotlyServerURL: "" };
const FLAT = { ...CONFIG, modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]] };
const SPACE = { ...CONFIG, modeBarButtons: [["toImage", "zoom3d", "pan3d", "orbitRotation", "tableRotation", "resetCameraDefault3d"]] };
const NUMBERS = { exponentformat: "none", zeroline: false, gridcolor: "#e6e6e6" };
const SOLID = "#787878";
// The faces of a box as triangles of its corners.
const FACES = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7], [0, 3, 2, 1]]
  .flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]]);

const element = (id) => document.getElementById(id);
const column = (rows, index) => rows.map((row) => row[index]);

// What is beside the flown line is darker, to be told from it.
function darker(colour) {
  const parts = [1, 3, 5].map((at) => Math.floor(parseInt(colour.slice(at, at + 2), 16) / 2));
  return `rgb(${parts.join(",")})`;
}

function look({ role, colour }) {
  if (role === "flown") return { color: colour, width: 2 };
  return { color: darker(colour), width: 1.2, dash: role === "asked" ? "dash" : "solid" };
}

// Which line lies upon which: an estimator's noise must not hide what was flown, nor this what was asked for.
const LAYERS = { estimated: 1, measured: 1, flown: 2, asked: 3 };
const LEGEND = { x: 1.01, y: 1, font: { size: 12 }, itemwidth: 30 };
const trails = [...data.trails].sort((a, b) => LAYERS[a.role] - LAYERS[b.role]);
// So wide that the longest name has room, and the same for all plots: their axes of time are then as long.
const LEGEND_WIDTH = 7 * Math.max(12, ...data.panels.flatMap((panel) => panel.axes).flatMap((axes) => axes.curves)
  .map((curve) => curve.name.length)) + 60;

function head(text) {
  return { text, x: 0, xanchor: "left", font: { size: 15 } };
}

function timeTraces(axes) {
  return axes.curves.map((curve) => ({
    type: "scatter", mode: "lines", name: curve.name, x: curve.x, y: curve.y, line: look(curve),
    zorder: LAYERS[curve.role], connectgaps: false,
    hovertemplate: `%{x:.3f} s: %{y:.5~g} ${axes.unit}<br>${curve.topic} ${curve.field}<extra>${curve.name}</extra>`,
  }));
}

function timeLayout(axes) {
  return {
    title: head(axes.title),
    // A copy: plotly.js changes the one that it is given.
    xaxis: { title: { text: data.time_label }, range: [...data.span_s], ...NUMBERS },
    yaxis: { title: { text: `${axes.label} [${axes.unit}]` }, ...NUMBERS },
    margin: { l: 76, r: LEGEND_WIDTH, t: 36, b: 44, autoexpand: false }, legend: LEGEND, showlegend: true, hovermode: "closest",
  };
}

// Whoever zooms into a stretch of time of one plot wants to see the others there too.
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

async function drawPanel(panel) {
  for (const plot of element("time").children) Plotly.purge(plot);
  element("time").replaceChildren();
  const plots = panel.axes.map(() => document.createElement("div"));
  for (const plot of plots) plot.className = "axes";
  element("time").append(...plots);
  await Promise.all(panel.axes.map((axes, index) => Plotly.newPlot(plots[index], timeTraces(axes), timeLayout(axes), FLAT)));
  zoomTogether(plots);
}

function offerVehicles() {
  const select = element("vehicle");
  data.panels.forEach((panel, index) => select.add(new Option(panel.vehicle, index)));
  element("choice").hidden = data.panels.length < 2;
  select.addEventListener("change", () => drawPanel(data.panels[select.value]));
}

function hasWebGl() {
  const canvas = document.createElement("canvas");
  return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
}

function solidTraces(solid) {
  const [x, y, z] = [0, 1, 2].map((axis) => column(solid.corners, axis));
  const face = {
    type: "mesh3d", name: solid.name, x, y, z, color: SOLID, opacity: 0.15, flatshading: true, hoverinfo: "name",
    i: column(FACES, 0), j: column(FACES, 1), k: column(FACES, 2),
  };
  const along = (axis) => data.edges.flatMap(([a, b]) => [solid.corners[a][axis], solid.corners[b][axis], null]);
  const edges = {
    type: "scatter3d", mode: "lines", x: along(0), y: along(1), z: along(2), line: { color: SOLID, width: 2 },
    name: `${solid.name} edges`, showlegend: false, hoverinfo: "skip",
  };
  return [face, edges];
}

function trailTraces(type, trail, points) {
  const line = look(trail);
  // Lines in space look half as wide.
  if (type === "scatter3d") line.width *= 2;
  const first = Object.fromEntries(Object.entries(points).map(([axis, values]) => [axis, values.slice(0, 1)]));
  return [
    { type, mode: "lines", name: trail.name, ...points, line },
    { type, mode: "markers", name: `start of ${trail.name}`, showlegend: false, ...first, marker: { color: line.color, size: type === "scatter3d" ? 4 : 8 } },
  ];
}

function ground() {
  const points = data.trails.flatMap((trail) => trail.x.map((x, index) => [x, trail.y[index]]));
  const corners = data.solids.flatMap((solid) => solid.corners);
  const ends = [0, 1].map((axis) => {
    const values = [...column(points, axis), ...column(corners, axis)].filter((value) => value !== null);
    const [low, high] = values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    return [low - 0.5, high + 0.5];
  });
  const [[left, right], [near, far]] = ends;
  return {
    type: "mesh3d", name: "ground", x: [left, right, right, left], y: [near, near, far, far], z: [0, 0, 0, 0],
    i: [0, 0], j: [1, 2], k: [2, 3], color: "#c8d8c0", opacity: 0.5, hoverinfo: "skip",
  };
}

function drawPath() {
  const traces = [
    ground(),
    ...data.solids.flatMap(solidTraces),
    ...trails.flatMap((trail) => trailTraces("scatter3d", trail, { x: trail.x, y: trail.y, z: trail.z })),
  ];
  const axis = (name) => ({ title: { text: `${name} [m]` }, exponentformat: "none", backgroundcolor: "#fff", gridcolor: "#ddd" });
  const layout = {
    scene: { xaxis: axis("x"), yaxis: axis("y"), zaxis: axis("z"), aspectmode: "data", camera: { eye: { x: 1.0, y: -1.8, z: 1.0 }, center: { x: 0, y: 0, z: -0.2 } } },
    margin: { l: 0, r: 0, t: 40, b: 0 }, legend: LEGEND, showlegend: true,
  };
  return Plotly.newPlot("path", traces, layout, SPACE);
}

function drawFlat(id, title, up) {
  const names = ["x", up];
  const outlines = data.solids.map((solid) => ({
    type: "scatter", mode: "lines", fill: "toself", fillcolor: "rgba(120,120,120,0.3)", line: { color: SOLID, width: 1 },
    name: solid.name, showlegend: false, hoverinfo: "name", x: column(solid[id], 0), y: column(solid[id], 1),
  }));
  const paths = trails.flatMap((trail) => trailTraces("scatter", trail, { x: trail.x, y: trail[up] }));
  const layout = {
    title: head(title),
    xaxis: { title: { text: `${names[0]} [m]` }, ...NUMBERS },
    yaxis: { title: { text: `${names[1]} [m]` }, scaleanchor: "x", scaleratio: 1, ...NUMBERS },
    margin: { l: 64, r: 12, t: 36, b: 44 }, showlegend: false, hovermode: "closest",
  };
  return Plotly.newPlot(id, [...outlines, ...paths], layout, FLAT);
}

function drawSpace() {
  const views = { path: drawPath, top: () => drawFlat("top", "From above", "y"), side: () => drawFlat("side", "From the side", "z") };
  const shown = new Set(data.views);
  if (shown.has("path") && !hasWebGl()) {
    shown.delete("path");
    shown.add("top").add("side");
    element("space-note").textContent =
      "This browser has no WebGL, which draws in three dimensions: here are the paths from above and from the side.";
  }
  for (const view of Object.keys(views)) element(view).hidden = !shown.has(view);
  element("space").hidden = !Object.keys(views).some((view) => shown.has(view));
  return Promise.all(Object.keys(views).filter((view) => shown.has(view)).map((view) => views[view]()));
}

async function draw() {
  document.title = data.title;
  element("title").textContent = data.title;
  const [from, to] = data.span_s.map((time) => time.toFixed(3));
  element("summary").textContent = `${data.recording}, ${from} s to ${to} s of simulated time. ` +
    "Dashed: asked for. Thin: estimated or measured. Drag to zoom, double-click to see all; a click on a name hides its curve.";
  offerVehicles();
  if (data.panels.length) await drawPanel(data.panels[0]);
  await drawSpace();
  // For whoever waits until everything is there.
  document.body.dataset.drawn = "true";
}

draw();
