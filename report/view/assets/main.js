// The page: reads the catalogue, and ties time, room and scopes together.

import { catalogue, growth } from "./api.js";
import { cameraControls, TimeControls } from "./controls.js";
import { Columns, Feed } from "./feed.js";
import { Layouts } from "./layouts.js";
import { Newest } from "./newest.js";
import { Picker } from "./picker.js";
import { PACES, Playback } from "./playback.js";
import { Room } from "./room.js";
import { hear, RunControls } from "./run.js";
import { defaultPlots, Scopes } from "./scopes.js";

// Pause between two questions for the growth of a recording that is being written.
const GROWTH_MS = 500;
// The same for a run without a pace where the processor draws: all plots are drawn anew at each growth.
const FREE_GROWTH_MS = 2000;
const GROWING = "The recording is not finished: End goes to its newest second.";
const UNFINISHED = "The run has ended without finishing its recording: the page shows what was written.";
const FINISHED_MS = 3000;
// Time between two drawings of a run without a pace, in which nobody sees single ticks. Where the processor draws, each takes cores from the run.
const FREE_MS = 50;
const FREE_BY_PROCESSOR_MS = 200;
const BY_PROCESSOR_MS = 33;
// Time between two writings of the vehicles' places.
const PLACES_MS = 100;
const HELD = "The run is paused: the room shows its last recorded second.";
const AWAITED = "Nothing is recorded yet: the recorder writes each second of simulated time.";
const state = document.getElementById("state");
// Kept for people at the console and for tests.
const shown = { timeNs: null, vehicles: [], frames: 0, isFlat: false, scopesDrawn: false };
window.hummingbus = { shown };

/** Says what went wrong or what goes on; each speaker has one text at a time, and two with the same text say it once. */
const texts = new Map();
function reporter(speaker) {
  return (text) => {
    texts.set(speaker, text);
    const said = [...new Set(texts.values())].filter(Boolean).join(" ");
    if (state.textContent !== said) state.textContent = said;
  };
}

/** The plots that the address names, or those that the recordings start with. */
function plotsOf(recordings) {
  try {
    const named = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    return named.plots.map((plot) => plot.map(([recording, topic, field]) => ({ recording, topic, field })));
  } catch {
    return defaultPlots(recordings);
  }
}

/** Names of vehicles, no two alike: with the recording's where there are two. */
function label(room, recordings) {
  for (const body of room.vehicles) {
    const recording = recordings.length > 1 ? recordings[body.recording].name : "";
    body.label = [body.name, recording].filter(Boolean).join(" of ") || body.vehicle.body?.name || body.vehicle.state;
  }
}

/** The list of vehicles with their places. */
function legend(room) {
  const lines = room.vehicles.slice(0, 12).map((body) => {
    const line = document.createElement("div");
    const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
    swatch.style.background = body.colour;
    const place = document.createElement("span");
    line.append(swatch, body.label, place);
    return { body, line, place };
  });
  document.getElementById("legend").replaceChildren(...lines.map(({ line }) => line));
  document.getElementById("legend").hidden = lines.length === 0;
  let [isDue, writtenMs] = [false, -Infinity];
  const write = () => {
    for (const { body, place } of lines) {
      const { x, y, z } = body.group.position;
      const text = body.isKnown ? `x ${x.toFixed(2)}  y ${y.toFixed(2)}  z ${z.toFixed(2)} m` : "not there yet";
      if (place.textContent !== text) place.textContent = text;
    }
  };
  return {
    /** The vehicles have moved. */
    move: () => (isDue = true),
    /** Writes their places, unless that was a moment ago: a page that lays out text in each frame draws late. */
    write: (nowMs) => {
      if (!isDue || nowMs - writtenMs < PLACES_MS) return;
      [isDue, writtenMs] = [false, nowMs];
      write();
    },
  };
}

function head(recordings, isLive) {
  const names = recordings.map(({ name }) => name).join(" against ");
  document.getElementById("title").textContent = names;
  document.title = `${names} · hummingbus view`;
  // That a live run is not finished needs no words.
  const notes = recordings.flatMap(({ cut, notes }) => (cut && !isLive ? [cut, ...notes] : notes));
  const list = document.getElementById("notes");
  list.hidden = notes.length === 0;
  list.replaceChildren(...notes.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
}

/**
 * Follows recordings that grow, until their writers have finished them; `grown` hears of each growth, and of new topics.
 * `periodMs` is the pause between two questions.
 */
async function follow(recordings, run, report, periodMs, grown) {
  const goesOn = () => recordings.some((recording) => recording.is_growing);
  let overMs = null;
  const reportGrowing = () => {
    if (run.status === null || !run.isOver) return report(GROWING);
    // A recorder that ended with its run has finished the file soon.
    overMs ??= performance.now();
    return report(performance.now() - overMs < FINISHED_MS ? "" : UNFINISHED);
  };
  if (goesOn()) reportGrowing();
  while (goesOn()) {
    await new Promise((resolve) => setTimeout(resolve, periodMs()));
    try {
      const { news, isNew } = await newsOf(recordings);
      const hasGrown = isNew || news.some((one, number) => one.duration_ns !== recordings[number].duration_ns || !one.is_growing);
      news.forEach((one, number) => Object.assign(recordings[number], one));
      if (hasGrown) grown(isNew);
      reportGrowing();
    } catch (error) {
      report(error.message);
    }
  }
  report([...new Set(recordings.map(({ damage }) => damage).filter(Boolean))].join(" "));
}

/** The growth of the recordings; their catalogues, where there are topics that had no message before. */
async function newsOf(recordings) {
  const grown = await growth();
  const isNew = grown.some(({ topics }, number) => topics !== recordings[number].topics.length);
  const catalogues = isNew ? (await catalogue()).recordings : [];
  const news = grown.map(({ topics, ...rest }, number) => ({ ...rest, ...catalogues[number], is_growing: rest.is_growing }));
  return { news, isNew };
}

/** The recordings, once there is one: a live run has none before its first second. */
async function awaited(report) {
  for (;;) {
    const { recordings, refusal } = await catalogue();
    report(recordings.length ? "" : refusal ?? AWAITED);
    if (recordings.length) return recordings;
    await new Promise((resolve) => setTimeout(resolve, GROWTH_MS));
  }
}

/** Hears of the live run from now on; waits for the first news. */
function hearOf(run) {
  const [reportServer, reportHeld] = [reporter("server"), reporter("held")];
  let starts = null;
  // The newest sample of a paused run is shown, unless nobody has watched it before. A page that shows an earlier time is not behind.
  const isBehind = () => {
    const { newest, playback } = window.hummingbus;
    return run.status?.state === "paused" && newest?.isMissing && playback.isFollowing;
  };
  return new Promise((isHeard) => {
    hear((told) => {
      // A run that has gone back begins another recording; the plots are in the address.
      if (starts !== null && told.starts > starts && starts > 0) location.reload();
      starts = told.starts;
      run.take(told.run, told.take_overs);
      reportHeld(isBehind() ? HELD : "");
      isHeard();
    }, reportServer);
  });
}

async function start() {
  const run = new RunControls();
  window.hummingbus.run = run;
  if ((await catalogue()).is_live) await hearOf(run);
  const recordings = await awaited(reporter("start"));
  head(recordings, run.status !== null);
  const durationNs = Math.max(...recordings.map((recording) => recording.duration_ns));
  const playback = new Playback(durationNs, recordings[0].tick_ns ?? 1e6);
  const columns = recordings.map((recording) => new Columns(recording));
  const asked = new URLSearchParams(location.search);
  const options = { flat: asked.has("flat"), smooth: asked.has("smooth") };
  const room = new Room(document.getElementById("space"), recordings, columns, options);
  label(room, recordings);
  const feeds = recordings.map((recording, number) => new Feed(number, recording, columns[number].fields, reporter(`values ${number}`)));
  const note = document.getElementById("room-note");
  note.hidden = !room.isFlat;
  note.textContent = "This browser has no WebGL: the room is painted plainly.";
  let places = legend(room);
  let isStale = true;
  const camera = cameraControls(room, () => (isStale = true));
  new TimeControls(playback, recordings[0].start_s);
  const picker = new Picker(recordings);
  const keep = (plots) => history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify({ plots }))}`);
  const scopes = new Scopes(recordings, playback, picker, plotsOf(recordings), { report: reporter("scopes"), changed: keep, liveMarks: run.marks });
  new Layouts(scopes);
  playback.onChange(() => (isStale = true));
  Object.assign(window.hummingbus, { playback, room, scopes });
  shown.isFlat = room.isFlat;

  const newest = new Newest(columns[0].fields, () => scopes.feeds[0].fields, reporter("newest"));
  window.hummingbus.newest = newest;
  const isAhead = () => playback.isFollowing && newest.rows !== null;
  const periodMs = () => {
    if (run.status.pace === "free") return room.isByProcessor ? FREE_BY_PROCESSOR_MS : FREE_MS;
    return room.isByProcessor ? BY_PROCESSOR_MS : 0;
  };
  let shownNewest = null;
  const show = () => {
    shownNewest = isAhead() ? newest.rows : null;
    const rows = isAhead() ? [newest.rows.room] : feeds.map((feed) => feed.row(playback));
    if (rows.every(Boolean)) {
      // The newest rows are drawn once.
      isStale = playback.isPlaying && !isAhead();
      shown.timeNs = rows[0].timeNs;
    }
    room.update(rows, isAhead() ? [playback.timeNs] : feeds.map((feed) => Math.min(playback.timeNs, feed.durationNs)));
    scopes.newest = isAhead() ? newest.rows.scopes : null;
    places.move();
    shown.vehicles = room.vehicles.map(({ name, recording, group, isKnown }) => (
      { name, recording, isKnown, position: group.position.toArray(), attitude: group.quaternion.toArray() }));
    scopes.showTime();
  };
  playback.seek((Number(asked.get("t")) - recordings[0].start_s) * 1e9 || 0);
  playback.isGrowing = recordings.some((recording) => recording.is_growing);
  if (playback.isGrowing && !asked.has("t")) {
    // A live recording is shown at its newest time, and goes on.
    playback.seek(durationNs);
    playback.toggle();
  }
  const learn = () => {
    columns.forEach((known, number) => known.learn(recordings[number]));
    room.learn();
    feeds.forEach((feed) => feed.widen());
    label(room, recordings);
    places = legend(room);
    camera.learn();
    head(recordings, run.status !== null);
    isStale = true;
  };
  const isFree = () => run.status?.state === "running" && run.status.pace === "free";
  const growthMs = () => (isFree() && room.isByProcessor ? FREE_GROWTH_MS : GROWTH_MS);
  follow(recordings, run, reporter("growth"), growthMs, (isNew) => {
    if (isNew) learn();
    const isGrowing = recordings.some((recording) => recording.is_growing);
    playback.grow(Math.max(...recordings.map((recording) => recording.duration_ns)), isGrowing);
    feeds.forEach((feed, number) => feed.grow(recordings[number].duration_ns));
    scopes.grow();
    room.grow();
  });
  run.onPace((pace) => {
    const factor = pace === "realtime" ? 1 : Number(pace);
    if (PACES.includes(factor)) playback.setPace(factor);
  });
  let last = performance.now();
  const frame = (now) => {
    playback.pass(now - last);
    last = now;
    // The live run has one recording.
    if (run.status && !run.isOver && playback.isFollowing && recordings.length === 1) newest.ask(({ timeNs }) => playback.reach(timeNs), periodMs());
    else newest.rows = null;
    if (isStale || (isAhead() && newest.rows !== shownNewest)) show();
    else scopes.showLate();
    places.write(now);
    if (room.draw()) shown.frames += 1;
    shown.scopesDrawn = scopes.isDrawn ?? false;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

start().catch((error) => {
  state.textContent = `The page cannot show this: ${error.message}`;
  state.className = "wrong";
  window.hummingbus.error = String(error.stack ?? error);
});
