// The room: scene, vehicles and their paths in space, seen by a camera.

import * as THREE from "./vendor/three.min.js";
import { frames } from "./api.js";
import { VehicleBody } from "./body.js";
import { FlatRenderer } from "./flat.js";
import { curveColour, onTheme, pageColour } from "./palette.js";

const PATH_POINTS = 3000;
// A path that spreads over more blocks of the file is drawn around the time that is shown.
const PATH_BLOCKS = 200;
// It is read again and again of a recording that grows.
const PATH_BLOCKS_GROWING = 60;
const ABOARD = new THREE.Vector3(0.02, 0, 0.09);
const AHEAD = new THREE.Vector3(1, 0, 0);
// The first place of the camera, seen from a vehicle, in multiples of its reach.
const FIRST_LOOK = new THREE.Vector3(-7, -7, 7);

/** Names of the layers beside the bodies, and if they are shown from the start. */
export const LAYERS = {
  path: ["path", true],
  thrust: ["thrust", true],
  asked: ["set point", true],
  estimate: ["estimate", true],
  beams: ["range beams", true],
  walls: ["wall estimates", true],
  axes: ["axes", true],
  grid: ["grid", true],
};

export class Room {
  constructor(canvas, recordings, columns, { flat = false } = {}) {
    Object.assign(this, { canvas, recordings, mode: "follow", followed: 0 });
    this.layers = Object.fromEntries(Object.entries(LAYERS).map(([key, [, isOn]]) => [key, isOn]));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.02, 2000);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(-2, -2, 2);
    this.#renderer(flat);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => (this.isStale = true));
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

  #renderer(flat) {
    // Another canvas is asked first: one that was asked for WebGL is lost for a flat drawing.
    this.isFlat = flat || !document.createElement("canvas").getContext("webgl2");
    // A picture of the page is taken between two drawings: without a kept buffer it would be empty.
    const options = { canvas: this.canvas, antialias: true, alpha: true, preserveDrawingBuffer: true };
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
        const measured = { ...vehicle, name: `${vehicle.name} measured`.trim(), state: vehicle.topics.measured, topics: {}, rotor_speeds: 0 };
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
    Object.assign(body, { recording, fields: columns.fields, path: this.#path(colour), pathSpan: null });
    this.scene.add(body.group, body.world, body.path);
    this.vehicles.push(body);
  }

  /** The path of a vehicle: all that was read of it, and above that what is flown by now. */
  #path(colour) {
    const line = (opacity) => {
      const made = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity }));
      made.frustumCulled = false;
      return made;
    };
    const path = new THREE.Group();
    path.add(line(0.3), line(0.9));
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
    if (this.isFlat) {
      this.renderer.setSize(width, height, devicePixelRatio);
    } else {
      this.renderer.setPixelRatio(devicePixelRatio);
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
    for (const body of this.vehicles) body.pathSpan = null;
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
      this.#trail(body, timesNs);
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

  async #trail(body, timesNs) {
    body.path.visible = this.layers.path && body.pathTimes !== undefined;
    if (!body.position) return;
    const recording = this.recordings[body.recording];
    const timeNs = timesNs[body.recording];
    if (!body.pathSpan || timeNs < body.pathSpan[0] || timeNs > body.pathSpan[1]) await this.#readPath(body, recording, timeNs);
    if (!body.pathTimes) return;
    const { fromNs, stepNs } = body.pathTimes;
    const flown = Math.floor((timeNs - fromNs) / stepNs) + 1;
    body.path.children[1].geometry.setDrawRange(0, Math.min(Math.max(flown, 0), body.pathTimes.count));
    this.isStale = true;
  }

  /** Reads the path of a vehicle: all of a short recording, and around the time of a long one. */
  async #readPath(body, recording, timeNs) {
    const most = recording.is_growing ? PATH_BLOCKS_GROWING : PATH_BLOCKS;
    const part = Math.min(most / Math.max(recording.blocks, 1), 1);
    const spanNs = Math.max(recording.duration_ns * part, 1e9);
    const fromNs = part === 1 ? 0 : Math.max(Math.round(timeNs - 0.7 * spanNs), 0);
    // Before the answer: one question is enough.
    body.pathSpan = part === 1 ? [0, Infinity] : [fromNs === 0 ? 0 : timeNs - 0.3 * spanNs, fromNs + spanNs];
    const stepNs = Math.max(Math.ceil(spanNs / PATH_POINTS), 1);
    const fields = body.position.map((place) => body.fields[place]);
    try {
      const values = await frames({ recording: body.recording, from_ns: fromNs, step_ns: stepNs, count: PATH_POINTS, fields });
      const last = values.length / 3;
      const points = new Float32Array(values.length);
      // A sample that is not there yet is drawn where the first one is.
      const first = values.findIndex((value, index) => index % 3 === 0 && !Number.isNaN(value));
      for (let index = 0; index < values.length; index += 1) points[index] = values[index < first ? first + (index % 3) : index];
      for (const line of body.path.children) line.geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
      body.pathTimes = { fromNs, stepNs, count: last };
      body.path.visible = this.layers.path;
    } catch {
      body.pathTimes = undefined;
    }
  }

  /** Draws, if anything changed. */
  draw() {
    if (this.mode === "board" && this.vehicles[this.followed]?.isKnown) this.#board(this.vehicles[this.followed]);
    else this.controls.update();
    if (!this.isStale) return false;
    this.isStale = false;
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
