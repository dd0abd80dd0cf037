"""Holds the motions that examples/world_cases.rs flew against closed forms, MuJoCo, RotorPy and SciPy's DOP853.

    compare_world.py CASES.json          what MuJoCo and closed forms say
    compare_world.py CASES.json --all    DOP853 and RotorPy too, a minute more
    compare_world.py CASES.json --only slide

It prints the table of docs/world.md, and ends with 1 where a motion is farther from another than it may be.

MuJoCo and RotorPy get the vehicle's numbers, not its equations. What of MuJoCo's soft contacts has to be chosen is
chosen once, below, and the damping of its bounce is fitted to the restitution at one height.
"""

import argparse
import json
import sys

import mujoco
import numpy as np

STEP_S = 1e-4
# Contacts as stiff as the step bears, without slip where they stick.
STIFF = 'solref="0.0004 1" solimp="0.999 0.9999 1e-6"'

rows = []


NAMES = {"closed": "closed form", "mujoco": "MuJoCo", "rotorpy": "RotorPy", "dop853": "DOP853"}


def row(what, unit, ours, **others):
    """Notes a number of ours beside those of others, each with how far it may be from ours."""
    cells = {name: (f"{value:.6g}", abs(ours - value), limit) for name, (value, limit) in others.items()}
    rows.append((what, unit, f"{ours:.6g}", cells))


def apart(what, unit, **others):
    """Notes how far the motions of others get from ours, and how far they may."""
    cells = {name: (f"apart by {off:.2g}", off, limit) for name, (off, limit) in others.items()}
    rows.append((what, unit, "", cells))


def hull(told):
    feet = "".join(
        f'<geom type="sphere" size="{told["foot radius"]}" pos="{x} {y} {z}"/>' for x, y, z in told["feet"]
    )
    disc = f'<geom type="cylinder" size="{told["disc"]["radius"]} {told["disc"]["half"]}"/>'
    return feet + disc


def body(told, start, inside, joint="<freejoint/>", inertia="inertia"):
    diagonal = " ".join(str(moment) for moment in told[inertia])
    place = " ".join(str(number) for number in start[1:4])
    turn = " ".join(str(number) for number in start[7:11])
    return (f'<body name="vehicle" pos="{place}" quat="{turn}">{joint}'
            f'<inertial pos="0 0 0" mass="{told["mass"]}" diaginertia="{diagonal}"/>{inside}</body>')


def world(told, inside, more="", integrator="implicitfast", step_s=STEP_S, contact=STIFF, friction=0.5):
    text = f"""<mujoco>
      <compiler autolimits="true"/>
      <option timestep="{step_s}" gravity="0 0 {-told["gravity"]}" integrator="{integrator}" cone="elliptic"
        impratio="1000" iterations="200" tolerance="1e-14"/>
      <default><geom friction="{friction} 0 0" {contact} contype="1" conaffinity="2" condim="3"/></default>
      <worldbody>{inside}</worldbody>{more}
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


GROUND = '<geom name="ground" type="plane" size="0 0 1" contype="2" conaffinity="1" {}/>'


def set_motion(model, data, start):
    """Velocity in the world and angular velocity in the body, as MuJoCo's free joint has them."""
    data.qvel[:6] = np.concatenate([start[4:7], start[11:14]])
    mujoco.mj_forward(model, data)


def tilt(turn):
    w, x, y, z = turn
    return np.arctan2(2 * np.hypot(w * x + y * z, w * y - x * z), 1 - 2 * (x * x + y * y))


def yaw(turn):
    w, x, y, z = turn
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def angle_between(a, b):
    """Of two attitudes, by the imaginary part of what turns one into the other: exact where it is small."""
    (w, x, y, z), (p, q, r, t) = a, b
    imaginary = [w * q - x * p - y * t + z * r, w * r - y * p - z * q + x * t, w * t - z * p - x * r + y * q]
    return 2 * np.arctan2(np.linalg.norm(imaginary), abs(np.dot(a, b)))


def compare_tumble(told, cases):
    states = np.array(cases["tumble"])
    model, data = world(told, body(told, states[0], "", inertia="uneven inertia"), integrator="RK4")
    set_motion(model, data, states[0])
    inertia = np.array(told["uneven inertia"])
    for _ in range(round(10 / STEP_S)):
        mujoco.mj_step(model, data)
    after = states[100]
    apart("torque-free tumble: attitude after 10 s", "rad", mujoco=(angle_between(after[7:11], data.qpos[3:7]), 1e-6))
    energy = [0.5 * np.dot(inertia * state[11:14], state[11:14]) for state in states]
    row("torque-free tumble: energy of the spin after 100 s to before", "1", energy[-1] / energy[0], closed=(1.0, 1e-9))


def rotor_wrench(told, speeds):
    thrusts = told["thrust coefficient"] * speeds**2
    drags = told["torque coefficient"] * speeds**2
    wrench = np.zeros(4)
    for rotor, thrust, drag in zip(told["rotors"], thrusts, drags):
        x, y, _ = rotor["position"]
        wrench += [thrust, y * thrust, -x * thrust, -rotor["spin"] * drag]
    return wrench


def compare_plain_chirps(told, cases):
    """The rigid body in MuJoCo, driven by the rotor speeds of ours: forces fixed in the body, at each step's middle."""
    states = np.array(cases["plain chirps"])
    actuators = "".join(
        f'<general site="hub" gear="{gear}"/>' for gear in ("0 0 1 0 0 0", "0 0 0 1 0 0", "0 0 0 0 1 0", "0 0 0 0 0 1")
    )
    step_s = 2.5e-5
    inside = body(told, states[0], '<site name="hub"/>')
    model, data = world(told, inside, f"<actuator>{actuators}</actuator>", "RK4", step_s)
    set_motion(model, data, states[0])
    targets = np.array(told["targets"])
    steps = round(1e-3 / step_s)
    off = 0.0
    for tick, (state, target) in enumerate(zip(states[:-1], targets)):
        for step in range(steps):
            # Of first order towards the target: exact between ticks.
            after_s = (step + 0.5) * step_s
            speeds = target + (state[14:18] - target) * np.exp(-after_s / told["plain time constant"])
            data.ctrl[:] = rotor_wrench(told, speeds)
            mujoco.mj_step(model, data)
        off = max(off, np.linalg.norm(states[tick + 1][1:4] - data.qpos[:3]))
    apart("chirps of 66° of tilt, 10 s: position", "m", mujoco=(off, 1e-6))


def bounce_apex(told, height, damping):
    """Height of MuJoCo's first bounce, with a spring and damper of 1 kHz as contact."""
    start = [0, 0, 0, told["stand"] + height, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    stiffness = (2 * np.pi * 1000) ** 2
    contact = f'solref="{-stiffness} {-damping}" solimp="0.9999 0.9999 1e-6"'
    step_s = 1e-5
    model, data = world(told, GROUND.format(contact) + body(told, start, hull(told)), step_s=step_s, contact=contact)
    apex, tilted = 0.0, 0.0
    has_met = False
    for _ in range(round((np.sqrt(2 * height / told["gravity"]) * 1.9 + 0.01) / step_s)):
        mujoco.mj_step(model, data)
        has_met |= data.ncon > 0 and data.qvel[2] > 0
        if has_met:
            apex = max(apex, data.qpos[2] - told["stand"])
        tilted = max(tilted, tilt(data.qpos[3:7]))
    return apex, tilted


def fitted_damping(told):
    """The damping that leaves a fifth of the speed from 0.5 m."""
    low, high = 100.0, 20000.0
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (middle, high) if bounce_apex(told, 0.5, middle)[0] > 0.02 else (low, middle)
    return (low + high) / 2


def compare_bounces(told, cases):
    damping = fitted_damping(told)
    for bounce in cases["bounces"]:
        states, height = np.array(bounce["states"]), bounce["height_m"]
        up = np.argmax(states[:, 6] > 0)
        apex = states[up:, 3].max() - told["stand"]
        their_apex, their_tilt = bounce_apex(told, height, damping)
        left, their_left = np.sqrt(apex / height), np.sqrt(their_apex / height)
        # MuJoCo's soft contact has no constant restitution: it differs by a tenth from one height to the next.
        row(f"bounce from {height} m: speed that is left", "1", left, closed=(0.2, 1e-4), mujoco=(their_left, 0.03))
        most = max(tilt(state[7:11]) for state in states)
        row(f"bounce from {height} m: tilt", "rad", most, closed=(0.0, 1e-8), mujoco=(their_tilt, 1e-4))


def follow(told, cases, name, inside, seconds, **how):
    """MuJoCo's states at every tick of a case."""
    states = np.array(cases[name])
    model, data = world(told, inside, **how)
    if model.nv == 6:
        set_motion(model, data, states[0])
    found = []
    for _ in range(round(seconds * 1000)):
        for _ in range(round(1e-3 / model.opt.timestep)):
            mujoco.mj_step(model, data)
        found.append((data.qpos.copy(), data.qvel.copy()))
    return states, found


def compare_slide(told, cases):
    start = cases["slide"][0]
    inside = GROUND.format(STIFF) + body(told, start, hull(told))
    states, found = follow(told, cases, "slide", inside, 1.0, step_s=2e-5)
    expected = 3.0**2 / (2 * 0.5 * told["gravity"])
    way = np.hypot(*states[-1][1:3])
    row("slide at 3 m/s, friction 0.5: way", "m", way, closed=(expected, 1e-5), mujoco=(np.hypot(*found[-1][0][:2]), 5e-3))
    row("slide: aside", "m", np.dot(states[-1][1:3], [-0.6, 0.8]), closed=(0.0, 1e-9))
    turned = max(abs(yaw(state[7:11])) for state in states)
    # MuJoCo's own: its friction yields a little, and unevenly.
    their_turn = max(abs(yaw(place[3:7])) for place, _ in found)
    row("slide: yaw", "rad", turned, closed=(0.0, 1e-9), mujoco=(their_turn, 0.03))


def compare_rest(told, cases):
    start = cases["rest"][0]
    states, found = follow(told, cases, "rest", GROUND.format(STIFF) + body(told, start, hull(told)), 1.0)
    row("rest: height of the centre of mass", "m", states[-1][3], closed=(told["stand"], 1e-9), mujoco=(found[-1][0][2], 1e-6))
    speed, their_speed = (
        max(np.linalg.norm(velocity) for velocity in velocities)
        for velocities in ([state[4:7] for state in states[500:]], [rate[:3] for _, rate in found[500:]])
    )
    row("rest: speed in the last half second", "m/s", speed, closed=(0.0, 1e-9), mujoco=(their_speed, 1e-6))


def compare_tip(told, cases):
    start = cases["tip"][0]
    table = f'<geom type="box" pos="-1.03 0 1.9" size="1 1 0.1" contype="2" conaffinity="1" friction="5 0 0" {STIFF}/>'
    states, found = follow(told, cases, "tip", table + body(told, start, hull(told)), 0.3, step_s=2e-5, friction=5)
    for at in (100, 200, 250):
        theirs = tilt(found[at - 1][0][3:7])
        row(f"tip over an edge: tilt after {at} ms", "rad", tilt(states[at][7:11]), mujoco=(theirs, 2e-3))


def compare_stack(told, cases):
    """A box of 10 kg falls on one of 0.1 kg."""
    states = np.array(cases["heavy on light"])
    cubes = "".join(
        f'<body pos="{place}"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="{mass}" contype="3" conaffinity="3" '
        f'friction="0.5 0 0" {STIFF}/></body>'
        for place, mass in [("0 0 0.1", 0.1), ("0.03 0.02 0.7", 10)]
    )
    model, data = world(told, GROUND.format(STIFF) + cubes, step_s=2e-5)
    fastest = 0.0
    for _ in range(50_000):
        mujoco.mj_step(model, data)
        fastest = max(fastest, np.linalg.norm(data.qvel[6:9]))
    fall = np.sqrt(2 * told["gravity"] * 0.4)
    what = "10 kg fall 0.4 m on 0.1 kg"
    ours = max(np.linalg.norm(states[:, 10:13], axis=1))
    row(f"{what}: greatest speed", "m/s", ours, closed=(fall, 0.01), mujoco=(fastest, 0.01))
    row(f"{what}: height of the heavy box at rest", "m", states[-1][9], closed=(0.3, 2e-6), mujoco=(data.qpos[9], 1e-4))
    row(f"{what}: way of the light box aside", "m", np.hypot(*states[-1][1:3]), closed=(0.0, 1e-6),
        mujoco=(np.hypot(*data.qpos[:2]), 1e-3))


def rig(told, start, slides):
    """The vehicle on a ball joint that turns up to the cone; the joint on a slider with a mass, or in the world."""
    mount, height = told["rig"]["mount"], told["rig"]["bearing"]
    cone = np.degrees(told["rig"]["tilt"])
    # Far overdamped: what is critically damped throws back an eighth of the speed, since a stop does not pull.
    stop = 'solreflimit="0.0004 20" solimplimit="0.999 0.9999 1e-6"'
    ball = f'<joint name="ball" type="ball" range="0 {cone}" pos="0 0 {mount}" {stop}/>'
    inside = body(told, [0, 0, 0, -mount, 0, 0, 0, 1, 0, 0, 0], "", ball)
    slider = ""
    if slides:
        slider = (f'<joint name="slider" type="slide" axis="0 0 1" range="0 {told["rig"]["heave"]}" {stop}/>'
                  f'<inertial pos="0 0 0" mass="{told["rig"]["mass"]}" diaginertia="1e-9 1e-9 1e-9"/>')
    return f'<body pos="0 0 {height}">{slider}{inside}</body>'


def compare_rigs(told, cases):
    states = np.array(cases["rig A, lower end"])
    model, data = world(told, rig(told, states[0], True), step_s=2e-5)
    data.qpos[0] = 0.2
    mujoco.mj_forward(model, data)
    met = round(np.sqrt(2 * 0.2 / told["gravity"]) * 1000)
    lower = told["rig"]["bearing"] - told["rig"]["mount"]
    back, their_back = max(state[3] for state in states[met + 1:]) - lower, 0.0
    for tick in range(500):
        for _ in range(50):
            mujoco.mj_step(model, data)
        if tick > met:
            their_back = max(their_back, data.qpos[0])
    row("rig A, lower end met at 1.98 m/s: thrown back up", "m", back, closed=(0.0, 1e-6), mujoco=(their_back, 1e-4))

    for name, limit in (("rig B, cone", 0.01), ("rig B, swing", 2e-5)):
        states = np.array(cases[name])
        step_s = 2e-5 if name == "rig B, cone" else STEP_S
        model, data = world(told, rig(told, states[0], False), step_s=step_s, integrator="RK4")
        data.qpos[:4], data.qvel[:3] = states[0][7:11], states[0][11:14]
        mujoco.mj_forward(model, data)
        off = 0.0
        for state in states[1:]:
            for _ in range(round(1e-3 / step_s)):
                mujoco.mj_step(model, data)
            off = max(off, angle_between(state[7:11], data.qpos[:4]))
        apart(f"{name}: attitude over {states[-1][0]:.1f} s", "rad", mujoco=(off, limit))
    leans = states[:, 8]
    times = states[:, 0]
    crossings = [t0 - a * (t1 - t0) / (b - a) for t0, t1, a, b in zip(times, times[1:], leans, leans[1:]) if a > 0 >= b]
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    a, b = 1.0, np.cos(0.25)
    for _ in range(20):
        a, b = (a + b) / 2, np.sqrt(a * b)
    lever = told["rig"]["mount"]
    inertia = told["inertia"][0] + told["mass"] * lever**2
    closed = 2 * np.pi / a * np.sqrt(inertia / (told["mass"] * told["gravity"] * lever))
    row("rig B: period of a swing of 0.5 rad", "s", period, closed=(closed, 5e-6))


def actuators(drives):
    """Servos of the joints that are driven, with the targets that they hold."""
    each, targets = "", []
    for drive in drives:
        limit = "" if drive["limit"] is None else f'forcerange="{-drive["limit"]} {drive["limit"]}"'
        stiffness, damping = drive["stiffness"], drive["damping"]
        gain = stiffness or damping
        each += (f'<general joint="{drive["name"]}" gainprm="{gain}" biastype="affine" '
                 f'biasprm="0 {-stiffness} {-damping}" {limit}/>')
        targets.append(drive["target"])
    return f"<actuator>{each}</actuator>", targets


def chain_apart(told, states, drives):
    """Distances of the bodies of a chain that falls freely from MuJoCo's, in m and in rad."""
    axis = " ".join(str(number) for number in told["chain axis"])
    kinds = {"ball": '<joint name="{1}" type="ball" pos="{0}"/>',
             "revolute": f'<joint name="{{1}}" type="hinge" axis="{axis}" pos="{{0}}"/>',
             "prismatic": f'<joint name="{{1}}" type="slide" axis="{axis}" pos="{{0}}"/>', "fixed": ""}
    inside, ends, above = "", "", np.zeros(3)
    for link in told["chain"]:
        centre, half = np.array(link["centre"]), np.array(link["size"]) / 2
        anchor = " ".join(str(number) for number in np.array(link["anchor"]) - centre)
        place = " ".join(str(number) for number in centre - above)
        moments = link["mass"] / 3 * (sum(half**2) - half**2)
        diagonal = " ".join(str(moment) for moment in moments)
        inside += (f'<body name="{link["name"]}" pos="{place}">{kinds[link["kind"]].format(anchor, link["name"])}'
                   f'<inertial pos="0 0 0" mass="{link["mass"]}" diaginertia="{diagonal}"/>')
        ends, above = ends + "</body>", centre
    states = np.array(states)
    start = [0, *states[0][1:4], 0, 0, 0, 1, 0, 0, 0]
    servos, targets = actuators(drives)
    model, data = world(told, body(told, start, inside + ends), servos, integrator="RK4")
    data.qvel[3:6] = [2, 1, 3]
    data.ctrl[:] = targets
    mujoco.mj_forward(model, data)
    off, turned = 0.0, 0.0
    for state in states[1:]:
        for _ in range(100):
            mujoco.mj_step(model, data)
        for number in range(len(told["chain"]) + 1):
            ours = state[1 + 7 * number:8 + 7 * number]
            # MuJoCo leaves its bodies where they were in the step's last stage.
            mujoco.mj_kinematics(model, data)
            off = max(off, np.linalg.norm(ours[:3] - data.xpos[number + 1]))
            turned = max(turned, angle_between(ours[3:], data.xquat[number + 1]))
    return off, turned


def compare_chain(told, cases):
    """Compares the vehicle and a chain below it, by a ball joint, a hinge, a slide and a fixed joint, in free fall."""
    off, turned = chain_apart(told, cases["chain"], [])
    what = "vehicle and a chain of four by a ball joint, a hinge, a slide and a fixed joint, 2.4 s of free fall"
    apart(f"{what}: position", "m", mujoco=(off, 1e-9))
    apart(f"{what}: attitude", "rad", mujoco=(turned, 1e-9))


def compare_driven_chain(told, cases):
    """The same with a position servo in the hinge and a speed servo, at its limit all the time, in the slide."""
    off, turned = chain_apart(told, cases["driven chain"], told["chain drives"])
    what = "the same chain with a driven hinge and a driven slide, 1.5 s of free fall"
    apart(f"{what}: position", "m", mujoco=(off, 1e-9))
    apart(f"{what}: attitude", "rad", mujoco=(turned, 1e-9))


def compare_rotorpy(told, cases):
    from rotorpy.vehicles.multirotor import Multirotor

    states = np.array(cases["plain chirps"])
    moments = dict(zip(("Ixx", "Iyy", "Izz"), told["inertia"]))
    parameters = {
        "mass": told["mass"], **moments, "Ixy": 0.0, "Ixz": 0.0, "Iyz": 0.0, "num_rotors": 4,
        "rotor_pos": {f"r{number}": np.array(rotor["position"]) for number, rotor in enumerate(told["rotors"])},
        "rotor_directions": np.array([-rotor["spin"] for rotor in told["rotors"]]),
        "rotor_speed_min": 0.0, "rotor_speed_max": 1000.0,
        "k_eta": told["thrust coefficient"], "k_m": told["torque coefficient"], "tau_m": told["plain time constant"],
    }
    start = states[0]
    state = {"x": start[1:4], "v": start[4:7], "q": np.roll(start[7:11], -1), "w": start[11:14],
             "wind": np.zeros(3), "rotor_speeds": start[14:18]}
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    vehicle = Multirotor(parameters, state, aero=False, integrator_kwargs=exact)
    off = 0.0
    for after, target in zip(states[1:], np.array(told["targets"])):
        state = vehicle.step(state, {"cmd_motor_speeds": target}, 1e-3)
        off = max(off, np.linalg.norm(after[1:4] - state["x"]))
    apart("chirps of 66° of tilt, 10 s: position", "m", rotorpy=(off, 1e-6))


def derivatives(told, targets):
    """Of the whole state: written from the balance of linear and angular momentum of the body and its rotors."""
    inertia = np.array(told["inertia"])
    spins = np.array([rotor["spin"] for rotor in told["rotors"]])
    natural, damping = told["natural frequency"], told["damping ratio"]

    def rates(_, state):
        turn, spin, speeds, accelerations = state[6:10], state[10:13], state[13:17], state[17:21]
        lift, *torque = rotor_wrench(told, speeds)
        momentum = inertia * spin + [0, 0, told["rotor inertia"] * np.dot(spins, speeds)]
        spun_up = [0, 0, told["rotor inertia"] * np.dot(spins, accelerations)]
        w, x, y, z = turn
        up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z]) / np.dot(turn, turn)
        p, q, r = spin
        turned = 0.5 * np.array([-x * p - y * q - z * r, w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p])
        jerks = natural**2 * (targets - speeds) - 2 * damping * natural * accelerations
        return np.concatenate([state[3:6], lift / told["mass"] * up - [0, 0, told["gravity"]], turned,
                               (np.array(torque) - np.cross(spin, momentum) - spun_up) / inertia, accelerations, jerks])

    return rates


def compare_dop853(told, cases):
    from scipy.integrate import solve_ivp

    for name, targets, title in (("chirps", "targets", "chirps of 63° of tilt, 10 s: position, whole vehicle"),
                                 ("hard chirps", "hard targets", "hard chirps, past 100° of tilt: position, whole vehicle"),
                                 ("hard chirps, one step a tick", "hard targets", "the same with one step a tick")):
        states = np.array(cases[name])
        state, off = states[0][1:], 0.0
        for after, target in zip(states[1:], np.array(told[targets])):
            state = solve_ivp(derivatives(told, target), (0, 1e-3), state, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
            off = max(off, np.linalg.norm(after[1:4] - state[:3]))
        apart(title, "m", dop853=(off, 1e-6))


def table():
    yield "| what | unit | ours | " + " | ".join(NAMES.values()) + " | may be apart by |"
    yield "|---|---|---|" + "---|" * len(NAMES) + "---|"
    for what, unit, ours, cells in rows:
        found = [cells[name][0] if name in cells else "" for name in NAMES]
        limits = ", ".join(f"{limit:.2g} ({NAMES[name]})" for name, (_, _, limit) in cells.items())
        yield f"| {what} | {unit} | {ours} | " + " | ".join(found) + f" | {limits} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--only", help="one comparison, such as slide")
    arguments = parser.parse_args()
    with open(arguments.cases, encoding="utf-8") as file:
        told = json.load(file)
    comparisons = [compare_tumble, compare_plain_chirps]
    if arguments.all:
        comparisons += [compare_rotorpy, compare_dop853]
    comparisons += [compare_bounces, compare_slide, compare_rest, compare_tip, compare_stack, compare_rigs, compare_chain]
    comparisons += [compare_driven_chain]
    for compare in comparisons:
        if arguments.only is None or compare.__name__ == f"compare_{arguments.only}":
            compare(told, told["cases"])
    print("\n".join(table()))
    if not rows:
        parser.error(f"there is no comparison {arguments.only!r}")
    wrong = [
        f"{what}: {shown} by {NAMES[name]}, ours {ours or 'the other'}, {off:.2g} {unit} apart, may be {limit:.2g}"
        for what, unit, ours, cells in rows
        for name, (shown, off, limit) in cells.items()
        if not off <= limit
    ]
    for difference in wrong:
        print(f"compare_world.py: {difference}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
