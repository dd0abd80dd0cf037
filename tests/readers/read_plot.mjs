// Prints as JSON what a browser draws of a recording's page. Usage: read_plot.mjs PAGE [needs-webgl] [no-webgl] [SCREENSHOT.png]
// `needs-webgl` fails where the browser has no WebGL, `no-webgl` takes it away from the page.

import { pathToFileURL } from "node:url";
import { schemes, withPage } from "./browser.mjs";

const [file, ...rest] = process.argv.slice(2);
const withoutWebGl = rest.includes("no-webgl");
const screenshot = rest.find((word) => word.endsWith(".png"));

/** Returns the drawn parts: titles and lines of each flat plot, traces and number of colours of the space. */
function look() {
  const shown = (id) => !document.getElementById(id).hidden && document.getElementById(id).data !== undefined;
  const extent = (path) => path.getBBox().width > 0 || path.getBBox().height > 0;
  const line = (plot) => (trace, index) => ({
    name: trace.name, points: plot._fullData[index].x.length, dash: plot._fullData[index].line?.dash ?? null,
    y: trace.y.slice(0, 1).concat(trace.y.slice(-1)), mode: trace.mode,
  });
  const flat = (plot) => ({
    title: plot.layout.title.text,
    x: plot.querySelector(".xtitle").textContent,
    y: plot.querySelector(".ytitle").textContent,
    // Without those that have no points and only name others in the legend.
    lines: plot.data.map(line(plot)).filter((_, index) => plot.data[index].meta !== "legend"),
    // plotly.js has a layer of its own for each level that lines lie on.
    drawn: [...plot.querySelectorAll("g.trace.scatter")].filter((trace) => [...trace.querySelectorAll("path")].some(extent)).length,
    dashed: [...plot.querySelectorAll("g.trace.scatter .lines path")].filter((path) => path.style.strokeDasharray).length,
    legend: [...plot.querySelectorAll(".legendtext")].map((text) => text.textContent),
    buttons: [...plot.querySelectorAll(".modebar-btn")].map((button) => button.dataset.title),
    range: plot._fullLayout.xaxis.range,
    metre: [plot._fullLayout.xaxis, plot._fullLayout.yaxis].map((axis) => axis._length / Math.abs(axis.range[1] - axis.range[0])),
  });
  return {
    title: document.querySelector("h1").textContent,
    summary: document.getElementById("summary").textContent,
    vehicles: [...document.getElementById("vehicle").options].map((option) => option.text),
    axes: [...document.querySelectorAll("#time > .js-plotly-plot")].map(flat),
    views: ["top", "side"].filter(shown).map((id) => flat(document.getElementById(id))),
    space: shown("path") ? document.getElementById("path").data.map(({ type, name }) => `${type} ${name}`) : null,
    note: document.getElementById("space-note").textContent,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}

/** The colours of the picture of the space: a blank canvas has one. */
async function colours(page) {
  return page.evaluate(async () => {
    const source = await Plotly.toImage(document.getElementById("path"), { format: "png", width: 600, height: 400 });
    const image = new Image();
    image.src = source;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: 600, height: 400 });
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const dots = new Uint32Array(context.getImageData(0, 0, 600, 400).data.buffer);
    const count = new Map();
    for (const dot of dots) count.set(dot, (count.get(dot) ?? 0) + 1);
    // Red, green and blue of those that cover more than a few dots.
    const seen = [...count].filter(([, dots]) => dots > 15).map(([dot]) => [dot & 255, (dot >> 8) & 255, (dot >> 16) & 255]);
    return seen;
  });
}

/** Drags over a part of the first plot, as a hand does; the ranges of time of all plots after it. */
async function zoom(page) {
  const drag = await page.$("#time > .js-plotly-plot .nsewdrag");
  await drag.scrollIntoView();
  const box = await drag.boundingBox();
  const at = (part) => [box.x + part * box.width, box.y + box.height / 2];
  await page.mouse.move(...at(0.25));
  await page.mouse.down();
  await page.mouse.move(...at(0.5), { steps: 5 });
  await page.mouse.up();
  const isZoomed = () => [...document.querySelectorAll("#time > .js-plotly-plot")]
    .every((plot) => plot._fullLayout.xaxis.range[0] > 0.1);
  await page.waitForFunction(isZoomed);
  return page.evaluate(() => [...document.querySelectorAll("#time > .js-plotly-plot")].map((plot) => plot._fullLayout.xaxis.range));
}

/** Titles of the plots in which the lowest label of one axis lies over the first one of the other, with a label at either end. */
async function corners() {
  const titles = [];
  for (const plot of document.querySelectorAll("#time > .js-plotly-plot")) {
    await Plotly.relayout(plot, { "yaxis.range": [-30, 30], "yaxis.dtick": 10, "xaxis.range": [0, 1] });
    const [low, first] = [".ytick text", ".xtick text"].map((name) => plot.querySelector(name).getBoundingClientRect());
    if (low.bottom > first.top && low.right > first.left) titles.push(plot.layout.title.text);
  }
  return titles;
}

async function change(page) {
  await page.select("#vehicle", "1");
  await page.waitForFunction(() =>
    [...document.getElementById("time").children].every((plot) => plot.querySelector("g.trace.scatter path")));
}

const refuseWebGl = () => {
  const real = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return String(kind).includes("webgl") ? null : real.call(this, kind, ...more);
  };
};

const seen = await withPage(pathToFileURL(file).href, async (page, wrong) => {
  await page.waitForSelector("body[data-drawn=true]");
  const first = await page.evaluate(look);
  const space = first.space ? await colours(page) : null;
  if (screenshot) await page.screenshot({ path: screenshot, fullPage: true });
  const zoomed = first.axes.length ? await zoom(page) : null;
  if (first.vehicles.length > 1) await change(page);
  const second = first.vehicles.length > 1 ? await page.evaluate(look) : null;
  const followed = first.axes.length ? await schemes(page) : null;
  const range = first.axes.length ? await page.evaluate(() => document.querySelector("#time > .js-plotly-plot")._fullLayout.xaxis.range) : null;
  return { ...first, colours: space, zoomed, second, schemes: followed, range, corners: await page.evaluate(corners), wrong };
}, { before: withoutWebGl ? refuseWebGl : undefined, needsWebGl: rest.includes("needs-webgl") });
console.log(JSON.stringify(seen));
