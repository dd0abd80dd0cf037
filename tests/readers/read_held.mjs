// Pauses a run before its page is opened, opens the page, steps the run on it, and prints as JSON what the page shows then.
// Usage: read_held.mjs ADDRESS

import { withPage } from "./browser.mjs";

const LOOK_MS = 50;
const REST_MS = 500;
const [address] = process.argv.slice(2);
const headers = { "content-type": "application/json" };
const answered = async (name, options) => (await fetch(new URL(`api/${name}`, address), options)).json();
const steer = (request) => answered("ctl", { method: "POST", headers, body: JSON.stringify({ request }) });

// The room has a second to show.
while ((await answered("growth")).length === 0) await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
const { tick } = await steer("pause");

const seen = await withPage(address, async (page, wrong) => {
  const awaitHeld = (isWanted) => page.waitForFunction(
    (wanted) => document.getElementById("state").textContent.includes("its last recorded second") === wanted, { polling: LOOK_MS }, isWanted);
  const look = () => page.evaluate(() => ({ timeNs: window.hummingbus.shown.timeNs, tick: window.hummingbus.run.status.tick }));
  const found = { tick };
  await awaitHeld(true);
  await page.waitForFunction(() => window.hummingbus.shown.timeNs !== null, { polling: LOOK_MS });
  found.held = await look();
  // Whoever looks at an earlier time is not told so.
  await page.evaluate(() => window.hummingbus.playback.seek(300e6));
  await awaitHeld(false);
  await page.keyboard.press("End");
  await awaitHeld(true);
  // The time of a late frame may lie before it was asked for.
  found.wentBack = await page.evaluate(() => {
    const { playback } = window.hummingbus;
    const before = playback.timeNs;
    playback.pass(-500);
    return before - playback.timeNs;
  });
  await page.click("#run-step");
  await page.waitForFunction((wanted) => Math.round(window.hummingbus.shown.timeNs / 1e6) === wanted, { polling: LOOK_MS }, tick);
  await page.waitForFunction((wanted) => window.hummingbus.run.status.tick === wanted, { polling: LOOK_MS }, tick + 1);
  await awaitHeld(false);
  found.stepped = await look();
  // Nothing is new in a paused run: the page rests, and draws no more.
  await page.waitForFunction((restMs) => new Promise((resolve) => {
    const { frames } = window.hummingbus.shown;
    setTimeout(() => resolve(window.hummingbus.shown.frames === frames), restMs);
  }), { polling: LOOK_MS }, REST_MS);
  found.isAtRest = await page.evaluate(() => window.hummingbus.newest.rows !== null);
  await steer("stop");
  await page.waitForFunction(() => window.hummingbus.run.status.state === "ended", { polling: LOOK_MS });
  found.wrong = wrong;
  return found;
});
console.log(JSON.stringify(seen));
