// Prints as JSON how long the frames of a page of `hummingbus view` take in a browser, in milliseconds: the time from one to the
// next, the time until its scripts have ended, and the processor's time of the page's own thread per frame. The rest is drawn by
// other threads, or by a graphics card.
// Usage: read_frames.mjs ADDRESS SECONDS  or  read_frames.mjs ADDRESS end [slow]
// With SECONDS it plays a recording for so long, from its start; with `end` it says `ready` once it draws, and watches a live run
// to its end. A `slow` page draws once a second: it asks the server for as much, and leaves the cores to the run.

import { withPage } from "./browser.mjs";

const [address, span, rate] = process.argv.slice(2);

/** Notes when each frame begins, and how long its scripts compute. */
const note = () => {
  const real = window.requestAnimationFrame.bind(window);
  window.noted = [];
  window.requestAnimationFrame = (draw) => real((now) => {
    const begin = performance.now();
    draw(now);
    const spent = performance.now() - begin;
    const last = window.noted.at(-1);
    // The scripts of one frame begin at one time.
    if (last?.start === now) last.spent += spent;
    else window.noted.push({ start: now, spent });
  });
};

const drawSeldom = () => {
  window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 1000);
};

/** These functions, one after the other, as a script of the page. */
const script = (...parts) => parts.map((part) => `(${part})();`).join("\n");


const seen = await withPage(address, async (page, wrong) => {
  await page.setViewport({ width: 1280, height: 900 });
  await page.waitForFunction(() => window.hummingbus?.error || window.hummingbus?.shown.scopesDrawn, { polling: 50 });
  const client = await page.createCDPSession();
  await client.send("Performance.enable", { timeDomain: "threadTicks" });
  const busyMs = async () => 1000 * (await client.send("Performance.getMetrics")).metrics.find(({ name }) => name === "TaskDuration").value;
  const busyBefore = await busyMs();
  const drawn = await page.evaluate((plays) => {
    const { playback, shown } = window.hummingbus;
    if (plays) {
      // Slowly: on the busiest machine, too, the recording lasts until the figures are asked for.
      playback.setPace(0.2);
      playback.seek(0);
      if (!playback.isPlaying) playback.toggle();
    }
    window.noted.length = 0;
    return shown.frames;
  }, span !== "end");
  if (span === "end") {
    console.log("ready");
    await page.waitForFunction(() => window.hummingbus.run.status?.state === "ended", { polling: 50 });
  } else await new Promise((resolve) => setTimeout(resolve, Number(span) * 1000));
  const found = await page.evaluate(() => ({
    noted: window.noted,
    isPlaying: window.hummingbus.playback.isPlaying,
    drawn: window.hummingbus.shown.frames,
    vehicles: window.hummingbus.shown.vehicles.length,
    isFlat: window.hummingbus.shown.isFlat,
    isSmooth: window.hummingbus.room.renderer.getContext().getContextAttributes().antialias,
  }));
  return { ...found, drawn: found.drawn - drawn, cpu: ((await busyMs()) - busyBefore) / found.noted.length, wrong };
}, { before: rate === "slow" ? script(drawSeldom, note) : script(note) });

/** Quantiles of some times. */
function quantiles(times) {
  const sorted = times.toSorted((a, b) => a - b);
  const at = (part) => sorted[Math.min(Math.floor(part * sorted.length), sorted.length - 1)] ?? null;
  return { min: at(0), p50: at(0.5), p95: at(0.95), p99: at(0.99), max: at(1) };
}

const { noted, ...rest } = seen;
const times = noted.slice(1).map(({ start }, index) => start - noted[index].start);
console.log(JSON.stringify({ ...rest, frames: times.length, ...quantiles(times), script: quantiles(noted.map(({ spent }) => spent)) }));
