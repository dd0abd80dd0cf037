// A vehicle as it is seen: its body with rotors that turn, arrows of thrust, beams of its sensor, and what was asked of it.

import * as THREE from "./vendor/three.min.js";

const PAINTS = { front: 0xd55e00, "counter-clockwise": 0x0072b2, clockwise: 0x009e73 };
const BEAMS = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, -1]];
// A vehicle whose file the recording lacks is drawn with this reach.
const REACH_M = 0.25;
// Colour of what a shadow sends, which nothing flies.
const SHADOW = 0x8a93a0;
// The last sample of a shadow that has ended stays the newest: one so much older than the flown one beside it is not shown.
const SHADOW_LAG_S = 0.1;
const VECTOR = ["x", "y", "z"];
// Directions of wall estimates along the heading, in the order of the message; a wall is drawn as a frame of this size.
const WALLS_RAD = [0, Math.PI, Math.PI / 2, -Math.PI / 2];
const WALL_M = 1;

function geometry(shape) {
  if (shape.box) return new THREE.BoxGeometry(...shape.box);
  if (shape.ball) return new THREE.SphereGeometry(shape.ball, 12, 8);
  const [radius, length] = shape.cylinder;
  // Cylinders of three.js stand along y.
  return new THREE.CylinderGeometry(radius, radius, length, 20).rotateX(Math.PI / 2);
}

/** The look of a part; that of the frame is coloured with the page. */
function material(paint, ghost) {
  const isDisc = paint.endsWith("clockwise");
  if (ghost) return new THREE.MeshLambertMaterial({ color: ghost, transparent: true, opacity: isDisc ? 0.15 : 0.45, depthWrite: false });
  const seen = isDisc ? { transparent: true, opacity: 0.3, depthWrite: false } : {};
  return new THREE.MeshLambertMaterial({ color: PAINTS[paint] ?? 0x808080, ...seen });
}

function arrow(colour) {
  const made = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, colour, 0.03, 0.02);
  made.visible = false;
  return made;
}

export class VehicleBody {
  /** `ghost` is the colour of a vehicle of another recording, null of the first's. */
  constructor(vehicle, columns, colour, ghost) {
    Object.assign(this, { vehicle, colour, name: vehicle.name, reach: vehicle.body?.reach_m ?? REACH_M });
    this.group = new THREE.Group();
    this.world = new THREE.Group();
    this.propellers = [];
    this.frames = [];
    this.isGhost = ghost !== null;
    this.isKnown = false;
    this.#shape(ghost);
    this.find(columns);
    this.#marks(colour);
  }

  #shape(ghost) {
    const { body } = this.vehicle;
    const unknown = { shape: { ball: 0.06 }, at_m: [0, 0, 0], roll_pitch_yaw_rad: [0, 0, 0], paint: "frame" };
    for (const part of body?.parts ?? [unknown]) {
      const mesh = new THREE.Mesh(geometry(part.shape), material(part.paint, ghost));
      mesh.position.set(...part.at_m);
      // About the fixed axes x, y and z, one after another.
      mesh.rotation.set(...part.roll_pitch_yaw_rad, "ZYX");
      this.group.add(mesh);
      if (part.paint === "frame" && !ghost) this.frames.push(mesh.material);
    }
    this.axes = new THREE.AxesHelper(1.6 * this.reach);
    this.group.add(this.axes);
    for (const rotor of body?.rotors ?? []) this.#rotor(rotor, body.propeller_radius_m, ghost);
  }

  #rotor(rotor, radius, ghost) {
    const hub = new THREE.Group();
    hub.position.set(...rotor.at_m);
    hub.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...rotor.axis));
    const paint = ghost ?? (rotor.spin > 0 ? PAINTS["counter-clockwise"] : PAINTS.clockwise);
    const blade = new THREE.Mesh(
      new THREE.BoxGeometry(2 * radius, 0.14 * radius, 0.03 * radius),
      new THREE.MeshLambertMaterial({ color: paint, transparent: ghost !== null, opacity: ghost === null ? 1 : 0.4 }),
    );
    const thrust = arrow(0xe69f00);
    // Beside the arrow of thrust, so that both are seen where they are equal.
    const command = arrow(0x56b4e9);
    command.position.x = 0.25 * radius;
    // On the other side: that of a shadow.
    const shadow = arrow(SHADOW);
    shadow.position.x = -0.25 * radius;
    hub.add(blade, thrust, command, shadow);
    this.group.add(hub);
    this.propellers.push({ blade, thrust, command, shadow, spin: rotor.spin });
  }

  /** Finds the places of the values that it needs, among the topics of `vehicle`. */
  find(columns, vehicle = this.vehicle) {
    this.vehicle = vehicle;
    const { state, topics, shadows, rotor_speeds: count } = this.vehicle;
    const vector = (topic, field) => columns.all(topic, VECTOR.map((axis) => `${field}.${axis}`));
    const row = (topic, field, length) => columns.all(topic, Array.from({ length }, (_, index) => `${field}[${index}]`));
    this.position = vector(state, "position");
    this.attitude = columns.all(state, ["x", "y", "z", "w"].map((part) => `attitude.${part}`));
    this.speeds = count > 0 ? row(state, "rotor_speed", count) : null;
    this.commands = row(topics.command, "command", this.propellers.length);
    this.estimate = vector(topics.estimate, "position");
    this.reference = vector(topics.reference, "position");
    this.altitude = columns.all(topics.status, ["altitude_set_point"]) ?? columns.all(topics.set_point, ["altitude"]);
    this.wallDistances = row(topics.walls, "distance", WALLS_RAD.length);
    this.inSight = row(topics.walls, "in_sight", WALLS_RAD.length);
    this.distances = row(topics.ranges, "distance", BEAMS.length);
    this.hits = row(topics.ranges, "valid", BEAMS.length);
    this.shadowCommands = row(shadows.command?.topic, "command", this.propellers.length);
    this.shadowEstimate = vector(shadows.estimate?.topic, "position");
    const stamp = (topic) => columns.all(topic, ["stamp.sec", "stamp.nanosec"]);
    this.shadowStamps = Object.fromEntries(Object.entries(shadows).map(([key, { topic, flown }]) => [key, [stamp(topic), stamp(flown)]]));
  }

  #marks(colour) {
    const line = (points) => {
      const made = new THREE.LineSegments(
        new THREE.BufferGeometry().setFromPoints(points),
        new THREE.LineBasicMaterial({ color: colour }),
      );
      made.frustumCulled = false;
      made.visible = false;
      return made;
    };
    const size = 0.6 * this.reach;
    const cross = VECTOR.flatMap((_, axis) => [-size, size].map((end) => new THREE.Vector3().setComponent(axis, end)));
    this.asked = line(cross);
    // Pairs of corners: the end of each side begins the next.
    const angles = Array.from({ length: 48 }, (_, index) => (Math.PI * Math.ceil(index / 2)) / 12);
    this.level = line(angles.map((angle) => new THREE.Vector3(Math.cos(angle), Math.sin(angle), 0).multiplyScalar(1.5 * this.reach)));
    const octahedron = (paint) => {
      const made = new THREE.Mesh(new THREE.OctahedronGeometry(0.25 * this.reach), new THREE.MeshBasicMaterial({ color: paint, wireframe: true }));
      made.visible = false;
      return made;
    };
    [this.believed, this.shadowBelieved] = [octahedron(colour), octahedron(SHADOW)];
    this.beams = new THREE.LineSegments(
      new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(6 * BEAMS.length), 3)),
      new THREE.LineBasicMaterial({ color: 0xcc3377, transparent: true, opacity: 0.7 }),
    );
    this.beams.frustumCulled = false;
    this.beams.visible = false;
    this.dots = BEAMS.map(() => new THREE.Mesh(new THREE.SphereGeometry(0.15 * this.reach, 8, 6), new THREE.MeshBasicMaterial({ color: 0xcc3377 })));
    for (const dot of this.dots) dot.visible = false;
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([y, z]) => new THREE.Vector3(0, y, z).multiplyScalar(WALL_M / 2));
    const sides = corners.flatMap((corner, index) => [corner, corners[(index + 1) % 4]]);
    this.walls = WALLS_RAD.map(() => line([...sides, corners[0], corners[2], corners[1], corners[3]]));
    this.group.add(this.beams, ...this.dots);
    this.world.add(this.asked, this.level, this.believed, this.shadowBelieved, ...this.walls);
  }

  /** Moves to the values of `row`; `turnS` is the simulated time that passed since the last. */
  update(row, turnS, shown) {
    // Of a ghost the body alone is shown: the rest would be taken for the other's.
    const layers = this.isGhost ? {} : shown;
    const at = (places) => places?.map((place) => row[place]);
    const position = at(this.position);
    this.isKnown = position?.every(Number.isFinite) ?? false;
    this.group.visible = this.isKnown;
    this.world.visible = this.isKnown;
    if (!this.isKnown) return;
    this.group.position.set(...position);
    const attitude = at(this.attitude);
    if (attitude?.every(Number.isFinite)) this.group.quaternion.set(...attitude).normalize();
    this.axes.visible = layers.axes ?? false;
    this.#turn(at(this.speeds), turnS, layers.thrust);
    this.#command("command", at(this.commands), layers.command);
    this.#shadow(row, at, layers.shadow);
    this.#measure(at(this.distances), at(this.hits), layers.beams);
    this.#ask(at(this.reference), at(this.altitude)?.[0], position, layers.asked);
    this.#sense(at(this.wallDistances), at(this.inSight), position, layers.walls);
    this.#believe(this.believed, at(this.estimate), layers.estimate);
  }

  /** Shows an estimate of the position. */
  #believe(mark, estimate, isShown) {
    mark.visible = Boolean(isShown && estimate?.every(Number.isFinite));
    if (mark.visible) mark.position.set(...estimate);
  }

  /** Shows what shadows send beside what flies, for as long as they send it. */
  #shadow(row, at, isShown) {
    const seconds = (places) => (places ? row[places[0]] + 1e-9 * row[places[1]] : NaN);
    const isAlive = (key) => {
      const [shadow, flown] = (this.shadowStamps[key] ?? []).map(seconds);
      return !(flown - shadow > SHADOW_LAG_S);
    };
    this.#command("shadow", at(this.shadowCommands), isShown && isAlive("command"));
    this.#believe(this.shadowBelieved, at(this.shadowEstimate), isShown && isAlive("estimate"));
  }

  #turn(speeds, turnS, hasThrust) {
    this.propellers.forEach(({ blade, thrust, spin }, index) => {
      const speed = speeds?.[index];
      const isKnown = Number.isFinite(speed);
      if (isKnown) blade.rotation.z = (blade.rotation.z + spin * speed * turnS) % (2 * Math.PI);
      this.#lift(thrust, isKnown ? speed : 0, hasThrust);
    });
  }

  /** Shows the thrust that the motors are asked for, once they turn as fast as their commands ask, by the `arrows` of this name. */
  #command(arrows, commands, isShown) {
    const map = this.vehicle.body?.command;
    this.propellers.forEach((propeller, index) => {
      const asked = commands?.[index];
      const isKnown = Boolean(map) && Number.isFinite(asked);
      const share = isKnown ? (Math.min(Math.max(asked, map.min), map.max) - map.min) / (map.max - map.min) : 0;
      const isOff = !isKnown || (map.zero_is_off && asked <= 0);
      const speed = isOff ? 0 : map.speed_at_min_rad_s + share * (map.speed_at_max_rad_s - map.speed_at_min_rad_s);
      this.#lift(propeller[arrows], speed, isShown);
    });
  }

  /** An arrow for the thrust at a speed: of a rotor that carries its part of the weight, as long as the vehicle's reach. */
  #lift(arrowOfRotor, speed, isShown) {
    const { body } = this.vehicle;
    const share = speed > 0 ? (body.thrust_coefficient * speed * speed * this.propellers.length) / body.weight_N : 0;
    const length = share * this.reach;
    arrowOfRotor.visible = Boolean(isShown && share > 0.05);
    if (arrowOfRotor.visible) arrowOfRotor.setLength(length, Math.min(0.25 * this.reach, length), 0.12 * this.reach);
  }

  #measure(distances, hits, isShown) {
    // Not `undefined`, which three.js takes for true.
    this.beams.visible = Boolean(isShown && distances?.every(Number.isFinite));
    const places = this.beams.geometry.attributes.position;
    BEAMS.forEach((beam, index) => {
      const isHit = this.beams.visible && hits?.[index] === 1;
      // A beam that meets nothing is drawn short: its reach would hide the room.
      const length = this.beams.visible ? (isHit ? distances[index] : Math.min(distances[index], 2 * this.reach)) : 0;
      places.setXYZ(2 * index + 1, ...beam.map((part) => part * length));
      this.dots[index].visible = isHit;
      if (isHit) this.dots[index].position.set(...beam.map((part) => part * length));
    });
    places.needsUpdate = true;
  }

  /** Stands a frame where a wall is believed, upright, along the heading. */
  #sense(distances, inSight, position, isShown) {
    const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(this.group.quaternion);
    const heading = Math.atan2(ahead.y, ahead.x);
    this.walls.forEach((wall, index) => {
      wall.visible = Boolean(isShown && inSight?.[index] === 1 && Number.isFinite(distances?.[index]));
      if (!wall.visible) return;
      const angle = heading + WALLS_RAD[index];
      const [x, y, z] = position;
      wall.position.set(x + distances[index] * Math.cos(angle), y + distances[index] * Math.sin(angle), z);
      wall.rotation.z = angle;
    });
  }

  #ask(reference, altitude, position, isShown) {
    this.asked.visible = Boolean(isShown && reference?.every(Number.isFinite));
    if (this.asked.visible) this.asked.position.set(...reference);
    this.level.visible = Boolean(isShown && !this.asked.visible && Number.isFinite(altitude));
    if (this.level.visible) this.level.position.set(position[0], position[1], altitude);
  }
}
