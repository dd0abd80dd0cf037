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
    timeline: document.querySelector("#timeline .xtitle").textContent,
    buttons: [...document.querySelectorAll("#timeline .modebar-btn")].map((button) => button.dataset.title),
    ticks: document.getElementById("tick").options.length,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}

const seen = await withPage(pathToFileURL(file).href, async (page, wrong) => {
  await page.waitForSelector("#timeline .cartesianlayer path");
  const first = await page.evaluate(look);
  if (screenshot) await page.screenshot({ path: screenshot, fullPage: true });
  await page.select("#tick", String(first.ticks - 1));
  const last = await page.evaluate(look);
  return { first, last, schemes: await schemes(page), wrong };
});
console.log(JSON.stringify(seen));
