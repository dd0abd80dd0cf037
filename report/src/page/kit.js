// Parts of every page: its data, numbers as people read them, tables, legends, choices and plots.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);

// The buttons are named one by one, since plotly.js would add one that sends the data away.
const config = (buttons) => ({ responsive: true, displaylogo: false, plotlyServerURL: "", modeBarButtons: [buttons] });
const CONFIG = config(["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]);
const SMALL = { ...CONFIG, displayModeBar: false };
const AXIS = { exponentformat: "none", automargin: true, gridcolor: "#e6e6e6", zerolinecolor: "#999" };

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

// One legend for several plots: in each it would take a fifth of the room.
function addLegend(id, entries) {
  for (const [colour, name] of entries) {
    const label = add(element(id), "span", { className: "label" });
    add(label, "span", { className: "mark" }).style.background = colour;
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
const BELOW = { ticks: "outside", ticklen: 6, tickcolor: "#999" };

const heading = (text) => ({ text, x: 0, xanchor: "left", font: { size: 14 } });

// Axes with these names; `more` of a layout goes before what is usual, axis by axis.
function layout(text, x, y, { xaxis, yaxis, ...more } = {}) {
  return {
    title: heading(text), showlegend: false, hovermode: "closest", margin: { l: 64, r: 12, t: 36, b: 48 },
    xaxis: { ...AXIS, ...BELOW, title: { text: x }, ...xaxis }, yaxis: { ...AXIS, title: { text: y }, ...yaxis }, ...more,
  };
}

// A new plot at the end of an element.
function addPlot(id, className, traces, layout, config) {
  const plot = add(element(id), "div", { className });
  return Plotly.newPlot(plot, traces, layout, config).then(() => plot);
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

