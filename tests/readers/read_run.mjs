// Steers a live run through its page as a person does, and prints as JSON what the page shows then.
// Usage: read_run.mjs ADDRESS [dark] [WIDTHxHEIGHT] [shots=FOLDER]

import { join } from "node:path";
import { withPage } from "./browser.mjs";

const [address, ...rest] = process.argv.slice(2);
const shots = rest.find((word) => word.startsWith("shots="))?.slice(6);
const [width, height] = (rest.find((word) => /^\d+x\d+$/.test(word)) ?? "1280x900").split("x").map(Number);

const seen = await withPage(address, async (page, wrong) => {
  const said = [];
  page.on("console", (message) => message.type() === "error" && said.push(message.text()));
  await page.setViewport({ width, height });
  if (rest.includes("dark")) await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "dark" }]);
  const look = (on = page) => on.evaluate(() => ({
    ...window.hummingbus.run.status,
    shown: document.getElementById("run-state").textContent,
    facts: document.getElementById("run-tick").textContent,
    answer: document.getElementById("run-answer").textContent,
    isWrong: document.getElementById("run-answer").classList.contains("wrong"),
    button: document.getElementById("run-pause").textContent,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  }));
  const shoot = async (name) => shots && page.screenshot({ path: join(shots, `${name}-${width}.png`) });
  // A page in the background draws no frames, at which the test would look.
  const awaitState = (state, on = page) => on.waitForFunction((wanted) => window.hummingbus?.run?.status?.state === wanted, { polling: 50 }, state);
  const awaitAnswer = (part, id = "run-answer") => page.waitForFunction(([text, place]) => document.getElementById(place).textContent.includes(text), {}, [part, id]);
  const awaitTick = (tick) => page.waitForFunction((wanted) => window.hummingbus.run.status.tick === wanted, {}, tick);
  const blur = () => page.evaluate(() => document.activeElement?.blur());

  const found = {};
  await awaitState("running");
  await page.waitForFunction(() => window.hummingbus.shown.timeNs !== null);
  found.running = await look();
  await shoot("running");

  // The schedule, which asks the server while it is open.
  await page.click("#schedule > summary");
  await page.waitForFunction(() => document.querySelectorAll("#schedule-rows tr").length > 3 && document.getElementById("schedule-facts").textContent.includes("takes"));
  // On a busy machine some are measured before the others, whose bars lie at the beginning until then.
  await page.waitForFunction(() => {
    const rows = [...document.querySelectorAll("#schedule-rows tr")];
    const isMeasured = (name) => rows.some((row) => row.cells[0].textContent === name && row.cells[7].textContent !== "–");
    const lefts = new Set([...document.querySelectorAll("#schedule-rows .bar")].map((bar) => bar.getBoundingClientRect().left));
    return lefts.size > 1 && ["plant", "imu", "ekf", "controller"].every(isMeasured);
  });
  found.schedule = await page.evaluate(() => ({
    rows: [...document.querySelectorAll("#schedule-rows tr")].map((row) => [...row.cells].map((cell) => cell.textContent)),
    left: Object.fromEntries([...document.querySelectorAll("#schedule-rows tr")].map((row) => [row.cells[0].textContent, row.querySelector(".bar").getBoundingClientRect().left])),
    facts: document.getElementById("schedule-facts").textContent,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  }));
  await shoot("schedule");
  await page.click("#schedule > summary");

  // With the mouse.
  await page.click("#run-pause");
  await awaitAnswer("paused at tick");
  await awaitState("paused");
  found.paused = await look();
  // The room shows the last sample before the pause, not the last that is recorded.
  await page.waitForFunction((tick) => Math.round(window.hummingbus.shown.timeNs / 1e6) === tick - 1, { polling: 50 }, found.paused.tick);
  await page.click("#run-step");
  await awaitTick(found.paused.tick + 1);

  // With keys alone.
  await blur();
  await page.keyboard.press("s");
  await awaitTick(found.paused.tick + 2);
  await page.keyboard.press("S");
  await awaitTick(found.paused.tick + 102);
  const type = async (id, text) => {
    await page.focus(id);
    await page.evaluate((place) => document.querySelector(place).select(), id);
    await page.keyboard.type(text);
  };
  await type("#run-ticks", "7");
  await page.keyboard.press("Enter");
  await awaitTick(found.paused.tick + 109);
  await awaitAnswer("7 ticks on");
  found.stepped = await look();
  await shoot("stepped");
  await type("#run-ticks", "900000000");
  await page.keyboard.press("Enter");
  await awaitAnswer("Refused");
  found.refused = await look();
  await type("#run-ticks", "0");
  await page.keyboard.press("Enter");
  await awaitAnswer("at least 1");
  found.zero = await look();
  await shoot("refused");

  await page.focus("#run-pace");
  await page.select("#run-pace", "2");
  await page.waitForFunction(() => window.hummingbus.run.status.pace === "2");
  found.playbackPace = await page.evaluate(() => window.hummingbus.playback.pace);
  await blur();
  await page.keyboard.press("r");
  await page.waitForFunction(() => window.hummingbus.run.status.pace === "realtime");
  await page.keyboard.press("p");
  await awaitState("running");

  // A backup whose description is no TOML, one that cannot be, and one that takes over.
  await page.focus("#run-swap");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#swap[open]");
  await page.select("#swap-process", "controller");
  await type("#swap-with", "kind = ");
  await page.focus("#swap-yes");
  await page.keyboard.press("Enter");
  await awaitAnswer("Refused", "swap-answer");
  found.noToml = await page.$eval("#swap-answer", (answer) => answer.textContent);
  await shoot("swap");
  await type("#swap-with", 'kind = "nothing"');
  await page.focus("#swap-yes");
  await page.keyboard.press("Enter");
  await awaitAnswer("nothing", "swap-answer");
  found.noKind = await page.$eval("#swap-answer", (answer) => answer.textContent);
  await type("#swap-with", 'kind = "pid"');
  await page.focus("#swap-yes");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => !document.getElementById("swap").open);
  // The server tells all pages of it.
  const swaps = () => (window.hummingbus.scopes?.marks ?? []).filter(({ kind }) => kind === "swap");
  await page.waitForFunction(`(${swaps})().length > 0`);
  found.marks = await page.evaluate(swaps);
  found.swapped = await look();

  // A sensor whose measurements come at other ticks, which is warned of.
  await page.focus("#run-swap");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#swap[open]");
  await page.select("#swap-process", "mocap");
  await type("#swap-with", "parameters.rate_hz = 20.0");
  await page.focus("#swap-yes");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => !document.getElementById("swap").open);
  found.warned = await look();

  // A second page sees what the first one asked for.
  const other = await page.browser().newPage();
  await other.goto(address, { waitUntil: "load" });
  await awaitState("running", other);
  await other.waitForFunction(`(${swaps})().length > 1`);
  found.otherMarks = await other.evaluate(swaps);
  await page.bringToFront();
  await blur();
  await page.keyboard.press("p");
  // Each page has the news in its own time.
  await awaitState("paused", other);
  await awaitState("paused");
  found.other = await look(other);
  await other.close();

  await blur();
  await page.keyboard.press("x");
  await page.waitForSelector("#stop[open]");
  await shoot("stop");
  // The one that changes nothing has the focus.
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => !document.getElementById("stop").open);
  found.kept = await look();
  await page.keyboard.press("x");
  await page.waitForSelector("#stop[open]");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await awaitState("ended");
  await page.waitForFunction(() => !window.hummingbus.playback.isGrowing && document.querySelector("#state").textContent === "");
  found.ended = await look();
  found.disabled = await page.$$eval("#run-buttons :is(button, select, input)", (all) => all.map(({ disabled }) => disabled));
  found.endNs = await page.evaluate(() => window.hummingbus.playback.durationNs);
  await shoot("ended");
  found.wrong = [...wrong, ...said];
  return found;
});
console.log(JSON.stringify(seen));
