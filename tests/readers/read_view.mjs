// Prints as JSON what a browser shows of recordings that `hummingbus view` serves.
// Usage: read_view.mjs ADDRESS [no-webgl] [dark] [WIDTHxHEIGHT] [SCREENSHOT.png] [end=PID] [T_NS…]
//    or: read_view.mjs ADDRESS live=PID
//    or: read_view.mjs ADDRESS late=NAME ready=FILE
// `end` ends the server, to see what the page says then; `live` follows a live run, and ends that. `late` waits for a
// vehicle that comes after FILE is there, although the first question for it fails.

import { writeFileSync } from "node:fs";
import { withPage } from "./browser.mjs";

const [address, ...rest] = process.argv.slice(2);
const screenshot = rest.find((word) => word.endsWith(".png"));
const server = Number(rest.find((word) => word.startsWith("end="))?.slice(4) ?? 0);
const run = Number(rest.find((word) => word.startsWith("live="))?.slice(5) ?? 0);
const late = rest.find((word) => word.startsWith("late="))?.slice(5);
const ready = rest.find((word) => word.startsWith("ready="))?.slice(6);
const times = rest.filter((word) => /^\d+$/.test(word)).map(Number);
const [width, height] = (rest.find((word) => /^\d+x\d+$/.test(word)) ?? "1280x900").split("x").map(Number);

const refuseWebGl = () => {
  const real = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return String(kind).includes("webgl") ? null : real.call(this, kind, ...more);
  };
};

const isShown = (timeNs) => window.hummingbus.shown.timeNs === timeNs;

/** The poses at a time that was gone to. */
async function poses(page, timeNs) {
  await page.evaluate((time) => window.hummingbus.playback.seek(time), timeNs);
  await page.waitForFunction(isShown, {}, timeNs);
  return page.evaluate(() => structuredClone(window.hummingbus.shown.vehicles));
}

/** The colours of the room that cover more than a few dots. */
async function colours(page) {
  return page.evaluate(() => {
    const { canvas, room } = { canvas: window.hummingbus.room.canvas, room: window.hummingbus.room };
    room.isStale = true;
    room.draw();
    const copy = Object.assign(document.createElement("canvas"), { width: 300, height: 200 });
    const context = copy.getContext("2d");
    context.drawImage(canvas, 0, 0, 300, 200);
    const dots = new Uint32Array(context.getImageData(0, 0, 300, 200).data.buffer);
    const count = new Map();
    for (const dot of dots) count.set(dot, (count.get(dot) ?? 0) + 1);
    return [...count.values()].filter((dots) => dots > 5).length;
  });
}

/** Keys alone: play, pause, step, end, home. */
async function keys(page) {
  const time = () => page.evaluate(() => window.hummingbus.playback.timeNs);
  await page.evaluate(() => document.activeElement?.blur());
  await page.keyboard.press("Home");
  const home = await time();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowRight");
  const stepped = await time();
  await page.keyboard.press("ArrowLeft");
  const back = await time();
  await page.keyboard.press("Space");
  await page.waitForFunction((from) => window.hummingbus.playback.timeNs > from + 3e8 && window.hummingbus.shown.timeNs > from, {}, back);
  await page.keyboard.press("Space");
  const paused = await time();
  await new Promise((resolve) => setTimeout(resolve, 200));
  const still = await time();
  await page.keyboard.press("End");
  const end = await time();
  await page.keyboard.press("Home");
  return { home, stepped, back, paused, still, end };
}

/** Zooms a plot with the mouse and goes back with a double click; the windows in seconds. */
async function zoom(page) {
  const over = await page.$(".plot .u-over");
  await over.scrollIntoView();
  const box = await over.boundingBox();
  const at = (part) => [box.x + part * box.width, box.y + box.height / 2];
  await page.mouse.move(...at(0.25));
  await page.mouse.down();
  await page.mouse.move(...at(0.5), { steps: 5 });
  await page.mouse.up();
  await page.waitForFunction(() => window.hummingbus.scopes.window !== null);
  const zoomed = await page.evaluate(() => window.hummingbus.scopes.window);
  await page.click("#whole");
  await page.waitForFunction(() => window.hummingbus.scopes.window === null);
  return zoomed;
}

/** Zooms with keys alone, at 1 s of the recording: the windows in seconds. */
async function zoomKeys(page) {
  const shown = () => page.evaluate(() => window.hummingbus.scopes.window);
  await page.evaluate(() => {
    document.activeElement?.blur();
    window.hummingbus.playback.seek(1e9);
  });
  const windows = [];
  for (const key of ["z", "z", "Z", "w", "z", "Z"]) {
    if (key === "Z") await page.keyboard.down("Shift");
    await page.keyboard.press(key);
    if (key === "Z") await page.keyboard.up("Shift");
    windows.push(await shown());
  }
  await page.keyboard.press("Home");
  return windows;
}

/** Adds a plot of a field that is searched for, with the keyboard alone. */
async function pick(page, words) {
  const count = await page.evaluate(() => window.hummingbus.scopes.plots.length);
  await page.focus("#add-plot");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#picker[open]");
  await page.keyboard.type(words);
  await page.keyboard.press("Tab");
  await page.keyboard.press("Space");
  await page.focus("#picker-done");
  await page.keyboard.press("Enter");
  await page.waitForFunction((before) => window.hummingbus.scopes.plots.length > before, {}, count);
  return page.evaluate(() => window.hummingbus.scopes.layout().at(-1));
}

/** Ends the server; the words of the page about it. */
async function lose(page) {
  process.kill(server);
  await page.evaluate(() => window.hummingbus.playback.step(7));
  // The text of that moment: an answer from before the end may come after it.
  const told = await page.waitForFunction(() => {
    const { textContent } = document.querySelector("#state");
    return textContent.includes("does not answer") && textContent;
  });
  return told.jsonValue();
}

/** Follows a live run for two of its seconds, and to its end. */
async function live(page) {
  const look = () => page.evaluate(() => {
    const { playback, shown, room } = window.hummingbus;
    return { timeNs: shown.timeNs, durationNs: playback.durationNs, isPlaying: playback.isPlaying, isGrowing: playback.isGrowing, isKnown: room.vehicles[0].isKnown };
  });
  const first = await look();
  // Near the newest, however late a busy machine draws.
  await page.waitForFunction((from) => {
    const { playback, shown } = window.hummingbus;
    return shown.timeNs >= from + 2e9 && playback.durationNs - shown.timeNs < 4e9;
  }, {}, first.timeNs);
  const later = await look();
  // Space holds the page alone: its curves end where they ended, while the run and its recording go on.
  const ends = () => page.evaluate(() => {
    const { playback, scopes } = window.hummingbus;
    return { isPlaying: playback.isPlaying, endS: scopes.endS, durationNs: playback.durationNs };
  });
  await page.evaluate(() => document.activeElement?.blur());
  await page.keyboard.press("Space");
  await page.waitForFunction(() => !window.hummingbus.playback.isPlaying && !window.hummingbus.scopes.newest);
  const held = await ends();
  await page.waitForFunction((from) => window.hummingbus.playback.durationNs > from + 1e9, {}, held.durationNs);
  const stillHeld = await ends();
  await page.keyboard.press("Space");
  await page.waitForFunction((from) => window.hummingbus.scopes.endS > from, {}, held.endS);
  process.kill(run);
  await page.waitForFunction(() => !window.hummingbus.playback.isGrowing && document.querySelector("#state").textContent === "");
  return { first, later, held, stillHeld, last: await look() };
}

/** Waits for a vehicle that comes late; names of those that are shown then. */
async function lateVehicle(page) {
  await page.evaluate(() => {
    const real = window.fetch;
    window.refused = 0;
    window.fetch = (path, options) => {
      if (window.refused > 0 || !String(path).includes("catalogue")) return real(path, options);
      window.refused += 1;
      return Promise.reject(new TypeError("refused by the test"));
    };
  });
  writeFileSync(ready, "");
  await page.waitForFunction((name) => window.hummingbus.shown.vehicles.some((vehicle) => vehicle.name === name && vehicle.isKnown), {}, late);
  return page.evaluate(() => ({
    vehicles: window.hummingbus.shown.vehicles.map(({ name, isKnown, position }) => ({ name, isKnown, height_m: position[2] })),
    choices: [...document.getElementById("camera-vehicle").options].map(({ textContent }) => textContent),
    lines: [...document.getElementById("legend").children].length,
    refused: window.refused,
  }));
}

/** Each plot's curves: names, how many points are drawn, the extremes. */
function curvesShown() {
  const spread = (line) => line.reduce(([low, high], value) => (value === null ? [low, high] : [Math.min(low, value), Math.max(high, value)]), [Infinity, -Infinity]);
  return window.hummingbus.scopes.plots.map((plot) => plot.curves.map((curve, index) => {
    const line = plot.drawing.data[index + 1];
    return { recording: curve.recording, topic: curve.topic, field: curve.field, unit: curve.unit, points: line.filter((value) => value !== null).length, spread: spread(line) };
  }));
}

/** Lengths of the arrows of commands on the rotors of each vehicle, 0 where none is seen, and the estimate of a shadow. */
function arrowsShown() {
  const length = ({ visible, line, cone }) => (visible ? line.scale.y + cone.scale.y : 0);
  return window.hummingbus.room.vehicles.map(({ vehicle, propellers, shadowBelieved }) => ({
    map: vehicle.body?.command,
    command: propellers.map(({ command }) => length(command)),
    shadow: propellers.map(({ shadow }) => length(shadow)),
    estimate: shadowBelieved.visible ? shadowBelieved.position.toArray() : null,
  }));
}

/** The wind in the corner, seen along x of the world: its text, and its arrow across and up. */
function windShown() {
  const { room } = window.hummingbus;
  const before = room.camera.position.clone();
  room.setMode("free");
  room.camera.position.copy(room.controls.target).add({ x: -5, y: 0, z: 0 });
  room.draw();
  const place = document.getElementById("wind");
  const shown = { text: place.hidden ? null : place.textContent.trim(), seen: room.wind.seen, line: place.querySelector("path").getAttribute("d") };
  room.camera.position.copy(before);
  room.setMode("follow");
  return shown;
}

const options = { before: rest.includes("no-webgl") ? refuseWebGl : undefined };
const seen = await withPage(address, async (page, wrong) => {
  const said = [];
  page.on("console", (message) => message.type() === "error" && said.push(message.text()));
  await page.setViewport({ width, height });
  if (rest.includes("dark")) await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "dark" }]);
  await page.waitForFunction(() => window.hummingbus?.error || (window.hummingbus?.shown.timeNs !== null && window.hummingbus?.shown.scopesDrawn));
  const error = await page.evaluate(() => window.hummingbus.error ?? null);
  if (error) throw new Error(error);
  if (late) return { ...(await lateVehicle(page)), wrong: [...wrong, ...said] };
  if (run) return { ...(await live(page)), wrong: [...wrong, ...said] };
  const shown = [];
  for (const timeNs of times) shown.push(await poses(page, timeNs));
  const found = {
    title: await page.$eval("#title", (title) => title.textContent),
    notes: await page.$eval("#notes", (notes) => notes.textContent),
    state: await page.$eval("#state", (state) => state.textContent),
    isFlat: await page.evaluate(() => window.hummingbus.shown.isFlat),
    overflow: await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth),
    images: await page.evaluate(() => document.images.length),
    legend: await page.$eval("#legend", (legend) => legend.textContent),
    poses: shown,
    colours: await colours(page),
    arrows: await page.evaluate(arrowsShown),
    wind: await page.evaluate(windShown),
    plots: await page.evaluate(curvesShown),
    heads: await page.evaluate(() => [...document.querySelectorAll(".plot-head")].map((head) => head.textContent)),
    values: await page.evaluate(() => [...document.querySelectorAll(".plot-head .value")].map((value) => value.textContent)),
  };
  if (screenshot) await page.screenshot({ path: screenshot });
  Object.assign(found, { keys: await keys(page), zoomed: await zoom(page), zoomedByKeys: await zoomKeys(page), picked: await pick(page, "plant/state position.z") });
  found.wrong = [...wrong, ...said];
  return server ? { ...found, lost: await lose(page) } : found;
}, options);
console.log(JSON.stringify(seen));
