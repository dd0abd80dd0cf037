#!/usr/bin/env python3
"""Flies quadrotors in simulators that are not ours (RotorPy, MuJoCo) and logs them for `hummingbus identify`.

    target/world/venv/bin/python scripts/foreign_flights.py DIR --truth rotorpy --seed 3
    target/world/venv/bin/python scripts/foreign_flights.py DIR --truth mujoco --effect mass-error --effect rotor-drag
    target/world/venv/bin/python scripts/foreign_flights.py DIR --truth mujoco --effect none --quiet 0.03

DIR gets a CSV log for each flight, flights.toml, vehicle.toml (what is declared) and truth.json (what is true and not
declared). The Python is that of scripts/world, which installs both simulators.

Nothing here is our plant. RotorPy's own equations move its vehicle, aerodynamics and motors included; MuJoCo moves a
free body, to which the code below applies what the rotors do. Controllers, sensors and disturbances are below as well.
"""

import argparse
import dataclasses
import json
import os
import sys

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

TICK_S = 0.002
TICKS_PER_S = 500
GRAVITY = 9.81
COUNTS = 1000
UP = np.array([0.0, 0.0, 1.0])
AXES = "xyz"
ROTORPY, MUJOCO = "rotorpy", "mujoco"
# A vehicle that leans more, or is farther from its start, is out of control.
LEAN_MAX_DEG, AWAY_M = 80.0, 60.0
CONTROLLERS = ["pd", "geometric", "cascade", "sticks"]
COURSES = ["sines", "eight", "steps"]
SINES, EIGHT, STEPS = COURSES
# What the catalogue takes for a battery that nobody declared (docs/effects.md): only with these are its other numbers ours.
NOMINAL_V, CAPACITY_C, EFFICIENCY = 12.6, 7560.0, 0.7


class Lost(Exception):
    """The vehicle got out of control: no flight to judge anything by."""


# Vehicles


@dataclasses.dataclass
class Vehicle:
    """What can be declared. Forces in N, torques in N m, speeds in rad/s; spin +1 is counter-clockwise from above."""

    name: str
    mass: float
    inertia: np.ndarray
    hubs: np.ndarray
    spins: np.ndarray
    thrust: float
    torque: float
    rotor_inertia: float
    lag_s: float
    most_speed: float
    rotor_drag: float = 0.0
    drag_xy: float = 0.0
    drag_z: float = 0.0
    climb: float = 0.0
    translational: float = 0.0

    @property
    def hover_speed(self):
        return np.sqrt(self.mass * GRAVITY / 4 / self.thrust)


@dataclasses.dataclass
class Truth:
    """A vehicle as it really is: its numbers, and what no vehicle has a number for."""

    vehicle: Vehicle
    losses: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(4))
    delay_ticks: int = 0
    wind: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    tilt_per_speed: float = 0.0
    hub_stiffness: float = 0.0
    battery: dict | None = None
    sensor_bias: dict = dataclasses.field(default_factory=dict)
    pose_delay_ticks: int = 0


def cross_layout(arm):
    """RotorPy's layout and order: front left, front right, rear right, rear left; the first turns clockwise."""
    return arm * np.sqrt(0.5) * np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0.0]])


def plus_layout(arm):
    """Front, right, rear, left; the first turns clockwise."""
    return arm * np.array([[1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 1, 0.0]])


def draw_vehicle(draw, simulator):
    """RotorPy's Hummingbird or Crazyflie, or a vehicle of 1.2 kg, with a lag of its own."""
    spins = np.array([-1.0, 1.0, -1.0, 1.0])
    # RotorPy's Crazyflie has 2.89e-5 about z, more than about x and y together: no body, and MuJoCo refuses it.
    kinds = [
        ("Hummingbird of RotorPy", 0.5, [3.65e-3, 3.68e-3, 7.03e-3], cross_layout(0.17), 5.57e-6, 1.36e-7, 2e-5, 1500.0),
        ("Crazyflie of RotorPy", 0.03, [1.43e-5, 1.43e-5, 2.7e-5], cross_layout(0.043), 2.3e-8, 7.8e-10, 3e-8, 3500.0),
        ("plus of 1.2 kg", 1.2, [1.1e-2, 1.2e-2, 2.1e-2], plus_layout(0.225), 8.5e-6, 1.4e-7, 4e-5, 1100.0),
    ]
    name, mass, inertia, hubs, thrust, torque, rotor_inertia, most = kinds[draw.integers(3)]
    # RotorPy's rotors have no angular momentum, so that none is declared for it.
    rotor_inertia = 0.0 if simulator == ROTORPY else rotor_inertia
    lag_s = round(draw.uniform(0.015, 0.045), 4)
    return Vehicle(name, mass, np.array(inertia), hubs, spins, thrust, torque, rotor_inertia, lag_s, most)


def number(value, unit):
    return f'{{ value = {value!r}, unit = "{unit}", source = "as simulated", uncertainty = "exact" }}'


def vehicle_effects(vehicle):
    """The drag that is declared, as entries of the vehicle file."""
    tables = [
        ("rotor-drag", [("coefficient", vehicle.rotor_drag, "N*s^2/(m*rad)")]),
        ("parasitic-drag", [("coefficient_xy", vehicle.drag_xy, "N*s^2/m^2"), ("coefficient_z", vehicle.drag_z, "N*s^2/m^2")]),
        ("translational-lift", [("climb_coefficient", vehicle.climb, "N*s^2/(m*rad)"), ("translational_coefficient", vehicle.translational, "N*s^2/m^2")]),
    ]
    for name, values in tables:
        if any(value for _, value, _ in values):
            lines = [f"{key} = {number(float(value), unit)}" for key, value, unit in values]
            yield "\n".join(["[[effects]]", f'name = "{name}"', *lines])


def vehicle_file(vehicle):
    own = lambda key, value, unit: f"{key} = {number(value, unit)}"
    moments = [own(f"inertia_{axis}{axis}", float(value), "kg*m^2") for axis, value in zip(AXES, vehicle.inertia)]
    parts = [
        f'# Written by scripts/foreign_flights.py.\n\nname = "{vehicle.name}"',
        "\n".join(["[body]", own("mass", float(vehicle.mass), "kg"), *moments, own("gravity", GRAVITY, "m/s^2")]),
        "\n".join(["[rotor]", own("thrust_coefficient", vehicle.thrust, "N/(rad/s)^2"),
                   own("torque_coefficient", vehicle.torque, "N*m/(rad/s)^2"), own("inertia", vehicle.rotor_inertia, "kg*m^2")]),
        "\n".join(["[motor]", 'model = "first-order"', own("time_constant", vehicle.lag_s, "s")]),
        "\n".join(["[command]", own("min", 0, "1"), own("max", COUNTS, "1"),
                   own("speed_at_min", 0, "rad/s"), own("speed_at_max", vehicle.most_speed, "rad/s")]),
    ]
    for index, (hub, spin) in enumerate(zip(vehicle.hubs, vehicle.spins)):
        sense = "counter-clockwise" if spin > 0 else "clockwise"
        parts.append("\n".join(["[[rotors]]", f'name = "r{index + 1}"', own("position", [float(part) for part in hub], "m"),
                                f'spin = {{ value = "{sense}", source = "as simulated" }}']))
    return "\n\n".join([*parts, *vehicle_effects(vehicle)]) + "\n"


# Effects. Each draws its true parameters by the catalogue's names (docs/effects.md) and changes a truth by them.


def either_sign(draw, least, most):
    return float(draw.choice([-1, 1]) * draw.uniform(least, most))


def log_uniform(draw, least, most):
    return float(np.exp(draw.uniform(np.log(least), np.log(most))))


def changed(truth, **numbers):
    return dataclasses.replace(truth, vehicle=dataclasses.replace(truth.vehicle, **numbers))


def per_rotor(vehicle):
    """A force per rotor speed and velocity that brakes the vehicle in hover by 1 m/s^2 for each m/s."""
    return vehicle.mass / (4 * vehicle.hover_speed)


def draw_rotor_drag(draw, vehicle):
    return {"coefficient": log_uniform(draw, 0.05, 0.4) * per_rotor(vehicle)}


def draw_parasitic_drag(draw, vehicle):
    drag = log_uniform(draw, 0.008, 0.06) * vehicle.mass
    return {"coefficient_xy": drag, "coefficient_z": drag * draw.uniform(1, 2)}


def draw_translational_lift(draw, vehicle):
    climb = log_uniform(draw, 0.1, 0.6) * per_rotor(vehicle)
    return {"climb_coefficient": climb, "translational_coefficient": draw.uniform(0.005, 0.03) * vehicle.mass / 4}


def draw_blade_flapping(draw, vehicle):
    stiffness = draw.uniform(0.3, 1.0) * vehicle.mass * GRAVITY * np.linalg.norm(vehicle.hubs[0])
    return {"tilt_per_speed": log_uniform(draw, 0.003, 0.02), "hub_stiffness": stiffness}


def draw_com_offset(draw, vehicle):
    arm = float(np.linalg.norm(vehicle.hubs[0]))
    return {"x": either_sign(draw, 0.01, 0.05) * arm, "y": either_sign(draw, 0.01, 0.05) * arm}


def draw_inertia_error(draw, vehicle):
    """Again until the tensor is one that a body can have."""
    while True:
        errors = draw.choice([-0.25, -0.1, 0.1, 0.25], 3)
        moments = vehicle.inertia * (1 + errors)
        if 2 * moments.max() < 0.99 * moments.sum():
            return {f"error_{axis}{axis}": float(error) for axis, error in zip(AXES, errors)}


def draw_battery(draw, _):
    """Half of the time the catalogue's battery; else another of which only the name can be judged."""
    is_ours = bool(draw.integers(2))
    own = {"nominal_voltage": NOMINAL_V, "capacity": CAPACITY_C, "efficiency": EFFICIENCY} if is_ours else {
        "nominal_voltage": NOMINAL_V, "capacity": draw.uniform(1500, 6000), "efficiency": draw.uniform(0.5, 0.8)}
    return {"internal_resistance": draw.uniform(0.02, 0.1), "discharge_drop": draw.uniform(1.0, 2.5),
            "discharged": draw.uniform(0.0, 0.3), "curve": 0.0 if is_ours else draw.uniform(0.3, 0.8), **own}


def draw_sensor_bias(draw, _):
    values = {f"accelerometer_{axis}": either_sign(draw, 0.05, 0.3) for axis in AXES}
    return values | {f"gyroscope_{axis}": either_sign(draw, 0.005, 0.03) for axis in AXES}


def offset_com(truth, values):
    return changed(truth, hubs=truth.vehicle.hubs - np.array([values["x"], values["y"], 0.0]))


def err_inertia(truth, values):
    return changed(truth, inertia=truth.vehicle.inertia * (1 + np.array([values[f"error_{axis}{axis}"] for axis in AXES])))


def weaken(truth, values):
    return dataclasses.replace(truth, losses=np.array([values.get(f"loss_{rotor}", 0.0) for rotor in (1, 2, 3, 4)]))


def set_drag(truth, values):
    return changed(truth, drag_xy=values["coefficient_xy"], drag_z=values["coefficient_z"])


def set_lift(truth, values):
    return changed(truth, climb=values["climb_coefficient"], translational=values["translational_coefficient"])


# Name: how its values are drawn, how they change the truth, and where it can be flown.
EFFECTS = {
    "rotor-drag": (draw_rotor_drag, lambda truth, own: changed(truth, rotor_drag=own["coefficient"]), (ROTORPY, MUJOCO)),
    "parasitic-drag": (draw_parasitic_drag, set_drag, (ROTORPY, MUJOCO)),
    "translational-lift": (draw_translational_lift, set_lift, (ROTORPY,)),
    "blade-flapping": (draw_blade_flapping, lambda truth, own: dataclasses.replace(truth, **own), (MUJOCO,)),
    "wind": (lambda draw, _: {axis: either_sign(draw, 0.5, 3.0) * (0.2 if axis == "z" else 1) for axis in AXES},
             lambda truth, own: dataclasses.replace(truth, wind=np.array([own[axis] for axis in AXES])), (ROTORPY, MUJOCO)),
    "mass-error": (lambda draw, _: {"error": either_sign(draw, 0.02, 0.15)},
                   lambda truth, own: changed(truth, mass=truth.vehicle.mass * (1 + own["error"])), (ROTORPY, MUJOCO)),
    "thrust-scale": (lambda draw, _: {"error": either_sign(draw, 0.02, 0.12)},
                     lambda truth, own: changed(truth, thrust=truth.vehicle.thrust * (1 + own["error"])), (ROTORPY, MUJOCO)),
    "inertia-error": (draw_inertia_error, err_inertia, (ROTORPY, MUJOCO)),
    "com-offset": (draw_com_offset, offset_com, (ROTORPY, MUJOCO)),
    "weak-rotor": (lambda draw, _: {f"loss_{draw.integers(1, 5)}": draw.uniform(0.03, 0.12)}, weaken, (ROTORPY, MUJOCO)),
    "motor-lag": (lambda draw, _: {"slowness": float(draw.choice([-0.5, -0.3, 0.3, 0.6, 0.9]))},
                  lambda truth, own: changed(truth, lag_s=truth.vehicle.lag_s * (1 + own["slowness"])), (ROTORPY, MUJOCO)),
    "command-delay": (lambda draw, _: {"delay": float(draw.integers(3, 13)) * TICK_S},
                      lambda truth, own: dataclasses.replace(truth, delay_ticks=round(own["delay"] / TICK_S)), (ROTORPY, MUJOCO)),
    "battery-sag": (draw_battery, lambda truth, own: dataclasses.replace(truth, battery=own), (ROTORPY, MUJOCO)),
    "gyroscopic-torque": (lambda draw, _: {"scale_error": float(draw.choice([-0.7, 1.0, 2.0]))},
                          lambda truth, own: changed(truth, rotor_inertia=truth.vehicle.rotor_inertia * (1 + own["scale_error"])), (MUJOCO,)),
    "sensor-bias": (draw_sensor_bias, lambda truth, own: dataclasses.replace(truth, sensor_bias=own), (ROTORPY, MUJOCO)),
    "sensor-delay": (lambda draw, _: {"pose": float(draw.integers(3, 16)) * TICK_S},
                     lambda truth, own: dataclasses.replace(truth, pose_delay_ticks=round(own["pose"] / TICK_S)), (ROTORPY, MUJOCO)),
}
DRAGS = {"rotor-drag", "parasitic-drag", "translational-lift", "blade-flapping"}
# Values that our catalogue has no parameter for, or holds at its own.
NOT_OURS = {"curve", "nominal_voltage", "capacity", "efficiency"}


def truth_of(vehicle, effects):
    truth = Truth(vehicle)
    for name, values in effects.items():
        truth = EFFECTS[name][1](truth, values)
    return truth


def comparable(effects):
    """The parameters whose intervals can be judged."""
    judged = {name: {key: value for key, value in values.items() if key not in NOT_OURS} for name, values in effects.items()}
    if "battery-sag" in effects:
        # The motors follow the voltage; where that was logged, this is all there is to find.
        charge = {} if effects["battery-sag"].get("curve") else judged["battery-sag"]
        judged["battery-sag"] = charge | {"exponent": 1.0}
    return judged


# The simulators: `state` holds position, velocity, quaternion (x, y, z, w), rates and rotor speeds.


def mujoco_body(vehicle):
    gears = ["1 0 0 0 0 0", "0 1 0 0 0 0", "0 0 1 0 0 0", "0 0 0 1 0 0", "0 0 0 0 1 0", "0 0 0 0 0 1"]
    moments = " ".join(repr(float(value)) for value in vehicle.inertia)
    return f"""<mujoco><option timestep="{TICK_S / 2}" gravity="0 0 {-GRAVITY}" integrator="RK4"/>
      <worldbody><body name="vehicle"><freejoint/><inertial pos="0 0 0" mass="{vehicle.mass!r}" diaginertia="{moments}"/>
      <site name="centre"/></body></worldbody>
      <actuator>{"".join(f'<general site="centre" gear="{gear}"/>' for gear in gears)}</actuator>
      <sensor><accelerometer site="centre"/></sensor></mujoco>"""


class MujocoFlight:
    """A free body in MuJoCo, its forces held in the body over each of two steps a tick."""

    def __init__(self, truth, start):
        import mujoco

        self.mujoco, self.truth = mujoco, truth
        self.model = mujoco.MjModel.from_xml_string(mujoco_body(truth.vehicle))
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:3] = start
        self.speeds = np.full(4, truth.vehicle.hover_speed)

    def state(self):
        qpos, qvel = self.data.qpos, self.data.qvel
        return np.concatenate([qpos[:3], qvel[:3], qpos[4:7], qpos[3:4], qvel[3:6], self.speeds])

    def wrench(self, speeds, accelerations, push):
        """Rotors at these speeds, the air at the state of this step, and the disturbance."""
        turn = np.zeros(9)
        self.mujoco.mju_quat2Mat(turn, self.data.qpos[3:7])
        airspeed = turn.reshape(3, 3).T @ (self.data.qvel[:3] - self.truth.wind)
        force, torque = rotors(self.truth, speeds[None], airspeed[None], self.data.qvel[None, 3:6])
        vehicle = self.truth.vehicle
        momentum = vehicle.rotor_inertia * np.dot(vehicle.spins, speeds)
        spun_up = vehicle.rotor_inertia * np.dot(vehicle.spins, accelerations)
        rates = self.data.qvel[3:6]
        torque = torque[0] - momentum * np.array([rates[1], -rates[0], 0]) - spun_up * UP
        return np.concatenate([force[0], torque]) + push

    def advance(self, targets, push):
        """Over one tick; what the accelerometer felt when it began."""
        step_s, lag_s = self.model.opt.timestep, self.truth.vehicle.lag_s
        targets = np.clip(targets, 0, self.truth.vehicle.most_speed)
        self.data.ctrl[:] = self.wrench(self.speeds, (targets - self.speeds) / lag_s, push)
        self.mujoco.mj_forward(self.model, self.data)
        felt = self.data.sensordata.copy()
        for _ in range(2):
            # Of first order towards the target: exact at the middle of the step.
            middle = targets + (self.speeds - targets) * np.exp(-step_s / 2 / lag_s)
            self.data.ctrl[:] = self.wrench(middle, (targets - middle) / lag_s, push)
            self.mujoco.mj_step(self.model, self.data)
            self.speeds = targets + (self.speeds - targets) * np.exp(-step_s / lag_s)
        return felt


def rotorpy_parameters(vehicle):
    moments = dict(zip(("Ixx", "Iyy", "Izz"), vehicle.inertia))
    return {
        "mass": vehicle.mass, **moments, "Ixy": 0.0, "Ixz": 0.0, "Iyz": 0.0, "num_rotors": 4,
        "rotor_pos": {f"r{index + 1}": hub for index, hub in enumerate(vehicle.hubs)},
        # RotorPy's direction is that of the yaw torque: against the rotor's own sense.
        "rotor_directions": -vehicle.spins, "rotor_speed_min": 0.0, "rotor_speed_max": vehicle.most_speed,
        "k_eta": vehicle.thrust, "k_m": vehicle.torque, "tau_m": vehicle.lag_s,
        # Drag by rotor speed and velocity at the hub, by velocity squared at the centre of mass: the same as ours.
        "k_d": vehicle.rotor_drag, "k_z": vehicle.climb, "k_h": vehicle.translational,
        "c_Dx": vehicle.drag_xy, "c_Dy": vehicle.drag_xy, "c_Dz": vehicle.drag_z,
    }


class RotorpyFlight:
    """RotorPy's derivatives by the classic method of Runge and Kutta, a fifth of the time of its own `step`."""

    def __init__(self, truth, start):
        from rotorpy.vehicles.multirotor import Multirotor

        self.truth, self.push = truth, np.zeros(6)
        self.vehicle = Multirotor(rotorpy_parameters(truth.vehicle))
        self.undisturbed = self.vehicle.compute_body_wrench
        self.vehicle.compute_body_wrench = self.disturbed
        own = np.zeros(20)
        own[:3], own[9], own[13:16], own[16:] = start, 1, truth.wind, truth.vehicle.hover_speed
        self.packed = own

    def disturbed(self, rates, speeds, airspeed):
        """RotorPy's own wrench, less what weak rotors lack, and the disturbance."""
        force, torque = self.undisturbed(rates, speeds, airspeed)
        lost = self.truth.losses * self.truth.vehicle.thrust * speeds**2
        hubs = self.truth.vehicle.hubs
        torque = torque - np.array([np.dot(hubs[:, 1], lost), -np.dot(hubs[:, 0], lost), 0])
        return force - lost.sum() * UP + self.push[:3], torque + self.push[3:]

    def state(self):
        return np.concatenate([self.packed[:13], self.packed[16:]])

    def advance(self, targets, push):
        self.push, targets = push, np.clip(targets, 0, self.truth.vehicle.most_speed)
        rates = lambda own: self.vehicle._s_dot_fn(0.0, own, targets)
        own, h = self.packed, TICK_S
        first = rates(own)
        felt = Rotation.from_quat(own[6:10]).inv().apply(first[3:6] + GRAVITY * UP)
        second = rates(own + h / 2 * first)
        third = rates(own + h / 2 * second)
        fourth = rates(own + h * third)
        self.packed = own + h / 6 * (first + 2 * second + 2 * third + fourth)
        self.packed[6:10] /= np.linalg.norm(self.packed[6:10])
        return felt


def cross(a, b):
    """NumPy's is slow for single vectors."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    p, q, r = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], -1)


def rotors(truth, speeds, airspeed, rates):
    """Force and torque of rotors and air in the body, of many samples at once. MuJoCo's vehicle flies by it, and what an
    effect is worth is measured with it for both."""
    vehicle = truth.vehicle
    hubs = vehicle.hubs[None]
    local = airspeed[:, None] + cross(rates[:, None], hubs)
    across = local * [1, 1, 0]
    thrust = vehicle.thrust * (1 - truth.losses) * speeds**2
    lift = thrust - vehicle.climb * speeds * local[..., 2] + vehicle.translational * (across**2).sum(-1)
    tilt = truth.tilt_per_speed * across
    # Flapping tilts the thrust that the speed alone makes.
    each = lift[..., None] * UP - vehicle.rotor_drag * speeds[..., None] * across - (vehicle.thrust * speeds**2)[..., None] * tilt
    drag = -np.linalg.norm(airspeed, axis=-1, keepdims=True) * airspeed * [vehicle.drag_xy, vehicle.drag_xy, vehicle.drag_z]
    twist = truth.hub_stiffness * np.stack([tilt[..., 1], -tilt[..., 0], 0 * tilt[..., 0]], -1)
    twist[..., 2] = -vehicle.spins * vehicle.torque * speeds**2
    return each.sum(1) + drag, (cross(hubs, each) + twist).sum(1)


FLIGHTS = {ROTORPY: RotorpyFlight, MUJOCO: MujocoFlight}


# Courses: position, velocity and acceleration by time.


def derived(course):
    """Velocity and acceleration of a position by central differences."""
    step = 1e-3
    at = lambda t: (course(t), (course(t + step) - course(t - step)) / (2 * step), (course(t + step) - 2 * course(t) + course(t - step)) / step**2)
    return at


def sines(draw, speed):
    periods, phases = draw.uniform(1.6, 9.0, (3, 3)), draw.uniform(0, 2 * np.pi, (3, 3))
    sizes = speed * periods / (2 * np.pi) * draw.uniform(0.2, 0.6, (3, 3)) * np.array([[1], [1], [0.6]])
    # Leaning more than 40 degrees is no course that all controllers can follow.
    sizes = np.minimum(sizes, 1.8 * (periods / (2 * np.pi)) ** 2)
    return lambda t: (sizes * (np.sin(2 * np.pi * t / periods + phases) - np.sin(phases))).sum(1)


def eight(draw, speed):
    size = draw.uniform(1.2, 2.5)
    rate = min(speed / size, np.sqrt(2.5 / size))
    turn, height, climb = draw.uniform(0, 2 * np.pi), draw.uniform(0.3, 1.0), draw.uniform(0.3, 1.2)
    c, s = np.cos(turn), np.sin(turn)

    def course(t):
        x, y = size * np.sin(rate * t), 0.5 * size * np.sin(2 * rate * t)
        return np.array([c * x - s * y, s * x + c * y, height * np.sin(climb * t)])

    return course


def steps(draw, speed):
    places = [np.zeros(3)] + [draw.uniform(-1, 1, 3) * [1.5, 1.5, 0.8] for _ in range(20)]
    leg_s = max(1.2, 3.0 / speed)

    def course(t):
        leg = min(int(max(t, 0) / leg_s), len(places) - 2)
        part = np.clip(t / leg_s - leg, 0, 1)
        return places[leg] + (places[leg + 1] - places[leg]) * part**3 * (10 - 15 * part + 6 * part**2)

    return course


def course_of(draw, kind, speed):
    return derived({SINES: sines, EIGHT: eight, STEPS: steps}[kind](draw, speed))


def sticks_of(draw, seconds):
    """Roll and pitch in rad that a hand asks for, held for a moment each."""
    changes = np.cumsum(draw.uniform(0.25, 0.9, int(seconds * 5)))
    angles = np.radians(draw.uniform(-18, 18, (len(changes) + 1, 2)))
    return lambda t: angles[np.searchsorted(changes, t)]


# Controllers: they know the declared vehicle and what sensors say, and ask for thrusts.


class Controller:
    """Of one of the kinds, with gains drawn as fast as lag and delay bear."""

    def __init__(self, kind, vehicle, draw, lateness_s, course, sticks, yaw):
        self.kind, self.vehicle, self.course, self.sticks, self.yaw = kind, vehicle, course, sticks, yaw
        self.rate_gain = draw.uniform(0.22, 0.36) / lateness_s
        self.attitude_gain = self.rate_gain * draw.uniform(0.2, 0.3)
        slow = min(self.attitude_gain * draw.uniform(0.25, 0.4), 2.2)
        self.place_gain, self.speed_gain = slow**2, 1.7 * slow
        self.sums, self.speed_sum = np.zeros(3), np.zeros(3)
        self.before = None
        arms = np.vstack([np.ones(4), vehicle.hubs[:, 1], -vehicle.hubs[:, 0], -vehicle.spins * vehicle.torque / vehicle.thrust])
        self.mix = np.linalg.inv(arms)

    def wanted_force(self, t, place, speed, dt):
        """Acceleration against gravity, in the world."""
        to_place, to_speed, to_acceleration = self.course(t)
        off, late = to_place - place, to_speed - speed
        asked = self.place_gain * np.clip(off, -1.5, 1.5) + self.speed_gain * late
        if self.kind == "geometric":
            asked = asked + to_acceleration
        if self.kind == "cascade":
            self.speed_sum = np.clip(self.speed_sum + 0.25 * self.place_gain * off * dt, -2, 2)
            asked = asked + self.speed_sum
        if self.kind == "sticks":
            # The hand holds the height, and brings the vehicle back but slowly.
            asked = asked * [0.3, 0.3, 1.0]
            roll, pitch = self.sticks(t)
            asked[:2] += GRAVITY * np.array([np.cos(self.yaw(t)) * pitch + np.sin(self.yaw(t)) * roll,
                                             np.sin(self.yaw(t)) * pitch - np.cos(self.yaw(t)) * roll])
        asked = asked + GRAVITY * UP
        asked[2] = max(asked[2], 0.3 * GRAVITY)
        across = np.hypot(*asked[:2])
        return asked * [*[min(1, 0.85 * asked[2] / max(across, 1e-9))] * 2, 1]

    def wanted_attitude(self, force, yaw):
        up = force / np.linalg.norm(force)
        left = np.cross(up, [np.cos(yaw), np.sin(yaw), 0])
        left /= np.linalg.norm(left)
        return np.column_stack([np.cross(left, up), left, up])

    def wanted_turn(self, now, wanted, rates, dt):
        """Angular acceleration in the body."""
        off = wanted.T @ now - now.T @ wanted
        error = 0.5 * np.array([off[2, 1], off[0, 2], off[1, 0]]) * [1, 1, 0.4]
        to_rates = np.zeros(3)
        if self.kind == "geometric" and self.before is not None:
            # The wanted attitude turns too; differences of it, in the body.
            turned = self.before.T @ wanted
            to_rates = np.clip(0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], 0]) / dt, -3, 3)
        self.before = wanted
        if self.kind in ("cascade", "sticks"):
            to_rates = -self.attitude_gain * error
            self.sums = np.clip(self.sums + 0.15 * self.rate_gain**2 * (to_rates - rates) * dt, -15, 15)
            return self.rate_gain * (to_rates - rates) * [1, 1, 0.7] + self.sums
        return (-self.rate_gain * self.attitude_gain * error + self.rate_gain * (to_rates - rates)) * [1, 1, 0.7]

    def command(self, t, seen, dt):
        """Rotor speeds from place, velocity, quaternion and rates as they are seen."""
        now = Rotation.from_quat(seen[6:10]).as_matrix()
        force = self.wanted_force(t, seen[:3], seen[3:6], dt)
        turn = self.wanted_turn(now, self.wanted_attitude(force, self.yaw(t)), seen[10:13], dt)
        inertia, rates = self.vehicle.inertia, seen[10:13]
        torque = inertia * turn + np.cross(rates, inertia * rates)
        thrusts = self.mix @ [self.vehicle.mass * np.dot(force, now[:, 2]), *torque]
        most = self.vehicle.thrust * self.vehicle.most_speed**2
        return np.sqrt(np.clip(thrusts, 0.03 * most, 0.95 * most) / self.vehicle.thrust)


# Noise and disturbances


def coloured(draw, count, axes, size, time_s):
    """A process of first order of that deviation and correlation time, stationary from the start."""
    keep = np.exp(-TICK_S / time_s)
    white = draw.normal(size=(count, axes)) * size * np.sqrt(1 - keep**2)
    white[0] = draw.normal(size=axes) * size
    return lfilter([1], [1, -keep], white, axis=0)


def draw_conditions(draw, quiet):
    """How a set is measured and disturbed. `quiet`: white noise so many times the usual, and nothing else; None for all."""
    rate = lambda *choices: int(draw.choice(choices))
    quality = log_uniform(draw, 0.3, 3.0) if quiet is None else quiet
    own = {
        "imu_hz": rate(50, 100, 125, 250, 500), "pose_hz": rate(50, 100, 125, 250), "command_hz": rate(100, 125, 250, 500),
        "has_rotor_speed": bool(draw.integers(2)), "has_velocity": bool(draw.random() < 0.3), "has_voltage": bool(draw.integers(2)),
        "accelerometer_m_s2": 0.05 * quality, "gyroscope_rad_s": 0.005 * quality, "position_m": 0.001 * quality,
        "attitude_rad": 0.001 * quality, "velocity_m_s": 0.02 * quality, "rotor_speed_part": 0.002 * quality,
        # Part of the noise that has a memory, and how long it is.
        "coloured_part": draw.uniform(0.2, 0.9), "coloured_s": log_uniform(draw, 0.01, 1.0),
        "force_m_s2": log_uniform(draw, 0.02, 0.4), "force_s": log_uniform(draw, 0.1, 4.0),
        "torque_rad_s2": log_uniform(draw, 0.1, 2.5), "torque_s": log_uniform(draw, 0.05, 2.0),
        "vibration_m_s2": draw.uniform(0.0, 1.0), "vibration_rad_s": draw.uniform(0.0, 0.05),
        "is_quantised": bool(draw.integers(2)), "dropped": float(draw.choice([0.0, 0.005, 0.03])), "has_bursts": bool(draw.random() < 0.3),
        "trim_rad_s2": float(draw.choice([0.0, 0.0, 0.5, 1.5])), "seconds": round(draw.uniform(22, 30)),
    }
    if quiet is not None:
        own |= {"coloured_part": 0.0, "force_m_s2": 0.0, "torque_rad_s2": 0.0, "vibration_m_s2": 0.0, "vibration_rad_s": 0.0,
                "is_quantised": False, "dropped": 0.0, "has_bursts": False, "trim_rad_s2": 0.0}
    return own


def noise(draw, count, axes, size, conditions):
    part = conditions["coloured_part"]
    white = draw.normal(size=(count, axes)) * size * np.sqrt(1 - part**2)
    return white + coloured(draw, count, axes, size * part, conditions["coloured_s"])


def pushes(draw, count, vehicle, conditions):
    """Disturbing force and torque in the body, with this flight's own trim."""
    force = coloured(draw, count, 3, conditions["force_m_s2"] * vehicle.mass, conditions["force_s"])
    torque = coloured(draw, count, 3, conditions["torque_rad_s2"], conditions["torque_s"]) * [1, 1, 0.5]
    trim = draw.normal(size=3) * conditions["trim_rad_s2"] * [1, 1, 0.5]
    return np.hstack([force, torque * vehicle.inertia]), trim * vehicle.inertia


# One flight


def voltage(battery, drawn_C, power_W):
    """Of the battery's terminals: an open voltage by the charge that is left, less what its resistance takes."""
    charge = max(1 - battery["discharged"] - drawn_C / battery["capacity"], 0.0)
    # A curve of 0 is a line; else it falls faster at the ends, as cells do.
    bend = battery["curve"] * (np.sin(2 * np.pi * charge) / (2 * np.pi))
    opened = battery["nominal_voltage"] - battery["discharge_drop"] * (1 - charge + bend)
    resistance, electric = battery["internal_resistance"], power_W / battery["efficiency"]
    current = 2 * electric / (opened + np.sqrt(max(opened**2 - 4 * resistance * electric, 0.0)))
    return opened - resistance * current, current


def scaled_power(vehicle, speeds):
    return float((vehicle.torque * np.abs(speeds) ** 3).sum())


def is_lost(state):
    """True if the vehicle has tipped over or flown away. One that follows its course by metres late, with slow gains, is under control."""
    if not np.isfinite(state).all():
        return True
    x, y = state[6:8]
    return 1 - 2 * (x * x + y * y) < np.cos(np.radians(LEAN_MAX_DEG)) or np.linalg.norm(state[:3]) > AWAY_M


def fly(truth, declared, simulator, controller, disturbance, seen_noise, command_ticks, is_quantised):
    """Flies a controller through a simulator; arrays by tick."""
    count = len(disturbance)
    flight = FLIGHTS[simulator](truth, np.zeros(3))
    log = {key: np.zeros((count, width)) for key, width in (("state", 17), ("felt", 3), ("command", 4), ("voltage", 1), ("target", 4))}
    hover = declared.hover_speed / declared.most_speed * COUNTS
    command, drawn_C = np.full(4, hover), 0.0
    # A battery behind motors that hold their speed drains, and does nothing else.
    calm = {"internal_resistance": 0.03, "discharge_drop": 2.0, "discharged": 0.05, "curve": 0.0,
            "nominal_voltage": NOMINAL_V, "capacity": 3000.0, "efficiency": 0.7}
    for tick in range(count):
        state = flight.state()
        if is_lost(state):
            raise Lost
        if tick % command_ticks == 0:
            speeds = controller.command(tick * TICK_S, seen(state, seen_noise[tick]), command_ticks * TICK_S)
            command = np.clip(speeds / declared.most_speed * COUNTS, 0, COUNTS)
            command = np.round(command, 0 if is_quantised else 3)
        volts, current = voltage(truth.battery or calm, drawn_C, scaled_power(truth.vehicle, state[13:]))
        drawn_C += current * TICK_S
        log["command"][tick], log["state"][tick], log["voltage"][tick] = command, state, volts
        heard = log["command"][max(tick - truth.delay_ticks, 0)] / COUNTS * declared.most_speed
        share = volts / truth.battery["nominal_voltage"] if truth.battery else 1.0
        log["target"][tick] = heard * share
        log["felt"][tick] = flight.advance(heard * share, disturbance[tick])
    return log


def seen(state, off):
    """What a controller's estimator makes of the state: place, velocity, attitude and rates with noise."""
    own = state.copy()
    own[:6] += off[:6]
    own[6:10] = (Rotation.from_quat(state[6:10]) * Rotation.from_rotvec(off[6:9])).as_quat()
    own[10:13] += off[9:12]
    return own


def sensor_noise(draw, count, truth, conditions):
    """Noise of position, velocity, attitude and gyroscope: the controller's own too."""
    sizes = [("position_m", 3), ("velocity_m_s", 3), ("attitude_rad", 3), ("gyroscope_rad_s", 3), ("accelerometer_m_s2", 3)]
    own = np.hstack([noise(draw, count, axes, conditions[key], conditions) for key, axes in sizes])
    for index, axis in enumerate(AXES):
        own[:, 9 + index] += truth.sensor_bias.get(f"gyroscope_{axis}", 0.0)
        own[:, 12 + index] += truth.sensor_bias.get(f"accelerometer_{axis}", 0.0)
    return own


def vibration(draw, speeds, hover, size):
    """What unbalanced rotors add to three axes, at the frequency of each."""
    phases = np.cumsum(speeds * TICK_S, axis=0) + draw.uniform(0, 2 * np.pi, 4)
    mixing = draw.normal(size=(4, 3)) * 0.5
    return size * ((speeds / hover) ** 2 * np.sin(phases)) @ mixing


# The log


def grid(values, step):
    return np.round(values / step) * step


def measured(draw, log, off, truth, declared, conditions):
    """Channel to rate and values by tick, as sensors have them."""
    state, speeds = log["state"], log["state"][:, 13:]
    late = np.maximum(np.arange(len(state)) - truth.pose_delay_ticks, 0)
    attitude = (Rotation.from_quat(state[:, 6:10]) * Rotation.from_rotvec(off[:, 6:9])).as_quat()[late]
    attitude *= np.where(attitude[:, 3:] < 0, -1, 1)
    shaken = lambda key: vibration(draw, speeds, declared.hover_speed, conditions[key])
    channels = {
        "gyroscope": (conditions["imu_hz"], state[:, 10:13] + off[:, 9:12] + shaken("vibration_rad_s"), 0.001),
        "accelerometer": (conditions["imu_hz"], log["felt"] + off[:, 12:15] + shaken("vibration_m_s2"), 0.005),
        "position": (conditions["pose_hz"], (state[:, :3] + off[:, :3])[late], 0.0005),
        "attitude": (conditions["pose_hz"], attitude, 0.0001),
        "velocity": (conditions["pose_hz"], (state[:, 3:6] + off[:, 3:6])[late], 0.002),
        "rotor_speed": (conditions["pose_hz"], speeds * (1 + conditions["rotor_speed_part"] * draw.normal(size=speeds.shape)), 0.5),
        "voltage": (10, log["voltage"] + 0.01 * draw.normal(size=log["voltage"].shape), 0.01),
    }
    for name, key in [("velocity", "has_velocity"), ("rotor_speed", "has_rotor_speed"), ("voltage", "has_voltage")]:
        if not conditions[key]:
            del channels[name]
    coarse = lambda values, step: grid(values, step) if conditions["is_quantised"] else values
    channels = {name: (hz, coarse(values, step)) for name, (hz, values, step) in channels.items()}
    return {"command": (conditions["command_hz"], log["command"])} | channels


COLUMNS = {
    "command": (["m1", "m2", "m3", "m4"], "count"), "position": (["x", "y", "z"], "m"), "velocity": (["vx", "vy", "vz"], "m/s"),
    "attitude": (["qx", "qy", "qz", "qw"], "1"), "gyroscope": (["gx", "gy", "gz"], "rad/s"),
    "accelerometer": (["ax", "ay", "az"], "m/s^2"), "rotor_speed": (["w1", "w2", "w3", "w4"], "rad/s"), "voltage": (["u"], "V"),
}
OUR_NAMES = {"gyroscope": "angular_velocity", "accelerometer": "specific_force", "voltage": "battery_voltage"}


def kept(draw, count, conditions):
    """Which ticks the logger did not lose."""
    own = draw.random(count) >= conditions["dropped"]
    if conditions["has_bursts"]:
        for start in draw.integers(count // 10, count, 4):
            own[start : start + 20] = False
    # The command that holds when the log begins has to stand in it.
    own[0] = True
    return own


def write_csv(path, channels, keep):
    names = list(channels)
    with open(path, "w", encoding="utf-8") as file:
        file.write(",".join(["t", *(column for name in names for column in COLUMNS[name][0])]) + "\n")
        for tick in np.flatnonzero(keep):
            cells = []
            for name in names:
                hz, values = channels[name]
                is_due = tick % (TICKS_PER_S // hz) == 0
                cells += [f"{value:.9g}" if is_due else "" for value in values[tick]]
            if any(cells):
                file.write(f"{tick * TICK_S:.3f}," + ",".join(cells) + "\n")


def write_flights(folder, channels, names):
    lines = ["# Written by scripts/foreign_flights.py.", "", 'vehicle = "vehicle.toml"', "", "[channels]", 'time = { columns = ["t"], unit = "s" }']
    for name in channels:
        columns, unit = COLUMNS[name]
        lines.append(f'{OUR_NAMES.get(name, name)} = {{ columns = {json.dumps(columns)}, unit = "{unit}" }}')
    for name, role in names:
        lines += ["", "[[flight]]", f'name = "{name}"', f'file = "{name}.csv"', f'role = "{role}"']
    write(os.path.join(folder, "flights.toml"), "\n".join(lines) + "\n")


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


# What an effect is worth


def speeds_under(truth, log, declared):
    """Rotor speeds that a truth's motors would have had under the same commands, and the same voltage if it has a battery."""
    count = len(log["command"])
    heard = log["command"][np.maximum(np.arange(count) - truth.delay_ticks, 0)] / COUNTS * declared.most_speed
    if truth.battery:
        heard = heard * log["voltage"] / truth.battery["nominal_voltage"]
    keep = np.exp(-TICK_S / truth.vehicle.lag_s)
    first = log["state"][:1, 13:]
    later, _ = lfilter([1 - keep], [1, -keep], heard, axis=0, zi=keep * first)
    return np.vstack([first, later[:-1]])


def accelerations(truth, log, declared):
    """Specific force and angular acceleration that a truth has at the flown states."""
    state, vehicle = log["state"], truth.vehicle
    speeds = speeds_under(truth, log, declared)
    airspeed = Rotation.from_quat(state[:, 6:10]).inv().apply(state[:, 3:6] - truth.wind)
    rates = state[:, 10:13]
    force, torque = rotors(truth, speeds, airspeed, rates)
    momentum = vehicle.rotor_inertia * speeds @ vehicle.spins
    spun_up = np.gradient(momentum, TICK_S)
    torque = torque - np.stack([rates[:, 1] * momentum, -rates[:, 0] * momentum, spun_up], -1)
    return force / vehicle.mass, (torque - np.cross(rates, vehicle.inertia * rates)) / vehicle.inertia


def size(values):
    return float(np.sqrt((values**2).sum(-1).mean()))


def worth(effects, vehicle, log, disturbance, conditions):
    """Of each effect: how much of the accelerations it makes, and the part of the squares that it has beside
    disturbances and noise, in the equation where that is largest. Sensors' effects are not judged so."""
    full = accelerations(truth_of(vehicle, effects), log, vehicle)
    # White noise over a window of 0.1 s; of the gyroscope, a slope over it.
    seen_samples = max(0.1 * conditions["imu_hz"], 1)
    floors = [conditions["accelerometer_m_s2"] * np.sqrt(3 / seen_samples), conditions["gyroscope_rad_s"] * 35 * np.sqrt(3 / seen_samples)]
    push = [size(disturbance[:, :3] / vehicle.mass), size(disturbance[:, 3:] / vehicle.inertia)]
    own = {}
    for name in effects:
        if name.startswith("sensor"):
            own[name] = None
            continue
        without = accelerations(truth_of(vehicle, {key: value for key, value in effects.items() if key != name}), log, vehicle)
        made = [size(ours - theirs) for ours, theirs in zip(full, without)]
        shares = [part**2 / (part**2 + shove**2 + floor**2) for part, shove, floor in zip(made, push, floors)]
        own[name] = {"specific_force_m_s2": made[0], "angular_acceleration_rad_s2": made[1], "share": max(shares)}
    return own


def own_check(truth, declared, log, disturbance):
    """How far the simulator's accelerometer is from this file's equations, disturbance apart: 0 where both agree."""
    force, _ = accelerations(truth, log, declared)
    return size(log["felt"] - force - disturbance[:, :3] / truth.vehicle.mass)


# Sets


def draw_effects(draw, simulator, vehicle):
    """One effect, or two."""
    possible = [name for name, (_, _, where) in EFFECTS.items() if simulator in where]
    names = draw.choice(possible, 1 + (draw.random() < 0.4), replace=False)
    return {str(name): EFFECTS[name][0](draw, vehicle) for name in names}


def declare_drag(draw, vehicle, simulator, effects):
    """Drag that is known: with wind always, else with every other vehicle that has no undeclared one."""
    if set(effects) & DRAGS or not ("wind" in effects or draw.integers(2)):
        return vehicle
    own = {"rotor_drag": draw_rotor_drag(draw, vehicle)["coefficient"]}
    if "wind" in effects:
        own["rotor_drag"] = max(own["rotor_drag"], 0.2 * per_rotor(vehicle))
    if simulator == ROTORPY:
        own |= {"drag_xy": 0.02 * vehicle.mass, "drag_z": 0.03 * vehicle.mass, "climb": 0.2 * per_rotor(vehicle)}
    return dataclasses.replace(vehicle, **own)


def lateness(truth, declared, conditions):
    """Of motors, commands and sensors together: what gains have to bear."""
    own = max(truth.vehicle.lag_s, declared.lag_s) + truth.delay_ticks * TICK_S + 0.5 / conditions["command_hz"]
    return own + 0.004


def fly_one(draw, setting, truth, declared, kind):
    conditions, simulator = setting["conditions"], setting["truth"]
    count = conditions["seconds"] * TICKS_PER_S
    speed = float(draw.uniform(1.0, 4.0))
    course_kind = STEPS if kind == "sticks" else str(draw.choice(COURSES))
    swing, period = draw.uniform(0.0, 0.8), draw.uniform(4, 12)
    yaw = lambda t: swing * np.sin(2 * np.pi * t / period)
    course = course_of(draw, course_kind, 0.8 if kind == "sticks" else speed)
    controller = Controller(kind, declared, draw, lateness(truth, declared, conditions), course, sticks_of(draw, conditions["seconds"]), yaw)
    disturbance, trim = pushes(draw, count, truth.vehicle, conditions)
    off = sensor_noise(draw, count, truth, conditions)
    log = fly(truth, declared, simulator, controller, disturbance + [0, 0, 0, *trim], off, TICKS_PER_S // conditions["command_hz"], conditions["is_quantised"])
    told = {"controller": kind, "course": course_kind, "speed_m_s": speed, "trim_rad_s2": (trim / truth.vehicle.inertia).tolist()}
    told |= {"worth": worth(setting["effects"], declared, log, disturbance, conditions),
             "own_check_m_s2": own_check(truth, declared, log, disturbance), "fastest_m_s": float(np.linalg.norm(log["state"][:, 3:6], axis=1).max())}
    return log, off, told


def kind_of_controller(draw, setting):
    return setting.get("controller") or str(draw.choice(CONTROLLERS))


# Flights of a set that are drawn for one setting, and settings that are drawn for one seed.
ATTEMPTS, DRAWS = 5, 3


def make_set(folder, setting, vehicle):
    """Flies a set; where one of its flights is lost, all of it again with other random numbers. False if all attempts are lost."""
    os.makedirs(folder, exist_ok=True)
    truth = truth_of(vehicle, setting["effects"])
    names = [("fit-1", "fit"), ("fit-2", "fit"), ("test-1", "test")] + [("test-2", "test")] * (setting["seed"] % 3 == 0)
    for attempt in range(ATTEMPTS):
        draw = np.random.default_rng([setting["seed"], ATTEMPTS * setting["redrawn"] + attempt, 1])
        try:
            flown = [fly_one(draw, setting, truth, vehicle, kind_of_controller(draw, setting)) for _ in names]
            break
        except Lost:
            continue
    else:
        return False
    flights = {}
    for (name, _), (log, off, told) in zip(names, flown):
        channels = measured(draw, log, off, truth, vehicle, setting["conditions"])
        write_csv(os.path.join(folder, f"{name}.csv"), channels, kept(draw, len(off), setting["conditions"]))
        flights[name] = told
    write_flights(folder, channels, names)
    write(os.path.join(folder, "vehicle.toml"), vehicle_file(vehicle))
    told = {**setting, "vehicle": vehicle.name, "attempts": attempt + 1, "judged": comparable(setting["effects"]), "flights": flights}
    write(os.path.join(folder, "truth.json"), json.dumps(told, indent=1) + "\n")
    return True


def draw_set(seed, simulator, names=None, quiet=None, values=None, redrawn=0):
    """What is flown for a seed: the setting, and the vehicle that is declared. `names` replaces the effects drawn. `redrawn` is the number of settings of
    this seed that got out of control."""
    draw = np.random.default_rng([seed, 0, redrawn, 2] if redrawn else [seed, 0])
    vehicle = draw_vehicle(draw, simulator)
    if names is None:
        effects = draw_effects(draw, simulator, vehicle)
    else:
        effects = {name: {**EFFECTS[name][0](draw, vehicle), **(values or {}).get(name, {})} for name in names}
    vehicle = declare_drag(draw, vehicle, simulator, effects)
    conditions = draw_conditions(draw, quiet)
    if set(effects) & {"com-offset", "weak-rotor"}:
        # A constant torque of its own in each flight would hide them, as identify says.
        conditions["trim_rad_s2"] = 0.0
    return {"seed": seed, "truth": simulator, "effects": effects, "conditions": conditions, "redrawn": redrawn}, vehicle


# Feedback and inertia: a controller answers disturbances, so that torques and rates are correlated beyond the dynamics.

INERTIA_ERRORS = [0.0, 0.1, -0.1, 0.25, -0.25]
SPECTRA = [(size, time) for size in (0.5, 2.0, 6.0) for time in (0.04, 0.3, 2.0)] + [(2.0, 10.0)]
FEEDBACK_CONTROLLERS = ["pd", "geometric", "cascade"]


def feedback_case(index):
    """Spectrum, controller and inertia error of one of the 150 sets, in an order that mixes all three."""
    order = np.random.default_rng(5).permutation(len(SPECTRA) * len(FEEDBACK_CONTROLLERS) * len(INERTIA_ERRORS))
    own = int(order[index % len(order)])
    return own % len(SPECTRA), own // len(SPECTRA) % len(FEEDBACK_CONTROLLERS), own // (len(SPECTRA) * len(FEEDBACK_CONTROLLERS))


def draw_feedback_set(seed, simulator, index, redrawn=0):
    """Little noise, no other disturbance, and one inertia error about all axes."""
    spectrum, controller, error = feedback_case(index)
    names = ["inertia-error"] if INERTIA_ERRORS[error] else []
    values = {"inertia-error": {f"error_{axis}{axis}": INERTIA_ERRORS[error] for axis in AXES}}
    setting, vehicle = draw_set(seed, simulator, names, values=values, redrawn=redrawn)
    (torque, time_s), was = SPECTRA[spectrum], setting["conditions"]
    setting["conditions"] |= {
        "torque_rad_s2": torque, "torque_s": time_s, "force_m_s2": 0.02, "force_s": 0.5, "trim_rad_s2": 0.0, "coloured_part": 0.3,
        "vibration_m_s2": 0.0, "vibration_rad_s": 0.0, "dropped": 0.0, "has_bursts": False, "is_quantised": False, "seconds": 25,
        "imu_hz": 250, "pose_hz": 125, "command_hz": 250, "has_rotor_speed": was["has_rotor_speed"],
    }
    sizes = {"accelerometer_m_s2": 0.05, "gyroscope_rad_s": 0.002, "position_m": 0.001, "attitude_rad": 0.001, "velocity_m_s": 0.02, "rotor_speed_part": 0.002}
    setting["conditions"] |= sizes
    told = {"spectrum": spectrum, "torque_rad_s2": torque, "torque_s": time_s, "controller": FEEDBACK_CONTROLLERS[controller], "error": INERTIA_ERRORS[error]}
    return {**setting, "controller": FEEDBACK_CONTROLLERS[controller], "feedback": told}, vehicle


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", help="where logs and files go; made if it is not there")
    parser.add_argument("--truth", choices=[ROTORPY, MUJOCO], default=ROTORPY, help="the simulator that flies")
    parser.add_argument("--seed", type=int, default=1, help="everything that is drawn follows from it")
    parser.add_argument("--effect", action="append", metavar="NAME", help="an undeclared effect, again for a second; 'none' for none; drawn if left out")
    parser.add_argument("--quiet", type=float, metavar="SIZE", help="white noise of SIZE times the usual, and nothing that disturbs: to see with 0.03 that declared and simulated vehicle are the same")
    parser.add_argument("--controller", choices=CONTROLLERS, help="of all flights; drawn for each if left out")
    parser.add_argument("--feedback", type=int, metavar="INDEX", help="one of the sets of disturbance spectra, controllers and inertia errors, 0 to 149")
    given = parser.parse_args()
    names = [name for name in given.effect or [] if name != "none"]
    for name in names:
        if name not in EFFECTS:
            parser.error(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
        if given.truth not in EFFECTS[name][2]:
            parser.error(f"{name} is not flown in {given.truth}")
    given.names = names if given.effect else None
    return given


def drawn(given, redrawn):
    """The setting and the declared vehicle of the seed, after so many that got out of control."""
    if given.feedback is not None:
        setting, vehicle = draw_feedback_set(given.seed, given.truth, given.feedback, redrawn)
    else:
        setting, vehicle = draw_set(given.seed, given.truth, given.names, given.quiet, redrawn=redrawn)
    return setting | ({"controller": given.controller} if given.controller else {}), vehicle


def main():
    given = arguments()
    for redrawn in range(DRAWS):
        setting, vehicle = drawn(given, redrawn)
        if make_set(given.folder, setting, vehicle):
            return
    write(os.path.join(given.folder, "lost.json"), json.dumps(setting) + "\n")
    sys.exit(f"{given.folder}: {ATTEMPTS} attempts of each of {DRAWS} settings got out of control")


if __name__ == "__main__":
    main()
