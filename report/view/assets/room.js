// The room: scene, vehicles and their paths in space, seen by a camera.

import * as THREE from "./vendor/three.min.js";
import { frames } from "./api.js";
import { VehicleBody } from "./body.js";
import { FlatRenderer } from "./flat.js";
import { curveColour, onTheme, pageColour } from "./palette.js";
import { WindArrow } from "./wind.js";

const PATH_POINTS = 3000;
// Not the colour of the path, which hides it in a vehicle that follows well.
const PLAN = 0xcc79a7;
// A path that spreads over more blocks of the file is drawn around the time that is shown.
const PATH_BLOCKS = 200;
// It is read again and again of a recording that grows.
const PATH_BLOCKS_GROWING = 60;
// Pause in front of the reading of a path: times that a slider passes are not read.
const PATH_CALM_MS = 120;
// Time between two readings while the newest samples are shown: the path goes on with these. Each reading unpacks a minute of the recording.
const PATH_AGAIN_MS = 5000;
// Places of a live run behind the end of its recording.
const TAIL_POINTS = 1200;
const ABOARD = new THREE.Vector3(0.02, 0, 0.09);
const AHEAD = new THREE.Vector3(1, 0, 0);
// The first place of the camera, seen from a vehicle, in multiples of its reach.
const FIRST_LOOK = new THREE.Vector3(-7, -7, 7);

// Names of programs that draw by the processor, as browsers report them.
const BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|basic render/i;

/** True if the processor draws what `context` draws. */
function isByProcessor(context) {
  const names = context.getExtension("WEBGL_debug_renderer_info");
  return BY_PROCESSOR.test(context.getParameter(names?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER));
}

/** Names of the layers beside the bodies, and if they are shown from the start. */
export const LAYERS = {
  path: ["path", true],
  plan: ["planned path", true],
  thrust: ["thrust", true],
  command: ["motor commands", true],
  shadow: ["shadow", true],
  asked: ["set point", true],
  estimate: ["estimate", true],
  beams: ["range beams", true],
  walls: ["wall estimates", true],
  wind: ["wind", true],
  axes: ["axes", true],
  grid: ["grid", true],
};

export class Room {
  /** `flat` paints on a flat canvas; `smooth` has smooth edges also where the processor draws. */
  constructor(canvas, recordings, columns, { flat = false, smooth = false } = {}) {
    Object.assign(this, { canvas, recordings, mode: "follow", followed: 0 });
    this.layers = Object.fromEntries(Object.entries(LAYERS).map(([key, [, isOn]]) => [key, isOn]));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.02, 2000);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(-2, -2, 2);
    this.#renderer(flat, smooth);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => (this.isStale = true));
    this.wind = new WindArrow(document.getElementById("wind"));
    this.#lights();
    this.#solids();
    this.columns = columns;
    this.vehicles = [];
    this.#vehicles();
    this.#placeBodies();
    this.#grid();
    onTheme(() => this.#paint());
    this.#paint();
    new ResizeObserver(() => this.#resize()).observe(this.canvas.parentElement);
    this.#resize();
    this.#lookAtAll();
  }

  #renderer(flat, smooth) {
    // Another canvas is asked first: one that was asked for WebGL is lost for a flat drawing.
    const context = document.createElement("canvas").getContext("webgl2");
    this.isFlat = flat || !context;
    // Without a graphics card, smooth edges and fine pixels take the cores that a run needs.
    this.isByProcessor = !smooth && (this.isFlat || isByProcessor(context));
    // A picture of the page is taken between two drawings: without a kept buffer it would be empty.
    const options = { canvas: this.canvas, antialias: !this.isByProcessor, alpha: true, preserveDrawingBuffer: true };
    this.renderer = this.isFlat ? new FlatRenderer(this.canvas) : new THREE.WebGLRenderer(options);
  }

  #lights() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(3, 5, 10);
    this.scene.add(sun);
  }

  /** The fixed objects of the first recording. */
  #solids() {
    this.things = [];
    for (const solid of this.recordings[0].scene) this.scene.add(this.#solid(solid, 0.22));
    this.bodies = [];
  }

  #solid({ corners, faces, edges }, opacity) {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.Float32BufferAttribute(corners.flat(), 3));
    shape.setIndex(faces.flat());
    const flatShape = shape.toNonIndexed();
    flatShape.computeVertexNormals();
    const mesh = new THREE.Mesh(flatShape, new THREE.MeshLambertMaterial({ transparent: opacity < 1, opacity, side: THREE.DoubleSide, depthWrite: opacity > 0.5 }));
    const outline = new THREE.BufferGeometry();
    outline.setAttribute("position", new THREE.Float32BufferAttribute(edges.flat(2), 3));
    const lines = new THREE.LineSegments(outline, new THREE.LineBasicMaterial());
    this.things.push(mesh.material, lines.material);
    return new THREE.Group().add(mesh, lines);
  }

  /** Takes the vehicles and topics that the recordings have by now: those of a live run come one after the other. */
  learn() {
    this.#vehicles();
    this.#placeBodies();
    this.#paint();
  }

  #vehicles() {
    this.recordings.forEach((recording, number) => {
      for (const vehicle of recording.vehicles) {
        this.#vehicle(vehicle, number, number > 0);
        // The measured flight is shown beside the simulated one.
        const measured = { ...vehicle, name: `${vehicle.name} measured`.trim(), state: vehicle.topics.measured, topics: {}, shadows: {}, wind: null, rotor_speeds: 0 };
        if (measured.state) this.#vehicle(measured, number, true);
      }
    });
  }

  #placeBodies() {
    const { columns } = this;
    const { bodies } = this.recordings[0];
    const known = this.bodies.length;
    this.bodies.push(...(bodies?.solids ?? []).slice(known).map((solid) => this.#solid(solid, 0.9)));
    if (this.bodies.length > known) this.scene.add(...this.bodies.slice(known));
    this.bodyPlaces = this.bodies.map((_, index) => ({
      position: columns[0].all(bodies.topic, ["x", "y", "z"].map((axis) => `position[${index}].${axis}`)),
      attitude: columns[0].all(bodies.topic, ["x", "y", "z", "w"].map((part) => `attitude[${index}].${part}`)),
    }));
  }

  /** Adds a vehicle, or gives the one of this name its new topics. */
  #vehicle(vehicle, recording, isGhost) {
    const columns = this.columns[recording];
    const known = this.vehicles.find((body) => body.recording === recording && body.name === vehicle.name);
    if (known) {
      known.find(columns, vehicle);
      return;
    }
    const colour = curveColour(this.vehicles.length);
    const body = new VehicleBody(vehicle, columns, colour, isGhost ? colour : null);
    Object.assign(body, { recording, fields: columns.fields, path: this.#path(colour), pathSpan: null, pathRead: null, tail: [] });
    this.scene.add(body.group, body.world, body.path);
    this.vehicles.push(body);
  }

  /** The path of a vehicle: all that was read of it, what is flown by now, what is not recorded yet, and what was planned. */
  #path(colour) {
    const line = (opacity) => {
      const made = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity }));
      made.frustumCulled = false;
      return made;
    };
    const path = new THREE.Group();
    const plan = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineDashedMaterial({ color: PLAN, dashSize: 0.15, gapSize: 0.1 }));
    plan.frustumCulled = false;
    path.add(line(0.3), line(0.9), line(0.9), plan);
    path.children[2].geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TAIL_POINTS), 3));
    path.children[2].geometry.setDrawRange(0, 0);
    path.visible = false;
    return path;
  }

  #grid() {
    const box = new THREE.Box3();
    for (const { corners } of this.recordings[0].scene) for (const corner of corners) box.expandByPoint(new THREE.Vector3(...corner));
    const reach = box.isEmpty() ? 6 : Math.max(...["x", "y"].flatMap((axis) => [Math.abs(box.min[axis]), Math.abs(box.max[axis])]));
    const half = Math.min(Math.max(Math.ceil(reach), 6), 100);
    this.grid = new THREE.GridHelper(2 * half, 2 * half);
    this.grid.rotation.x = Math.PI / 2;
    this.origin = new THREE.AxesHelper(1);
    this.scene.add(this.grid, this.origin);
  }

  /** Takes the colours of the page. */
  #paint() {
    const thing = new THREE.Color(pageColour("thing"));
    for (const material of this.things) material.color.copy(thing);
    const frame = new THREE.Color(pageColour("frame"));
    for (const { frames: materials } of this.vehicles) for (const material of materials) material.color.copy(frame);
    const grid = new THREE.Color(pageColour("grid"));
    // The lines of the grid are coloured corner by corner.
    const colours = this.grid.geometry.attributes.color;
    for (let index = 0; index < colours.count; index += 1) colours.setXYZ(index, grid.r, grid.g, grid.b);
    colours.needsUpdate = true;
    this.isStale = true;
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    const ratio = this.isByProcessor ? Math.min(devicePixelRatio, 1) : devicePixelRatio;
    if (this.isFlat) {
      this.renderer.setSize(width, height, ratio);
    } else {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    // Another size empties the canvas: it is filled before the browser shows it.
    this.isStale = true;
    this.draw();
  }

  /** Without vehicles the camera looks at what stands there. */
  #lookAtAll() {
    if (this.vehicles.length === 0) this.camera.position.set(-8, -8, 8);
    this.controls.update();
  }

  /** Recordings have grown: their paths are read anew. */
  grow() {
    for (const body of this.vehicles) {
      // One that is being read is drawn first: of a slow reader there would be none. The end of a recording does not wait.
      if (body.pathRead && this.recordings[body.recording].is_growing) continue;
      body.pathRead?.abort.abort();
      Object.assign(body, { pathRead: null, pathSpan: null });
    }
  }

  setMode(mode, followed = this.followed) {
    const target = this.vehicles[followed];
    if (this.mode === "board" && mode !== "board" && target) {
      this.camera.position.copy(target.group.position).add(new THREE.Vector3(-1.6, -1.6, 1.4));
      this.controls.target.copy(target.group.position);
    }
    Object.assign(this, { mode, followed, isStale: true });
    this.controls.enabled = mode !== "board";
  }

  /** Moves all to the rows of values of the recordings; null where they are on their way. */
  update(rows, timesNs) {
    for (const body of this.vehicles) {
      const row = rows[body.recording];
      if (!row) continue;
      const turnS = body.timeNs === undefined ? 0 : (row.timeNs - body.timeNs) * 1e-9;
      body.timeNs = row.timeNs;
      const before = body.group.position.clone();
      const wasKnown = body.isKnown;
      body.update(row.values, turnS, this.layers);
      if (this.vehicles[this.followed] === body && body.isKnown) this.#follow(body, before, wasKnown);
      this.#trail(body, timesNs[body.recording], row.isNewest ?? false);
    }
    if (rows[0]) this.#moveBodies(rows[0].values);
    this.grid.visible = this.layers.grid;
    this.origin.visible = this.layers.axes;
    this.isStale = true;
  }

  #moveBodies(values) {
    this.bodyPlaces.forEach(({ position, attitude }, index) => {
      const group = this.bodies[index];
      group.visible = position !== null && position.every((place) => Number.isFinite(values[place]));
      if (!group.visible) return;
      group.position.set(...position.map((place) => values[place]));
      if (attitude) group.quaternion.set(...attitude.map((place) => values[place])).normalize();
    });
  }

  /** Takes the camera along with a vehicle. */
  #follow(body, before, wasKnown) {
    if (this.mode === "free" && this.hasSeen) return;
    const { position } = body.group;
    if (wasKnown && this.hasSeen) this.camera.position.add(position.clone().sub(before));
    else this.camera.position.copy(FIRST_LOOK).multiplyScalar(body.reach).add(position);
    this.hasSeen = true;
    this.controls.target.copy(position);
  }

  /** Shows the path of a vehicle up to this time, once that is read. */
  #trail(body, timeNs, isNewest) {
    body.pathNowNs = timeNs;
    if (!body.position) return;
    const span = body.pathRead?.span ?? body.pathSpan;
    if (!span || timeNs < span[0] || timeNs > span[1]) this.#readPath(body, isNewest);
    this.#extend(body, isNewest);
    this.#flown(body);
  }

  /** Draws the part of the path that is flown by now. A path around another time is hidden. */
  #flown(body) {
    const { pathTimes, pathNowNs, path } = body;
    const isThere = pathTimes !== undefined && pathNowNs >= pathTimes.fromNs && (pathNowNs <= pathTimes.toNs || body.tail.length > 0);
    path.visible = isThere;
    if (!isThere) return;
    const flown = Math.floor((pathNowNs - pathTimes.fromNs) / pathTimes.stepNs) + 1;
    path.children[1].geometry.setDrawRange(0, Math.min(Math.max(flown, 0), pathTimes.count));
    path.children.forEach((line, index) => (line.visible = this.layers[index < 3 ? "path" : "plan"]));
    this.isStale = true;
  }

  /** Goes on with the path of a live run from the end of its recording to the place that is shown. */
  #extend(body, isNewest) {
    const endNs = body.pathTimes?.endNs ?? 0;
    const timeNs = body.pathNowNs;
    // Its first place is that at the end of the path, so that there is no gap.
    const kept = body.tail.filter((place, index, all) => place.timeNs < timeNs && (place.timeNs > endNs || all[index + 1]?.timeNs > endNs));
    body.tail = isNewest ? [...kept, { timeNs, at: body.group.position.clone() }].slice(-TAIL_POINTS) : [];
    const { geometry } = body.path.children[2];
    body.tail.forEach(({ at }, index) => geometry.attributes.position.setXYZ(index, at.x, at.y, at.z));
    geometry.attributes.position.needsUpdate = true;
    geometry.setDrawRange(0, body.tail.length);
  }

  /** The times of a path: all of a short recording, and around the time of a long one. `span` has the times for which it is read. */
  #pathWindow(recording, timeNs) {
    const most = recording.is_growing ? PATH_BLOCKS_GROWING : PATH_BLOCKS;
    const part = Math.min(most / Math.max(recording.blocks, 1), 1);
    const [endNs, spanNs] = [recording.duration_ns, Math.max(recording.duration_ns * part, 1e9)];
    const fromNs = part === 1 ? 0 : Math.max(Math.round(timeNs - 0.7 * spanNs), 0);
    const span = part === 1 ? [0, Infinity] : [fromNs === 0 ? 0 : timeNs - 0.3 * spanNs, fromNs + spanNs];
    const stepNs = Math.max(Math.ceil(spanNs / PATH_POINTS), 1);
    return { span, times: { fromNs, stepNs, count: PATH_POINTS, toNs: part === 1 ? Infinity : fromNs + spanNs, endNs } };
  }

  /** Reads the path of a vehicle, soon. A later reading ends this one. */
  async #readPath(body, isNewest) {
    const recording = this.recordings[body.recording];
    body.pathRead?.abort.abort();
    const read = { span: this.#pathWindow(recording, body.pathNowNs).span, abort: new AbortController() };
    body.pathRead = read;
    const againMs = isNewest ? (body.pathReadMs ?? -Infinity) + PATH_AGAIN_MS - performance.now() : 0;
    await new Promise((resolve) => setTimeout(resolve, Math.max(PATH_CALM_MS, againMs)));
    if (body.pathRead !== read) return;
    body.pathReadMs = performance.now();
    // The recording may have grown meanwhile.
    const { span, times } = this.#pathWindow(recording, body.pathNowNs);
    read.span = span;
    const fields = [...body.position, ...(body.reference ?? [])].map((place) => body.fields[place]);
    try {
      const request = { recording: body.recording, from_ns: times.fromNs, step_ns: times.stepNs, count: PATH_POINTS, fields };
      const values = await frames(request, read.abort.signal);
      if (body.pathRead !== read) return;
      this.#drawPath(body, values, fields.length);
      body.pathTimes = times;
    } catch {
      if (body.pathRead !== read) return;
      body.pathTimes = undefined;
    }
    Object.assign(body, { pathRead: null, pathSpan: span });
    this.#flown(body);
    this.isStale = true;
  }

  #drawPath(body, values, width) {
    const points = (from) => {
      const found = new Float32Array(3 * PATH_POINTS);
      const at = (place, axis) => values[place * width + from + axis];
      // A sample that is not there yet is drawn where the first one is.
      let first = 0;
      while (first < PATH_POINTS - 1 && Number.isNaN(at(first, 0))) first += 1;
      for (let index = 0; index < found.length; index += 1) found[index] = at(Math.max(Math.floor(index / 3), first), index % 3);
      return new THREE.BufferAttribute(found, 3);
    };
    const flown = points(0);
    for (const line of body.path.children.slice(0, 2)) line.geometry.setAttribute("position", flown);
    const plan = body.path.children[3];
    // A reference that stands still is its cross alone.
    const planned = width > 3 && !body.isGhost ? points(3) : null;
    plan.geometry.setDrawRange(0, planned && !Number.isNaN(planned.getX(PATH_POINTS - 1)) ? PATH_POINTS : 0);
    if (!planned) return;
    plan.geometry.setAttribute("position", planned);
    plan.computeLineDistances();
  }

  /** Draws, if anything changed. */
  draw() {
    if (this.mode === "board" && this.vehicles[this.followed]?.isKnown) this.#board(this.vehicles[this.followed]);
    else this.controls.update();
    if (!this.isStale) return false;
    this.isStale = false;
    // Of a room without vehicles there is no wind.
    const wind = this.layers.wind ? this.vehicles[this.followed]?.vehicle.air ?? null : null;
    this.wind.show(wind, this.camera.quaternion);
    this.renderer.render(this.scene, this.camera);
    return true;
  }

  #board({ group, reach }) {
    const scale = reach / 0.25;
    this.camera.position.copy(ABOARD).multiplyScalar(scale).applyQuaternion(group.quaternion).add(group.position);
    this.camera.up.set(0, 0, 1).applyQuaternion(group.quaternion);
    this.camera.lookAt(AHEAD.clone().applyQuaternion(group.quaternion).add(this.camera.position));
    this.camera.up.set(0, 0, 1);
  }
}
