// Prints as JSON how long the frames of a page of `hummingbus view` take in a browser, in milliseconds.
// Usage: read_frames.mjs ADDRESS SECONDS  or  read_frames.mjs ADDRESS end [slow]
// With SECONDS it plays a recording for so long, from its start; with `end` it says `ready` once it draws, and watches a live run
// to its end. A `slow` page draws once a second: it asks the server for as much, and leaves the cores to the run.

import { withPage } from "./browser.mjs";

const [address, span, rate] = process.argv.slice(2);

/** Notes when each frame begins, from now on. */
const note = () => {
  window.noted = [];
  const frame = (now) => {
    window.noted.push(now);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
};

const drawSeldom = () => {
  window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 1000);
};

const seen = await withPage(address, async (page, wrong) => {
  await page.setViewport({ width: 1280, height: 900 });
  await page.waitForFunction(() => window.hummingbus?.error || window.hummingbus?.shown.scopesDrawn, { polling: 50 });
  if (span !== "end") {
    await page.evaluate(() => {
      window.hummingbus.playback.seek(0);
      if (!window.hummingbus.playback.isPlaying) window.hummingbus.playback.toggle();
    });
    await page.waitForFunction(() => window.hummingbus.shown.timeNs > 0);
  }
  const drawn = await page.evaluate(() => window.hummingbus.shown.frames);
  await page.evaluate(note);
  if (span === "end") {
    console.log("ready");
    await page.waitForFunction(() => window.hummingbus.run.status?.state === "ended", { polling: 50 });
  } else await new Promise((resolve) => setTimeout(resolve, Number(span) * 1000));
  const found = await page.evaluate(() => ({
    starts: window.noted,
    drawn: window.hummingbus.shown.frames,
    vehicles: window.hummingbus.shown.vehicles.length,
    isFlat: window.hummingbus.shown.isFlat,
  }));
  return { ...found, drawn: found.drawn - drawn, wrong };
}, { before: rate === "slow" ? drawSeldom : undefined });
const times = seen.starts.slice(1).map((start, index) => start - seen.starts[index]).sort((a, b) => a - b);
const quantile = (part) => times[Math.min(Math.floor(part * times.length), times.length - 1)] ?? null;
const { starts, ...rest } = seen;
console.log(JSON.stringify({ ...rest, frames: times.length, p50: quantile(0.5), p95: quantile(0.95), p99: quantile(0.99), max: quantile(1) }));
