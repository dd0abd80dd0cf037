// The wind at a vehicle, as an arrow in the corner of the room, turned as the camera sees it.

import * as THREE from "./vendor/three.min.js";

const HALF = 20;
const HEAD = 8;
// An arrow so short points to the eye or away from it: its dot alone is drawn.
const SHORT = 0.08;

export class WindArrow {
  constructor(place) {
    this.place = place;
    [this.shaft, this.text] = [place.querySelector("path"), place.querySelector("span")];
    // What is shown now: across and up on the screen, as parts of the wind's speed.
    this.seen = null;
  }

  /** Shows `wind`, as the catalogue has it of a vehicle, to a camera with this attitude; null hides it. */
  show(wind, attitude) {
    if (this.place.hidden !== !wind) this.place.hidden = !wind;
    this.seen = wind ? this.#across(wind, attitude) : null;
    if (!wind) return;
    const speed = Math.hypot(...wind.velocity_m_s);
    const text = [speed > 0 ? `wind ${speed.toFixed(1)} m/s` : "", wind.has_gusts ? "gusts" : ""].filter(Boolean).join(" and ");
    if (this.text.textContent !== text) this.text.textContent = text;
    const [across, up] = this.seen;
    const drawn = Math.hypot(across, up) < SHORT ? "" : arrow(across, -up);
    if (this.shaft.getAttribute("d") !== drawn) this.shaft.setAttribute("d", drawn);
  }

  #across({ velocity_m_s: velocity }, attitude) {
    const seen = new THREE.Vector3(...velocity).normalize().applyQuaternion(attitude.clone().invert());
    return [seen.x, seen.y];
  }
}

/** The lines of an arrow along (x, y) on a picture, whose length is at most 1. */
function arrow(x, y) {
  const point = (along, aside) => {
    const length = Math.hypot(x, y);
    const [unitX, unitY] = [x / length, y / length];
    return `${(along * unitX - aside * unitY).toFixed(1)} ${(along * unitY + aside * unitX).toFixed(1)}`;
  };
  const tip = HALF * Math.hypot(x, y);
  const head = Math.min(HEAD, 2 * tip);
  return `M${point(-tip, 0)}L${point(tip, 0)}M${point(tip - head, head / 2)}L${point(tip, 0)}L${point(tip - head, -head / 2)}`;
}
