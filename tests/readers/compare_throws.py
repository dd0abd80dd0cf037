"""Holds drawn stacks and throws, flown by `hummingbus run`, against MuJoCo, closed forms and the laws of mechanics.

    compare_throws.py FOLDER --fly HUMMINGBUS --seeds 1-3     draws, writes, flies and judges
    compare_throws.py FOLDER --seeds 1-3 --only slide-1       judges the flights in FOLDER

In any engine, rounding decides where a stack that falls and a body that tumbles end. MuJoCo therefore judges such a flight
only up to its first contact and at its end: MuJoCo starts from our end and has to leave the bodies there. In between, the
laws of mechanics judge. Energy never grows. The floor pushes and never pulls. Its friction is within Coulomb's cone. No body
gets into another one. The script prints a table. It ends with 1 if a figure is beyond its limit.
"""

import argparse
import csv
import io
import pathlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np

import drawn_throws
from drawn_throws import G_M_S2

TICK_S = 1e-3
# MuJoCo's contacts are soft, and stiffer with a shorter step.
STEP_S = 1e-4
# The plant leaves overlaps of up to a micrometre, and lifts bodies out of deeper ones.
OVERLAP_M = 1e-6
# Greatest speed of a body at rest: gravity makes half of it in a tick.
REST_M_S = 2e-2
LOOKS = 40

# Figures by name: unit, limit, and the reason for the limit.
LIMITS = {
    "free flight: place": ("m", 1e-9, "rounding"),
    "free flight: momentum": ("1", 1e-9, "rounding; relative to that at the start"),
    "free flight: angular momentum": ("1", 1e-9, "rounding; relative"),
    "first contact: time, ball": ("s", 1.01e-3, "a tick, within which the contact is"),
    "first contact: time, MuJoCo": ("s", 2e-3, "a tick, and MuJoCo's step of first order"),
    "bounce of a ball: speed across": ("m/s", 1e-4, "the instant of the impact within a step"),
    "bounce of a ball: speed along": ("m/s", 1e-4, "the same"),
    "slide: way": ("m", 2e-6, "the end of a slide is within a step"),
    "slide: way, MuJoCo": ("1", 0.01, "its friction is soft; relative"),
    "slide: turn": ("rad", 1e-9, "rounding"),
    "bowl: place when it rolls": ("m", 2e-6, "the end of the slip is within a step"),
    "bowl: place when it rolls, MuJoCo": ("1", 0.01, "its friction is soft; relative"),
    "bowl: speed when it rolls": ("1", 1e-9, "rounding; relative"),
    "stands: heights": ("m", 7e-6, "a micrometre of overlap for each of six bodies"),
    "stands: way aside": ("m", 1e-6, "nothing pushes aside"),
    "stands: heights, MuJoCo": ("m", 1e-5, "its contacts yield under the load and creep"),
    "falls: height at the end": ("1", 0.95, "of the highest body at the start"),
    "falls: height at the end, MuJoCo": ("1", 0.95, "of the highest body at the start"),
    "falls: first 0.2 s, MuJoCo": ("m", 2e-3, "its contacts are soft; where it agrees with itself"),
    "energy gained": ("1", 1.0, "of 1e-5 of the energy and of a lift by 2e-6 m: steps of first order in contact"),
    "floor: pull": ("1", 1e-6, "of the weight: nothing pulls"),
    "floor: friction beyond the cone": ("1", 1e-6, "of the weight: rounding"),
    "overlap, by MuJoCo's geometry": ("m", 1e-5, "a micrometre, and the tolerance of its search"),
    "below the floor": ("m", 2 * OVERLAP_M, "a micrometre, and rounding"),
    "end: speed of boxes and prisms": ("m/s", REST_M_S, "it is at rest"),
    "end: moved by MuJoCo within 0.5 s": ("m", 1e-4, "its contacts yield and creep"),
}


class Flown:
    """Motion of the bodies of a case: arrays over ticks and bodies."""

    def __init__(self, case, text):
        rows = list(csv.reader(io.StringIO(text)))
        columns = {name: number for number, name in enumerate(rows[0])}
        values = np.array(rows[1:], dtype=float)
        bodies = range(len(case["bodies"]))

        def field(name, parts):
            at = [[columns[f"{name}[{number}].{part}"] for part in parts] for number in bodies]
            return values[:, at]

        self.case = case
        self.time = values[:, columns["time_ns"]] * 1e-9
        self.place, self.velocity = field("position", "xyz"), field("velocity", "xyz")
        self.turn, self.spin = field("attitude", "wxyz"), field("angular_velocity", "xyz")
        self.mass = np.array([body["mass"] for body in case["bodies"]])
        self.inertia = np.array([inertia(body) for body in case["bodies"]])

    def axes(self):
        """The matrices that take vectors from the bodies' axes to the world's."""
        w, x, y, z = np.moveaxis(self.turn, -1, 0)
        rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    def angular_momentum(self):
        axes = self.axes()
        inside = np.einsum("tbji,tbj->tbi", axes, self.spin)
        return np.einsum("tbij,tbj->tbi", axes, self.inertia * inside)

    def momentum(self):
        """Of all bodies, kg m/s."""
        return np.einsum("b,tbi->ti", self.mass, self.velocity)

    def energy(self):
        """Kinetic and potential, J."""
        moving = 0.5 * np.einsum("b,tbi,tbi->t", self.mass, self.velocity, self.velocity)
        turning = 0.5 * np.einsum("tbi,tbi->t", self.angular_momentum(), self.spin)
        return moving + turning + G_M_S2 * self.place[:, :, 2] @ self.mass

    def lowest(self):
        """Height of the lowest point of each body."""
        axes = self.axes()
        below = [np.max(-axes[:, number, 2, :] @ shell(body).T, axis=1) if body["shape"] != "ball"
                 else np.full(len(self.time), body["half"][0]) for number, body in enumerate(self.case["bodies"])]
        return self.place[:, :, 2] - np.stack(below, axis=1)


def shell(body):
    """The corners of a box or a prism, along its axes."""
    if body["shape"] == "prism":
        return np.array(drawn_throws.mesh(body)[0])
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * body["half"]


def inertia(body):
    """About the body's axes, kg m²."""
    a, b, c = np.square(body["half"])
    if body["shape"] == "ball":
        return np.full(3, 0.4 * body["mass"] * a)
    if body["shape"] == "box":
        return body["mass"] / 3 * np.array([b + c, a + c, a + b])
    # Of a regular polygon.
    along = a / 6 * (1 + 2 * np.cos(np.pi / drawn_throws.SIDES) ** 2)
    return body["mass"] * np.array([along / 2 + c / 3, along / 2 + c / 3, along])


def text(numbers):
    return " ".join(repr(float(number)) for number in numbers)


def mujoco_model(case, step_s=STEP_S):
    """MuJoCo's model of a case, without restitution, and its data at the start."""
    surface = f'solref="{2 * step_s} 1" solimp="0.999 0.9999 1e-6" friction="{case["friction"]} 0 0"'
    assets, bodies = "", ""
    for number, body in enumerate(case["bodies"]):
        kind = {"box": f'type="box" size="{text(body["half"])}"', "ball": f'type="sphere" size="{body["half"][0]}"',
                "prism": f'type="mesh" mesh="prism {number}"'}[body["shape"]]
        if body["shape"] == "prism":
            assets += f'<mesh name="prism {number}" vertex="{text(shell(body).ravel())}"/>'
        turn = [np.cos(body["yaw"] / 2), 0, 0, np.sin(body["yaw"] / 2)]
        bodies += (f'<body pos="{text(body["centre"])}" quat="{text(turn)}"><freejoint/>'
                   f'<inertial pos="0 0 0" mass="{body["mass"]}" diaginertia="{text(inertia(body))}"/>'
                   f'<geom {kind} {surface}/></body>')
    walls = "".join(f'<geom type="box" pos="{text(wall["centre"])}" size="{text(wall["half"])}" {surface}/>'
                    for wall in case["walls"])
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{step_s}" gravity="0 0 {-G_M_S2}" integrator="implicitfast" cone="elliptic" impratio="100"
        iterations="200" tolerance="1e-12"><flag multiccd="enable"/></option>
      <default><geom condim="3"/></default><asset>{assets}</asset>
      <worldbody><geom type="plane" size="0 0 1" {surface}/>{walls}{bodies}</worldbody></mujoco>""")
    data = mujoco.MjData(model)
    axes = Flown.axes(type("Start", (), {"turn": data.qpos.reshape(-1, 7)[:, 3:]}))
    for number, body in enumerate(case["bodies"]):
        data.qvel[6 * number:6 * number + 6] = body["velocity"] + list(axes[number].T @ body["spin"])
    return model, data


def advance(model, data, seconds):
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    return data.qpos.reshape(-1, 7)[:, :3].copy()


def deepest(flown):
    """The deepest overlap of two bodies or of a body and a wall or the floor, by MuJoCo's geometry."""
    model, data = mujoco_model(flown.case)
    most = 0.0
    for tick in np.linspace(0, len(flown.time) - 1, LOOKS).astype(int):
        data.qpos[:] = np.concatenate([flown.place[tick], flown.turn[tick]], axis=1).ravel()
        mujoco.mj_fwdPosition(model, data)
        most = max([most, *(-data.contact.dist)])
    return most


def moved_at_rest(flown, still):
    """The farthest that MuJoCo moves a body, which is at rest at the end, within half a second."""
    model, data = mujoco_model(flown.case)
    data.qpos[:] = np.concatenate([flown.place[-1], flown.turn[-1]], axis=1).ravel()
    data.qvel[:] = 0
    mujoco.mj_forward(model, data)
    return apart(advance(model, data, 0.5)[still], flown.place[-1][still])


def laws(flown):
    """Figures that no chaos changes."""
    case, weight = flown.case, flown.mass.sum() * G_M_S2
    energy = flown.energy()
    allowed = 2 * OVERLAP_M * weight + 1e-5 * (1 + energy.max())
    yield "energy gained", np.max(energy[1:] - np.minimum.accumulate(energy)[:-1]) / allowed
    yield "below the floor", max(0.0, -flown.lowest().min())
    yield "overlap, by MuJoCo's geometry", deepest(flown)
    if not case["walls"]:
        pushed = np.diff(flown.momentum(), axis=0) + [0, 0, weight * TICK_S]
        along, across = np.hypot(pushed[:, 0], pushed[:, 1]), pushed[:, 2]
        yield "floor: pull", max(0.0, -across.min() / (weight * TICK_S))
        yield "floor: friction beyond the cone", np.max(along - case["friction"] * across) / (weight * TICK_S)
    still = np.array([body["shape"] != "ball" for body in case["bodies"]])
    if case["kind"] != "bowl" and still.any():
        yield "end: speed of boxes and prisms", np.linalg.norm(flown.velocity[-1][still], axis=1).max()
        if np.linalg.norm(flown.velocity[-1], axis=1).max() < REST_M_S:
            yield "end: moved by MuJoCo within 0.5 s", moved_at_rest(flown, still)


def judge_stands(flown):
    aside = np.linalg.norm((flown.place - flown.place[0])[:, :, :2], axis=2).max()
    yield "stands: heights", np.abs(flown.place[:, :, 2] - flown.place[0, :, 2]).max()
    yield "stands: way aside", aside
    theirs = advance(*mujoco_model(flown.case), flown.time[-1])
    yield "stands: heights, MuJoCo", np.abs(flown.place[-1] - theirs)[:, 2].max()


def apart(places, others):
    """The farthest that a body is from the same body of others, m."""
    return np.linalg.norm(places - others, axis=1).max()


def judge_falls(flown):
    start = flown.place[0, :, 2].max()
    model, data = mujoco_model(flown.case)
    early = advance(model, data, 0.2)
    finer = advance(*mujoco_model(flown.case, STEP_S / 2), 0.2)
    what = "falls: first 0.2 s, MuJoCo"
    # A ball on a box that tips slips or rolls, and which of both depends on MuJoCo's step.
    if apart(early, finer) < LIMITS[what][1] / 2:
        yield what, apart(flown.place[200], finer)
    yield "falls: height at the end", flown.place[-1, :, 2].max() / start
    yield "falls: height at the end, MuJoCo", advance(model, data, flown.time[-1] - 0.2)[:, 2].max() / start


def judge_slide(flown):
    body = flown.case["bodies"][0]
    expected = np.hypot(*body["velocity"][:2]) ** 2 / (2 * flown.case["friction"] * G_M_S2)
    way = np.linalg.norm(flown.place[-1, 0, :2])
    yield "slide: way", abs(way - expected)
    turns = flown.turn[:, 0]
    yield "slide: turn", 2 * np.linalg.norm(turns[:, 1:3], axis=1).max() + 2 * np.abs(turns[:, 3] - turns[0, 3]).max()
    theirs = advance(*mujoco_model(flown.case), flown.time[-1])
    yield "slide: way, MuJoCo", abs(way - np.linalg.norm(theirs[0, :2])) / expected


def judge_bowl(flown):
    """A ball slips for 2 v / (7 μ g), over 12 v² / (49 μ g), and rolls on at 5/7 v."""
    body, grip = flown.case["bodies"][0], flown.case["friction"] * G_M_S2
    speed = np.hypot(*body["velocity"][:2])
    slips = 2 * speed / (7 * grip)
    expected = 12 * speed**2 / (49 * grip) + 5 / 7 * speed * (flown.time[-1] - slips)
    way = np.linalg.norm(flown.place[-1, 0, :2])
    yield "bowl: place when it rolls", abs(way - expected)
    yield "bowl: speed when it rolls", abs(np.linalg.norm(flown.velocity[-1, 0]) / (5 / 7 * speed) - 1)
    theirs = advance(*mujoco_model(flown.case), flown.time[-1])
    yield "bowl: place when it rolls, MuJoCo", abs(way - np.linalg.norm(theirs[0, :2])) / expected


def judge_throw(flown):
    """Free flight of the thrown body, and its first contact."""
    number = max(range(len(flown.mass)), key=lambda at: np.linalg.norm(flown.case["bodies"][at]["velocity"]))
    body, time = flown.case["bodies"][number], flown.time[:, None]
    start, velocity, fall = np.array(body["centre"]), np.array(body["velocity"]), np.array([0, 0, -G_M_S2])
    free = velocity + fall * time
    off = np.linalg.norm(flown.velocity[:, number] - free, axis=1)
    met = int(np.argmax(off > 1e-6))
    before = slice(0, met)
    way = start + velocity * time + fall * time**2 / 2
    yield "free flight: place", np.linalg.norm(flown.place[before, number] - way[before], axis=1).max()
    yield "free flight: momentum", off[before].max() / np.linalg.norm(velocity)
    spun = flown.angular_momentum()[:, number]
    yield "free flight: angular momentum", np.linalg.norm(spun[before] - spun[0], axis=1).max() / np.linalg.norm(spun[0])
    yield "first contact: time, MuJoCo", abs(flown.time[met] - TICK_S / 2 - first_contact(flown.case, number))
    # Without restitution the ball stays at the floor, where it slides on.
    if body["shape"] == "ball" and flown.case["kind"] != "hit" and flown.case["restitution"] > 0:
        yield from judge_bounce(flown, met, start, velocity)


def first_contact(case, number):
    """Of a body in MuJoCo, s."""
    model, data = mujoco_model(case)
    while data.time < case["duration"]:
        mujoco.mj_step(model, data)
        touching = model.geom_bodyid[data.contact.geom]
        if (touching == number + 1).any():
            return data.time
    return np.inf


def judge_bounce(flown, met, start, velocity):
    """The first bounce of a ball off floor or wall, by Newton's and Coulomb's laws."""
    case, body = flown.case, flown.case["bodies"][0]
    radius = body["half"][0]
    down = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * G_M_S2 * (start[2] - radius))) / G_M_S2
    hits = [(down, np.array([0.0, 0, 1]))]
    for wall in case["walls"]:
        hits.append(((wall["centre"][0] - wall["half"][0] - radius - start[0]) / velocity[0], np.array([-1.0, 0, 0])))
    time, normal = min(hits, key=lambda hit: hit[0])
    yield "first contact: time, ball", abs(flown.time[met] - TICK_S / 2 - time) + TICK_S / 2
    arrives = velocity + time * np.array([0, 0, -G_M_S2])
    across = -arrives @ normal
    slip = arrives + across * normal + np.cross(body["spin"], -radius * normal)
    slide = np.linalg.norm(slip)
    grip = min(case["friction"] * (1 + case["restitution"]) * across, 2 / 7 * slide)
    leaves = arrives + (1 + case["restitution"]) * across * normal - grip * slip / slide
    # The rest of the tick is free flight.
    found = flown.velocity[met, 0] + (flown.time[met] - time) * np.array([0, 0, G_M_S2])
    off = found - leaves
    yield "bounce of a ball: speed across", abs(off @ normal)
    yield "bounce of a ball: speed along", np.linalg.norm(off - (off @ normal) * normal)


JUDGES = {"stands": judge_stands, "falls": judge_falls, "slide": judge_slide, "bowl": judge_bowl,
          "floor": judge_throw, "wall": judge_throw, "hit": judge_throw}


def fly(program, case, folder):
    """Flies a case and writes the motion of its bodies as CSV beside its manifest."""
    manifest = drawn_throws.write(case, folder)
    recording = manifest.with_suffix(".mcap")
    fields = [f"{name}[{number}]" for name in ("position", "attitude", "velocity", "angular_velocity")
              for number in range(len(case["bodies"]))]
    wanted = [part for field in fields for part in ("--field", field)]
    subprocess.run([program, "run", manifest, "--record", recording, "--quiet"], check=True)
    found = subprocess.run([program, "cat", recording, "--topic", "/plant/bodies", "--csv", *wanted], check=True,
                           capture_output=True, text=True)
    manifest.with_suffix(".csv").write_text(found.stdout, encoding="utf-8")


def judged(case, folder):
    flown = Flown(case, (folder / f"{case['name']}.csv").read_text(encoding="utf-8"))
    found = list(laws(flown))
    if case["kind"] in JUDGES:
        found += JUDGES[case["kind"]](flown)
    return [(case["name"], what, float(value)) for what, value in found]


def table(found):
    yield "| figure | cases | largest | limit | reason for the limit |"
    yield "|---|---|---|---|---|"
    for what, (unit, limit, reason) in LIMITS.items():
        values = [value for _, name, value in found if name == what]
        if values:
            of = "" if unit == "1" else f" {unit}"
            yield f"| {what} | {len(values)} | {max(values):.2g}{of} | {limit:.2g}{of} | {reason} |"


def numbers(words):
    first, _, last = words.partition("-")
    return range(int(first), int(last or first) + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--fly", help="the program")
    parser.add_argument("--seeds", type=numbers, default="1-2")
    parser.add_argument("--only", help="the name of one case, or its kind")
    parser.add_argument("--sides", type=int, default=drawn_throws.SIDES, help="sides of a prism")
    arguments = parser.parse_args()
    drawn_throws.SIDES = arguments.sides
    cases = [case for seed in arguments.seeds for case in drawn_throws.drawn(seed)
             if arguments.only in (None, case["name"], case["kind"])]
    if not cases:
        parser.error(f"there is no case {arguments.only!r}")
    with ThreadPoolExecutor(2) as pool:
        if arguments.fly:
            list(pool.map(lambda case: fly(arguments.fly, case, arguments.folder), cases))
        found = [row for rows in pool.map(lambda case: judged(case, arguments.folder), cases) for row in rows]
    print("\n".join(table(found)))
    wrong = [(name, what, value) for name, what, value in found if not value <= LIMITS[what][1]]
    for name, what, value in wrong:
        unit, limit, _ = LIMITS[what]
        print(f"compare_throws.py: {name}: {what}: {value:.3g} {unit}, may be {limit:.3g}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
