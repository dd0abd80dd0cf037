// Prints as JSON what a browser draws of an identification's page. Usage: read_identify.mjs PAGE [SCREENSHOT.png]

import { pathToFileURL } from "node:url";
import { schemes, withPage } from "./browser.mjs";

const [file, screenshot] = process.argv.slice(2);
const PLOTS = ["residual", "sides", "against", "agreement", "auto", "cross"];
// Pixels in which the table of effects has to fit.
const WIDTH = 1200;
const CHOICES = ["flight", "equation", "component", "input"];

/** Returns the drawn parts: each plot's title, axes and number of marks that have an extent; each table's rows. */
function look([plots, choices]) {
  const extent = (mark) => {
    const box = mark.getBBox();
    return box.width > 0 || box.height > 0;
  };
  const text = (plot, name) => plot.querySelector(name)?.textContent ?? "";
  const seen = (plot) => ({
    title: text(plot, ".gtitle"), x: text(plot, ".xtitle"), y: text(plot, ".ytitle"),
    marks: [...plot.querySelectorAll(".cartesianlayer .trace path")].filter(extent).length,
  });
  const chosen = (id) => document.getElementById(id).selectedOptions[0].textContent;
  return {
    title: document.querySelector("h1").textContent,
    verdict: document.getElementById("verdict").textContent,
    answer: document.getElementById("answer").textContent,
    brief: Object.fromEntries(["missing", "certainty", "changes", "next"].map((id) => [id, [...document.querySelectorAll(`#${id} > li`)].map((item) => item.textContent)])),
    errors: [...document.querySelectorAll("#errors .js-plotly-plot")].map(seen),
    plots: Object.fromEntries(plots.map((id) => [id, seen(document.getElementById(id))])),
    tables: Object.fromEntries([...document.querySelectorAll("table")].map((table) => [table.id, table.rows.length])),
    chosen: Object.fromEntries(choices.map((id) => [id, chosen(id)])),
    buttons: [...document.querySelectorAll("#residual .modebar-btn")].map((button) => button.dataset.title),
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}

/** Returns the pixels by which the table of effects is wider than its place. */
function attributionOverflow() {
  const place = document.getElementById("effects").parentElement;
  return place.scrollWidth - place.clientWidth;
}

/** Chooses the last of each selector, from the first selector on, since each offers what the one before leaves. */
async function chooseLast(page) {
  for (const id of CHOICES) {
    const count = await page.$eval(`#${id}`, (select) => select.options.length);
    await page.select(`#${id}`, String(count - 1));
  }
}

const seen = await withPage(pathToFileURL(file).href, async (page, wrong) => {
  await page.waitForSelector("#cross .cartesianlayer path");
  const first = await page.evaluate(look, [PLOTS, CHOICES]);
  if (screenshot) await page.screenshot({ path: screenshot, fullPage: true });
  await chooseLast(page);
  const last = await page.evaluate(look, [PLOTS, CHOICES]);
  await page.setViewport({ width: WIDTH, height: 1000 });
  const attribution = await page.evaluate(attributionOverflow);
  return { first, last, attribution, schemes: await schemes(page), wrong };
});
console.log(JSON.stringify(seen));
