"""Holds stacks, slides and throws of boxes that examples/drawn_bodies.rs drew and flew against MuJoCo.

    compare_bodies.py CASES.json

What falls over an edge falls to either side by less than any engine knows. So MuJoCo flies each case twice, with steps of
0.2 and 0.1 ms, and a case is compared only where the two agree with each other: within half of what ours may be off. The
loads on the four corners of a rigid box are not determined by its motion. MuJoCo's soft contacts share them evenly, ours need not:
a box that slides and turns stops elsewhere by a few hundredths of its way.
It prints a table of the kinds. It ends with 1 where more than 15 % of the cases of a kind are farther apart than they may be, where
MuJoCo agrees with itself on less than a quarter, or where contacts were not solved.
"""

import json
import sys
from concurrent.futures import ProcessPoolExecutor

import mujoco
import numpy as np

G_M_S2 = 9.81
STEPS_S = (2e-4, 1e-4)
# Largest deviation of ours at the end, by kind: of each box its position, m, and its attitude, rad.
MAY_BE = {"stack": (0.02, 0.06), "slide": (0.05, 0.4), "throw": (0.1, 0.4)}

# Part of the cases of a kind that may be farther apart.
FAR_MOST = 0.15


def flown(case, step_s):
    """Position (m) and attitude (quaternion, w first) of each box at the end, by MuJoCo."""
    contact = f'solref="{2 * step_s} 1" solimp="0.999 0.9999 1e-6" friction="{case["friction"]} 0 0"'
    boxes = "".join(
        f'<body pos="{text(box["centre"])}"><freejoint/><geom type="box" size="{text(np.array(box["size"]) / 2)}" '
        f'mass="{box["mass"]}" {contact}/></body>'
        for box in case["boxes"]
    )
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{step_s}" gravity="0 0 {-G_M_S2}" integrator="implicitfast" cone="elliptic" impratio="100"
        iterations="200" tolerance="1e-12"/>
      <default><geom condim="3"/></default>
      <worldbody><geom type="plane" size="0 0 1" {contact}/>{boxes}</worldbody></mujoco>""")
    data = mujoco.MjData(model)
    for number, box in enumerate(case["boxes"]):
        # Level at the start: the body's axes are the world's.
        data.qvel[6 * number:6 * number + 6] = box["velocity"] + box["spin"]
    for _ in range(round(case["duration"] / step_s)):
        mujoco.mj_step(model, data)
    return data.qpos.reshape(-1, 7).copy()


def text(numbers):
    return " ".join(str(number) for number in numbers)


def off(ours, others):
    """The farthest that a box of one is from the same box of the other: m, rad."""
    ours, others = np.array(ours), np.array(others)
    turned = 2 * np.arccos(np.clip(abs(np.sum(ours[:, 3:] * others[:, 3:], axis=1)), 0, 1))
    return np.linalg.norm(ours[:, :3] - others[:, :3], axis=1).max(), turned.max()


def judged(case):
    """Ours from MuJoCo's finer answer, and MuJoCo's answers from each other."""
    coarse, fine = (flown(case, step_s) for step_s in STEPS_S)
    return off(case["end"], fine), off(coarse, fine)


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        cases = json.load(file)
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judged, cases))
    print("| kind | drawn | MuJoCo agrees with itself | ours within | median apart | farthest apart |")
    print("|---|---|---|---|---|---|")
    wrong = []
    for kind, may_be in MAY_BE.items():
        mine = [(number, *pair) for number, (case, pair) in enumerate(zip(cases, found)) if case["kind"] == kind]
        certain = [(number, ours) for number, ours, theirs in mine if all(np.array(theirs) < np.array(may_be) / 2)]
        far = [(kind, number, ours) for number, ours in certain if any(np.array(ours) > may_be)]
        # A box that tumbles may fall to another face by less than MuJoCo's two answers show.
        wrong += far if len(far) > FAR_MOST * len(certain) else []
        troubles = [(number, case["trouble"]) for number, case in enumerate(cases) if case["kind"] == kind]
        wrong += [(kind, number, trouble) for number, trouble in troubles if trouble]
        if 4 * len(certain) < len(mine):
            wrong.append((kind, "most", f"MuJoCo is certain of {len(certain)} of {len(mine)}"))
        apart = np.array([ours for _, ours in certain] or [(np.nan, np.nan)])
        within = sum(all(ours < np.array(may_be)) for ours in apart)
        middle, most = np.median(apart, axis=0), apart.max(axis=0)
        print(f"| {kind} | {len(mine)} | {len(certain)} | {within} | {middle[0]:.2g} m, {middle[1]:.2g} rad "
              f"| {most[0]:.2g} m, {most[1]:.2g} rad |")
    for kind, number, ours in wrong:
        print(f"compare_bodies.py: {kind}, case {number}: {ours}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
