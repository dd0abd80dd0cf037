// Flies a run by hand through its page: with a slider, with keys and with a gamepad. Prints as JSON what the page shows.
// Usage: read_hand.mjs ADDRESS [WIDTHxHEIGHT] [shots=FOLDER]

import { join } from "node:path";
import { withPage } from "./browser.mjs";

const [address, ...rest] = process.argv.slice(2);
const shots = rest.find((word) => word.startsWith("shots="))?.slice(6);
const [width, height] = (rest.find((word) => /^\d+x\d+$/.test(word)) ?? "1280x900").split("x").map(Number);

/** A gamepad of the standard layout, whose axes the test moves. */
const plugIn = () => {
  window.pad = { id: "Test pad (STANDARD GAMEPAD)", index: 0, connected: false, mapping: "standard", axes: [0, 0, 0, 0], buttons: [] };
  navigator.getGamepads = () => [null, window.pad];
};

const seen = await withPage(address, async (page, wrong) => {
  const said = [];
  page.on("console", (message) => message.type() === "error" && said.push(message.text()));
  await page.setViewport({ width, height });
  const look = () => page.evaluate(() => ({
    ...window.hummingbus.run.hand.asked,
    isOn: document.getElementById("hand-on").checked,
    sent: window.hummingbus.run.hand.sent,
    pad: document.getElementById("hand-pad").textContent,
    said: document.getElementById("hand-say").textContent,
    tilt: document.getElementById("hand-roll").max,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  }));
  // Until the run has had time to take some of it.
  const sendSome = async () => {
    const { sent } = await look();
    await page.waitForFunction((before) => window.hummingbus.run.hand.sent >= before + 20, {}, sent);
  };
  const shoot = async (name) => shots && page.screenshot({ path: join(shots, `${name}-${width}.png`) });
  const found = {};
  await page.waitForFunction(() => window.hummingbus?.run?.hand.operators.length === 1 && window.hummingbus.shown.timeNs !== null);

  // Keys alone: open, switch on, move a slider.
  await page.focus("#hand > summary");
  await page.keyboard.press("Enter");
  found.before = await look();
  await page.focus("#hand-on");
  await page.keyboard.press("Space");
  await page.focus("#hand-altitude");
  await page.keyboard.press("End");
  await sendSome();
  found.slider = await look();
  await page.evaluate(() => document.activeElement.blur());
  await page.keyboard.down("j");
  await sendSome();
  found.held = await look();
  await page.keyboard.up("j");
  await sendSome();
  found.released = await look();

  await page.evaluate(() => {
    window.pad.connected = true;
    window.pad.axes = [0, 0, 0.05, -0.5];
  });
  await sendSome();
  found.gamepad = await look();
  await shoot("hand");
  await page.evaluate(() => (window.pad.axes = [-1, 1, 0, 0]));
  await page.waitForFunction(() => window.hummingbus.run.hand.asked.yaw > 20 && window.hummingbus.run.hand.asked.altitude < 3.9);
  found.left = await look();
  await page.evaluate(() => {
    window.pad.connected = false;
    dispatchEvent(new Event("gamepaddisconnected"));
  });
  found.gone = await look();
  await new Promise((resolve) => setTimeout(resolve, 400));
  found.later = await look();
  await shoot("gone");
  found.wrong = [...wrong, ...said];
  // Time for the fallback to be recorded.
  const { tick } = await page.evaluate(() => window.hummingbus.run.status);
  await page.waitForFunction((from) => window.hummingbus.run.status.tick > from + 100, {}, tick);
  await page.keyboard.press("x");
  await page.waitForSelector("#stop[open]");
  await page.click("#stop-yes");
  await page.waitForFunction(() => window.hummingbus.run.status.state === "ended");
  return found;
}, { before: plugIn });
console.log(JSON.stringify(seen));
