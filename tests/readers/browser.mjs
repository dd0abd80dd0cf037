// A browser that reaches nothing but this machine. HUMMINGBUS_READERS names the folder that holds node_modules.

import { accessSync, constants } from "node:fs";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

const require = createRequire(join(process.env.HUMMINGBUS_READERS, "package.json"));
const puppeteer = require("puppeteer-core");

const NAMES = ["chromium", "chromium-browser", "google-chrome"];
const PATIENCE_MS = 180_000;

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

const isLocal = (url) => /^(file|data|blob):/.test(url) || new URL(url).hostname === "127.0.0.1";

/**
 * Opens `url` and calls `use` with the page and a list of what went wrong in it: errors, and requests that would have
 * left this machine, which are refused. `before` runs in the page in front of its own scripts.
 */
export async function withPage(url, use, before) {
  const args = ["--disable-gpu", ...(process.getuid() === 0 ? ["--no-sandbox"] : [])];
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
    return await use(page, wrong);
  } finally {
    await browser.close();
  }
}
