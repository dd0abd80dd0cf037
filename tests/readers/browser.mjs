// A browser that reaches nothing but this machine. HUMMINGBUS_READERS names the folder that holds node_modules.

import { accessSync, constants } from "node:fs";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

const require = createRequire(join(process.env.HUMMINGBUS_READERS, "package.json"));
const puppeteer = require("puppeteer-core");

const NAMES = ["chromium", "chromium-browser", "google-chrome"];
const PATIENCE_MS = 180_000;
// WebGL by the processor on every machine: whether a build of Chromium falls back to it by itself depends on its version
// and on whether it finds a graphics card.
const ARGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

function isExecutable(path) {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}

function findBrowser() {
  const folders = (process.env.PATH ?? "").split(delimiter);
  const path = NAMES.flatMap((name) => folders.map((folder) => join(folder, name))).find(isExecutable);
  if (!path) throw new Error(`there is no browser: none of ${NAMES.join(", ")} is in PATH; install Debian's chromium`);
  return path;
}

/** Ends with words where the page has no WebGL 2: what then comes of the page says nothing about the page. */
async function requireWebGl(browser, page) {
  if (await page.evaluate(() => document.createElement("canvas").getContext("webgl2") !== null)) return;
  const started = [findBrowser(), ...ARGS].join(" ");
  throw new Error(
    `this reader needs WebGL 2, and the browser has none: ${await browser.version()}, started as ${started}; ` +
      "the page chrome://gpu of this browser says why; install another version, or add the flag that it asks for in tests/readers/browser.mjs",
  );
}

const isLocal = (url) => /^(file|data|blob):/.test(url) || new URL(url).hostname === "127.0.0.1";

/**
 * Opens `url` and calls `use` with the page and a list of what went wrong in it: errors, and requests that would have
 * left this machine, which are refused. `before` runs in the page in front of its own scripts; `needsWebGl` says that
 * without WebGL there is nothing to look at.
 */
export async function withPage(url, use, { before, needsWebGl = false } = {}) {
  const args = [...ARGS, ...(process.getuid() === 0 ? ["--no-sandbox"] : [])];
  const browser = await puppeteer.launch({ executablePath: findBrowser(), args, timeout: PATIENCE_MS });
  try {
    const page = await browser.newPage();
    page.setDefaultTimeout(PATIENCE_MS);
    await page.setViewport({ width: 1280, height: 1000 });
    const wrong = [];
    page.on("pageerror", (error) => wrong.push(String(error)));
    page.on("request", (request) => {
      if (isLocal(request.url())) return request.continue();
      wrong.push(`request of ${request.url()}`);
      return request.abort();
    });
    await page.setRequestInterception(true);
    if (before) await page.evaluateOnNewDocument(before);
    await page.goto(url, { waitUntil: "load" });
    if (needsWebGl) await requireWebGl(browser, page);
    return await use(page, wrong);
  } finally {
    await browser.close();
  }
}

/** Whether every plot lies on the colour of the page. */
function isOnPage() {
  const colour = (place) => getComputedStyle(place).backgroundColor;
  const grounds = [...document.querySelectorAll(".js-plotly-plot")].map((plot) => colour(plot.querySelector(".main-svg")));
  return grounds.length > 0 && grounds.every((ground) => ground === colour(document.body));
}

/**
 * The colours of the page, of its letters and of its first mark, in a dark and then in a light browser: the open page
 * follows the change, once its plots have it, too.
 */
export async function schemes(page) {
  const seen = {};
  for (const value of ["dark", "light"]) {
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value }]);
    await page.waitForFunction(isOnPage);
    seen[value] = await page.evaluate(() => {
      const { backgroundColor: ground, color: ink } = getComputedStyle(document.body);
      const { stroke, fill } = getComputedStyle(document.querySelector(".cartesianlayer .trace path"));
      return { ground, ink, mark: [stroke, fill] };
    });
  }
  return seen;
}
