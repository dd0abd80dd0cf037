// Parts of every page: its data, numbers as people read them, tables, legends, choices and plots.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);

// The buttons are named one by one, since plotly.js would add one that sends the data away.
const config = (buttons) => ({ responsive: true, displaylogo: false, plotlyServerURL: "", modeBarButtons: [buttons] });
const CONFIG = config(["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]);
const SMALL = { ...CONFIG, displayModeBar: false };
const AXIS = { exponentformat: "none", automargin: true, gridcolor: "--line", zerolinecolor: "--thing" };
// Plots lie on the page, in its ink.
const GROUND = { paper_bgcolor: "--ground", plot_bgcolor: "--ground", font: { color: "--ink" } };

const element = (id) => document.getElementById(id);
const spaced = (name) => name.replaceAll("_", " ");
const list = (items) => items.join(", ") || "–";

function add(parent, tag, properties = {}) {
  const child = Object.assign(document.createElement(tag), properties);
  parent.append(child);
  return child;
}

function title(text) {
  document.title = text;
  element("title").textContent = text;
}

const raised = (text) => [...String(text)].map((sign) => (sign === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign])).join("");
// A pure number has no unit to be shown.
const shownUnit = (unit) => (unit === "1" ? "" : unit.replace(/\^(-?\d+)/g, (_, exponent) => raised(exponent)).replaceAll("*", "·"));

function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-4 && size < 1e7) return (size < 10 ** digits ? value.toPrecision(digits) : value.toFixed(0)).replace("-", "−");
  const [mantissa, exponent] = value.toExponential(3).split("e");
  return `${mantissa.replace("-", "−")}·10${raised(Number(exponent))}`;
}

// A cell is text, or made by `left`, `long` or, for words longer than a line, `wrapped`.
const left = (text) => ({ text, className: "left" });
const long = (text, colSpan = 1) => ({ text, className: "long", colSpan });
const wrapped = (text) => ({ text, className: "long wrapped" });

// Fills the table with headings and rows, each its cells or {cells, className}.
function fillTable(id, headings, rows) {
  element(id).replaceChildren();
  for (const [index, row] of [headings, ...rows].entries()) {
    const { cells = row, className = "" } = row;
    const line = Object.assign(element(id).insertRow(), { className });
    for (const cell of cells) {
      const { text: textContent = cell, className = "", colSpan = 1 } = cell;
      add(line, index ? "td" : "th", { textContent, className, colSpan });
    }
  }
}

// The rows of a group; only the first says what they belong to.
const grouped = (head, rows) =>
  rows.map((cells, index) => ({ cells: [left(index ? "" : head), ...cells], className: index ? "" : "first" }));

// One legend for several plots: in each it would take a fifth of the room. Colours are names of the style sheet.
function addLegend(id, entries) {
  for (const [colour, name] of entries) {
    const label = add(element(id), "span", { className: "label" });
    add(label, "span", { className: "mark" }).style.background = `var(${colour})`;
    label.append(name);
    element(id).append(" ");
  }
}

// Fills a selector; what was chosen by name stays chosen.
function offer(id, names) {
  const before = element(id).selectedOptions[0]?.textContent;
  element(id).replaceChildren(...names.map((name, index) => new Option(name, index)));
  element(id).value = Math.max(names.indexOf(before), 0);
}

// Labels below the ticks, so that the first one lies lower than the lowest label of the other axis.
const BELOW = { ticks: "outside", ticklen: 6, tickcolor: "--thing" };

const heading = (text) => ({ text, x: 0, xanchor: "left", font: { size: 14 } });

// Axes with these names; `more` of a layout goes before what is usual, axis by axis.
function layout(text, x, y, { xaxis, yaxis, ...more } = {}) {
  return {
    ...GROUND, title: heading(text), showlegend: false, hovermode: "closest", margin: { l: 64, r: 12, t: 36, b: 48 },
    xaxis: { ...AXIS, ...BELOW, title: { text: x }, ...xaxis }, yaxis: { ...AXIS, title: { text: y }, ...yaxis }, ...more,
  };
}

const sheetColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const parts = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));

// A colour of the style sheet by its name: `--line`; with an opacity: `--line 0.4`; halfway to the ink: `--line inked`.
function schemeColour(name) {
  const [property, change] = name.split(" ");
  const [value, ink] = [sheetColour(property), parts(sheetColour("--ink"))];
  if (change === undefined) return value;
  if (change === "inked") return `rgb(${parts(value).map((part, at) => Math.round((part + ink[at]) / 2))})`;
  return `rgba(${parts(value)},${change})`;
}

const isColour = (key, value) => key.endsWith("color") && typeof value === "string" && value.startsWith("--");
const isGroup = (value) => value !== null && typeof value === "object" && (!Array.isArray(value) || typeof value[0] === "object");

// A copy of traces or of a layout for plotly.js, which knows no names of colours. Numbers are not copied.
function painted(value, key = "") {
  if (isColour(key, value)) return schemeColour(value);
  if (!isGroup(value)) return value;
  if (Array.isArray(value)) return value.map((item) => painted(item));
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, painted(item, name)]));
}

// The colours of a trace or of a layout by their places, as plotly.js names these.
function coloursOf(value, place = "") {
  if (!isGroup(value)) return [];
  return Object.entries(value).flatMap(([key, item]) => {
    const inner = Array.isArray(value) ? `${place}[${key}]` : place ? `${place}.${key}` : key;
    return isColour(key, item) ? [[inner, schemeColour(item)]] : coloursOf(item, inner);
  });
}

// Traces and layouts of the plots on the page, with the names of their colours.
const drawn = new Map();

// Draws at an element, or draws anew what is there.
function plotAt(place, traces, layout, config) {
  const plot = typeof place === "string" ? element(place) : place;
  drawn.set(plot, { traces, layout });
  return Plotly.react(plot, painted(traces), painted(layout), config);
}

// Gives the plots the colours of the present scheme; what a reader has zoomed or hidden stays so.
function recolour() {
  for (const [plot, { traces, layout }] of drawn) {
    if (!plot.isConnected) {
      drawn.delete(plot);
      continue;
    }
    const changed = {};
    for (const [index, trace] of traces.entries()) {
      for (const [place, colour] of coloursOf(trace)) (changed[place] ??= Array(traces.length).fill(undefined))[index] = colour;
    }
    Plotly.update(plot, changed, Object.fromEntries(coloursOf(layout)));
  }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);

// A new plot at the end of an element.
function addPlot(id, className, traces, layout, config) {
  const plot = add(element(id), "div", { className });
  return plotAt(plot, traces, layout, config).then(() => plot);
}

// A line across the whole plot.
const level = (y, line) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line });

// Lowest and highest of the values that there are.
const ends = (values) => values.filter((value) => value !== null)
  .reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);

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

