// Stores pictures of a page of `hummingbus view` at evenly spaced times of its recording, for an animation.
// Usage: shoot_view.mjs ADDRESS FOLDER

import { join } from "node:path";
import { withPage } from "./browser.mjs";

const [address, folder] = process.argv.slice(2);
const [FROM_S, TO_S, STEP_S] = [4, 40, 0.5];

await withPage(address, async (page, wrong) => {
  await page.setViewport({ width: 960, height: 560 });
  await page.waitForFunction(() => window.hummingbus?.error || window.hummingbus?.shown.scopesDrawn, { polling: 50 });
  let number = 0;
  for (let timeS = FROM_S; timeS < TO_S; timeS += STEP_S) {
    await page.evaluate((timeNs) => window.hummingbus.playback.seek(timeNs), timeS * 1e9);
    await page.waitForFunction((timeNs) => Math.abs(window.hummingbus.shown.timeNs - timeNs) < 2e6, { polling: 20 }, timeS * 1e9);
    // The picture is drawn in the frame behind the one that took the values.
    await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    await page.screenshot({ path: join(folder, `frame-${String(number).padStart(3, "0")}.png`) });
    number += 1;
  }
  if (wrong.length) throw new Error(wrong.join("\n"));
}, { needsWebGl: true });
