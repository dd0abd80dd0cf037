// Buttons, slider and keys of time, and the choices of the camera.

import { PACES } from "./playback.js";
import { LAYERS } from "./room.js";

const get = (id) => document.getElementById(id);

function option(value, text) {
  return Object.assign(document.createElement("option"), { value, textContent: text });
}

/** A time as people read it: seconds, from a minute on with minutes, from an hour on with hours. */
export function timeText(seconds, decimals) {
  // Rounded before it is split: 59.96 s are 1:00.0, not 0:60.0.
  const rounded = Number(seconds.toFixed(decimals));
  const [hours, minutes] = [Math.floor(rounded / 3600), Math.floor(rounded / 60) % 60];
  if (rounded < 60) return `${rounded.toFixed(decimals)} s`;
  const part = (rounded - 60 * Math.floor(rounded / 60)).toFixed(decimals).padStart(decimals ? decimals + 3 : 2, "0");
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${part}` : `${minutes}:${part}`;
}

export class TimeControls {
  constructor(playback, startS) {
    Object.assign(this, { playback, startS, slider: get("slider") });
    this.decimals = Math.min(Math.max(Math.ceil(-Math.log10(playback.tickNs * 1e-9)), 0), 6);
    get("pace").append(...PACES.map((pace) => option(pace, `×${pace}`)));
    get("pace").value = playback.pace;
    this.#listen();
    this.#keys();
    playback.onChange(() => this.#show());
    this.#show();
  }

  #listen() {
    const { playback, slider } = this;
    slider.addEventListener("input", () => playback.seek(slider.value * playback.tickNs));
    get("play").addEventListener("click", () => playback.toggle());
    get("back").addEventListener("click", () => playback.step(-1));
    get("forward").addEventListener("click", () => playback.step(1));
    get("pace").addEventListener("change", (event) => playback.setPace(Number(event.target.value)));
  }

  #keys() {
    const { playback } = this;
    const ticksOfSecond = Math.max(Math.round(1e9 / playback.tickNs), 1);
    const paceAt = (step) => PACES[Math.min(Math.max(PACES.indexOf(playback.pace) + step, 0), PACES.length - 1)];
    const keys = {
      " ": () => playback.toggle(),
      ArrowLeft: ({ shiftKey }) => playback.step(shiftKey ? -ticksOfSecond : -1),
      ArrowRight: ({ shiftKey }) => playback.step(shiftKey ? ticksOfSecond : 1),
      Home: () => playback.seek(0),
      End: () => playback.seek(playback.durationNs),
      "-": () => playback.setPace(paceAt(-1)),
      "+": () => playback.setPace(paceAt(1)),
    };
    document.addEventListener("keydown", (event) => {
      const { target } = event;
      // These do something of their own with keys. A button does with the space bar alone, a slider with all but it.
      const isTyping = target.closest("select, dialog[open], summary, input:not([type=range])");
      const isOwn = event.key === " " ? target.closest("button") : target.closest("input[type=range]");
      if (isTyping || isOwn || event.ctrlKey || event.altKey || event.metaKey || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key](event);
    });
  }

  #show() {
    const { playback, slider } = this;
    const seconds = this.startS + playback.timeNs * 1e-9;
    const text = timeText(seconds, this.decimals);
    slider.max = Math.max(Math.round(playback.durationNs / playback.tickNs), 1);
    slider.value = Math.round(playback.timeNs / playback.tickNs);
    slider.setAttribute("aria-valuetext", text);
    get("clock").children[0].textContent = text;
    get("clock").children[1].textContent = ` of ${timeText(this.startS + playback.durationNs * 1e-9, 1)}`;
    get("play").textContent = playback.isPlaying ? "Pause" : "Play";
    get("pace").value = playback.pace;
  }
}

/** The choices of camera, vehicle and layers; `changed` hears that something else is to be shown. `learn` takes new vehicles. */
export function cameraControls(room, changed) {
  const [mode, vehicle] = [get("camera-mode"), get("camera-vehicle")];
  const modes = [...mode.children];
  const learn = () => {
    vehicle.replaceChildren(...room.vehicles.map((body, index) => option(index, body.label)));
    vehicle.value = room.followed;
    get("camera-vehicle-label").hidden = room.vehicles.length < 2;
    const hasVehicles = room.vehicles.length > 0;
    mode.replaceChildren(...(hasVehicles ? modes : [option("free", "free")]));
    mode.value = hasVehicles ? room.mode : "free";
  };
  learn();
  get("camera").hidden = false;
  const change = () => {
    room.setMode(mode.value, Number(vehicle.value) || 0);
    changed();
  };
  mode.addEventListener("change", change);
  vehicle.addEventListener("change", () => {
    room.hasSeen = false;
    change();
  });
  for (const [key, [text]] of Object.entries(LAYERS)) {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: room.layers[key] });
    box.addEventListener("change", () => {
      room.layers[key] = box.checked;
      changed();
    });
    const label = document.createElement("label");
    label.append(box, ` ${text}`);
    get("layer-list").append(label);
  }
  return { learn };
}
