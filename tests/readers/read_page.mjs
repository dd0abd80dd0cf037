// Prints as JSON what a browser draws of a profile's page. Usage: read_page.mjs PAGE [SCREENSHOT.png]

import { pathToFileURL } from "node:url";
import { schemes, withPage } from "./browser.mjs";

const [file, screenshot] = process.argv.slice(2);

/** Returns the drawn parts: for each plot the number of marks that have an extent, for each table its rows. */
function look() {
  const extent = (mark) => {
    const box = mark.getBBox();
    return box.width > 0 || box.height > 0;
  };
  const marks = (plot) => [...plot.querySelectorAll(".cartesianlayer .trace path")].filter(extent).length;
  const tables = [...document.querySelectorAll("table")].map((table) => [table.id, table.rows.length]);
  return {
    title: document.querySelector("h1").textContent,
    plots: [...document.querySelectorAll(".js-plotly-plot")].map(marks),
    tables: Object.fromEntries(tables),
    timeline: document.querySelector("#timeline .gtitle").textContent,
    buttons: [...document.querySelectorAll("#timeline .modebar-btn")].map((button) => button.dataset.title),
    ticks: document.getElementById("tick").options.length,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}

/** Returns the titles that leave their plot, and how far the page is wider than its window. */
function lookNarrow() {
  const isCut = (text) => {
    const [inner, outer] = [text.getBoundingClientRect(), text.closest(".js-plotly-plot").getBoundingClientRect()];
    return inner.left < outer.left - 1 || inner.right > outer.right + 1;
  };
  const titles = [...document.querySelectorAll(".js-plotly-plot :is(.gtitle, .xtitle, .ytitle)")];
  return {
    cut: titles.filter(isCut).map((text) => text.textContent),
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}

/** Whether the plots have the width of the page. */
const isResized = () => [...document.querySelectorAll(".js-plotly-plot")].every((plot) =>
  Math.abs(plot.querySelector(".main-svg").getBoundingClientRect().width - plot.clientWidth) < 1);

const seen = await withPage(pathToFileURL(file).href, async (page, wrong) => {
  await page.waitForSelector("#timeline .cartesianlayer path");
  const first = await page.evaluate(look);
  if (screenshot) await page.screenshot({ path: screenshot, fullPage: true });
  await page.select("#tick", String(first.ticks - 1));
  const last = await page.evaluate(look);
  const colours = await schemes(page);
  await page.setViewport({ width: 390, height: 844 });
  await page.waitForFunction(isResized);
  return { first, last, schemes: colours, narrow: await page.evaluate(lookNarrow), wrong };
});
console.log(JSON.stringify(seen));
