// Prints as JSON what a browser draws of a campaign's page, 1200 pixels wide. Usage: read_campaign.mjs PAGE

import { pathToFileURL } from "node:url";
import { schemes, withPage } from "./browser.mjs";

const [file] = process.argv.slice(2);
const WIDTH = 1200;

/** Returns the cells of the tables, the titles of the axes, the pixels by which the page or a table is too wide, and those by which a
 * title is higher than its plot. */
function look() {
  const rows = (id) => [...document.querySelectorAll(`#${id} tr`)].map((row) => [...row.cells].map((cell) => cell.textContent));
  const text = (name) => document.querySelector(name)?.textContent ?? "";
  // The lines of a title have no spaces between them.
  const title = (name) => {
    const lines = [...(document.querySelector(name)?.querySelectorAll("tspan") ?? [])].map((line) => line.textContent);
    return lines.length ? lines.join(" ") : text(name);
  };
  const height = (name) => document.querySelector(name)?.getBoundingClientRect().height ?? Infinity;
  const boxes = [document.documentElement, ...document.querySelectorAll(".scroll")];
  return {
    tables: Object.fromEntries(["failures", "figures", "choices", "influences", "rates", "worst"].map((id) => [id, rows(id)])),
    summary: text("#summary"),
    axes: { histogram: text("#histogram .xtitle"), scatter: title("#scatter .ytitle") },
    tooHigh: Math.max(0, height("#scatter .ytitle") - height("#scatter .main-svg")),
    overflow: Math.max(...boxes.map((box) => box.scrollWidth - box.clientWidth)),
  };
}

const seen = await withPage(pathToFileURL(file).href, async (page, wrong) => {
  await page.setViewport({ width: WIDTH, height: 1000 });
  await page.waitForSelector("#scatter .cartesianlayer path");
  // Plots take the new width a moment after the window; one that stays too wide is told as such.
  let seen = await page.evaluate(look);
  for (let turn = 0; turn < 50 && seen.overflow > 0; turn += 1) {
    await new Promise((resolve) => setTimeout(resolve, 100));
    seen = await page.evaluate(look);
  }
  return { ...seen, schemes: await schemes(page), wrong };
});
console.log(JSON.stringify(seen));
