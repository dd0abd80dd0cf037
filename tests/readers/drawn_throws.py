"""Draws stacks and throws from seeds, and writes each as a scene file and a manifest that `hummingbus run` flies.

A body is a dictionary: `shape` ("box", "prism" or "ball"), `half` (half of its edges, m; a prism or ball fills that box),
`mass` (kg), `centre` (m), `yaw` (rad), `velocity` (m/s) and `spin` (rad/s), all in the world's axes. A prism is a closed
convex mesh. Bodies are in the order of a scene: boxes, meshes, balls.
"""

import math
import pathlib
import random

ROOT = pathlib.Path(__file__).resolve().parents[2]
G_M_S2 = 9.81
# Sides of a prism. Faces with more than four corners have tests of their own: plant/tests/prisms.rs.
SIDES = 3
# Lengths of stacks are multiples of this, so that bodies touch exactly, without rounding.
GRAIN_M = 1 / 1024
# A stack whose margin is smaller, on either side of its edge, is drawn again.
MARGIN_M = 0.008
WALL = {"centre": [1.6, 0.0, 2.0], "half": [0.1, 3.0, 2.0]}

# A slide lasts 2 s at most. Falls and throws come to rest.
DURATION_S = {"stands": 1.0, "falls": 3.0, "drop": 3.0, "slide": 2.2, "bowl": 1.0, "floor": 3.0, "wall": 3.0, "hit": 3.0}

MANIFEST = """
[run]
duration_s = {duration}
seed = 1

# The bodies alone are judged: the vehicle falls far away from them.
[process.idle]
kind = "player"
data = "idle.csv"

[process.idle.parameters.columns]
time = {{ columns = ["t"], unit = "s" }}
command = {{ columns = ["one", "one", "one", "one"], unit = "count" }}
position = {{ columns = ["zero", "zero", "zero"], unit = "m" }}
velocity = {{ columns = ["zero", "zero", "zero"], unit = "m/s" }}
attitude = {{ columns = ["zero", "zero", "zero", "one"], unit = "1" }}
angular_velocity = {{ columns = ["zero", "zero", "zero"], unit = "rad/s" }}

[process.plant]
kind = "plant"
vehicle = "{vehicle}"
scene = "{name}.scene.toml"
inputs.command = {{ topic = "/idle/command", delay_ticks = 1, initial = {{ command = [1, 1, 1, 1] }} }}
parameters = {{ backend = "rapier", initial_position_m = [0.0, 100.0, 200.0] }}
outputs.bodies = {{}}

[process.recorder]
kind = "recorder"
inputs.bodies = "/plant/bodies"
"""


class Draw(random.Random):
    """Numbers that depend on the words of the seed alone."""

    def grains(self, least_m, most_m):
        return GRAIN_M * self.randint(round(least_m / GRAIN_M), round(most_m / GRAIN_M))

    def vector(self, *most):
        return [self.uniform(-each, each) for each in most]

    def mass(self):
        """Over 1:100."""
        return 10 ** self.uniform(-1, 1)

    def body(self, shape, half, centre=(0.0, 0.0, 0.0)):
        yaw = 0.0 if shape == "ball" else self.uniform(0, math.pi)
        return {"shape": shape, "half": list(half), "mass": self.mass(), "centre": list(centre), "yaw": yaw,
                "velocity": [0.0] * 3, "spin": [0.0] * 3}

    def upright(self, shape):
        """A body of a stack, with its heights in grains."""
        if shape == "box":
            return self.body(shape, [self.grains(0.06, 0.15), self.grains(0.06, 0.15), self.grains(0.04, 0.12)])
        radius = self.grains(0.06, 0.12)
        return self.body(shape, [radius, radius, radius if shape == "ball" else self.grains(0.04, 0.12)])


def corners(body):
    """The corners of a box's or prism's face seen from above, counter-clockwise, in the world."""
    half, yaw, (x, y, _) = body["half"], body["yaw"], body["centre"]
    if body["shape"] == "box":
        flat = [(half[0] * a, half[1] * b) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    else:
        flat = [(point[0], point[1]) for point in ring(half)]
    turned = ((math.cos(yaw) * a - math.sin(yaw) * b, math.sin(yaw) * a + math.cos(yaw) * b) for a, b in flat)
    return [(x + a, y + b) for a, b in turned]


def ring(half):
    """The corners of a prism's face about its axis."""
    angles = (2 * math.pi * number / SIDES for number in range(SIDES))
    return [(half[0] * math.cos(angle), half[0] * math.sin(angle)) for angle in angles]


def sides(polygon):
    """Each side of a polygon as a point and the unit vector to its left, which is inside."""
    for (x, y), (u, v) in zip(polygon, polygon[1:] + polygon[:1]):
        length = math.hypot(u - x, v - y)
        if length > 0:
            yield (x, y), ((y - v) / length, (u - x) / length)


def inside_m(polygon, point):
    """How far a point is inside of a convex polygon; negative outside."""
    return min((point[0] - x) * a + (point[1] - y) * b for (x, y), (a, b) in sides(polygon)) if len(polygon) > 2 else -1.0


def clipped(polygon, other):
    """The part that two convex polygons share."""
    for (x, y), (a, b) in sides(other):
        depth = [(u - x) * a + (v - y) * b for u, v in polygon]
        kept = []
        for (one, deep), (two, deeper) in zip(zip(polygon, depth), zip(polygon[1:] + polygon[:1], depth[1:] + depth[:1])):
            if deep >= 0:
                kept.append(one)
            if (deep >= 0) != (deeper >= 0):
                part = deep / (deep - deeper)
                kept.append(tuple(m + part * (n - m) for m, n in zip(one, two)))
        polygon = kept
    return polygon


def margin_m(bodies):
    """The margin by which a stack of level faces stands, from the bottom up; negative if it falls.

    The centre of mass of all bodies above a face has to be over the part that the two faces share.
    """
    least = math.inf
    for number in range(1, len(bodies)):
        above = bodies[number:]
        mass = sum(body["mass"] for body in above)
        middle = [sum(body["mass"] * body["centre"][axis] for body in above) / mass for axis in (0, 1)]
        face = corners(bodies[number - 1])
        if bodies[number]["shape"] != "ball":
            face = clipped(face, corners(bodies[number]))
        least = min(least, inside_m(face, middle))
    return least


def piled(draw, count, aside_m, gaps_m=0.0):
    """Bodies on each other, from the bottom up; the last may be a ball."""
    bodies, top_m = [], 0.0
    for number in range(count):
        shape = draw.choice(["box", "box", "box", "prism"] + ["ball"] * (number == count - 1))
        body = draw.upright(shape)
        x, y, _ = draw.vector(aside_m, aside_m, 0)
        bottom_m = top_m + draw.uniform(0, gaps_m)
        body["centre"] = [x, y, bottom_m + body["half"][2]]
        top_m = bottom_m + 2 * body["half"][2]
        bodies.append(body)
    return bodies


def stack(draw, stands):
    """2 to 6 bodies that touch, and that stand, or fall, by more than the margin."""
    count = draw.randint(2, 6)
    while True:
        bodies = piled(draw, count, 0.05 if stands else 0.08)
        margin = margin_m(bodies)
        if margin > MARGIN_M if stands else -0.05 < margin < -MARGIN_M:
            return bodies


def drop(draw):
    """2 to 6 bodies above each other, which fall up to 5 cm each."""
    return piled(draw, draw.randint(2, 6), 0.05, 0.05)


def slide(draw):
    """A flat box that slides on the floor without turning."""
    body = draw.body("box", [draw.uniform(0.1, 0.2), draw.uniform(0.1, 0.2), draw.uniform(0.01, 0.03)])
    speed, angle = draw.uniform(1, 4), draw.uniform(0, 2 * math.pi)
    body["centre"][2] = body["half"][2]
    body["velocity"] = [speed * math.cos(angle), speed * math.sin(angle), 0.0]
    return [body]


def bowl(draw):
    """A ball that slides on the floor, until it rolls."""
    ball = draw.upright("ball")
    speed, angle = draw.uniform(1, 4), draw.uniform(0, 2 * math.pi)
    ball["centre"][2] = ball["half"][2]
    ball["velocity"] = [speed * math.cos(angle), speed * math.sin(angle), 0.0]
    return [ball]


def thrown(draw, shape, speed, up, centre):
    body = draw.upright(shape)
    aside = draw.uniform(-0.1, 0.1)
    body["centre"], body["velocity"], body["spin"] = centre, [speed, aside, up], draw.vector(4, 4, 4)
    return body


def throw(draw, shape):
    """Over the floor."""
    return [thrown(draw, shape, draw.uniform(1, 4), draw.uniform(-1, 2), [0.0, 0.0, draw.uniform(0.3, 0.8)])]


def throw_at_wall(draw, shape):
    """Above the floor at the wall, from 1.5 m."""
    speed = draw.uniform(3, 6)
    return [thrown(draw, shape, speed, G_M_S2 * 0.75 / speed, [0.0, 0.0, draw.uniform(0.5, 1.2)])]


def throw_at_stack(draw, shape):
    """From 1.5 m at the middle of the upper half of a stack that stands."""
    while True:
        bodies = piled(draw, draw.randint(2, 5), 0.04)
        if margin_m(bodies) > MARGIN_M:
            break
    top_m = bodies[-1]["centre"][2] + bodies[-1]["half"][2]
    speed = draw.uniform(3, 6)
    body = thrown(draw, shape, speed, G_M_S2 * 0.75 / speed, [-1.5, draw.uniform(-0.05, 0.05), 0.75 * top_m])
    body["centre"][2] = max(body["centre"][2], 0.2)
    return bodies + [body]


def drawn(seed):
    """The cases of a seed: each shape is thrown once."""
    shapes = [("box", "ball", "prism")[(seed + number) % 3] for number in range(3)]
    kinds = {
        "stands": lambda draw: stack(draw, True),
        "falls": lambda draw: stack(draw, False),
        "drop": drop,
        "slide": slide,
        "bowl": bowl,
        "floor": lambda draw: throw(draw, shapes[0]),
        "wall": lambda draw: throw_at_wall(draw, shapes[1]),
        "hit": lambda draw: throw_at_stack(draw, shapes[2]),
    }
    for kind, bodies in kinds.items():
        draw = Draw(f"{kind} {seed}")
        friction = draw.uniform(0.2, 0.9)
        bounces = kind in ("floor", "wall", "hit") and draw.random() < 0.6
        restitution = draw.uniform(0.1, 0.6) if bounces else 0.0
        order = ["box", "prism", "ball"]
        yield {"kind": kind, "name": f"{kind}-{seed}", "friction": friction, "restitution": restitution,
               "duration": DURATION_S[kind], "walls": [WALL] if kind == "wall" else [],
               "bodies": sorted(bodies(draw), key=lambda body: order.index(body["shape"]))}


def given(value, unit):
    return f'{{ value = {value}, unit = "{unit}", source = "drawn", uncertainty = "exact" }}'


def mesh(body):
    """A prism as the corners of its lower, then of its upper face, and its faces, counted from 0."""
    points = [(x, y, z) for z in (-body["half"][2], body["half"][2]) for x, y in ring(body["half"])]
    around = [(number, (number + 1) % SIDES) for number in range(SIDES)]
    faces = [[one, two, two + SIDES, one + SIDES] for one, two in around]
    return points, [*faces, list(range(SIDES))[::-1], list(range(SIDES, 2 * SIDES))]


def obj(body):
    points, faces = mesh(body)
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    return "\n".join(lines + ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]) + "\n"


def placed(body, number, name, folder):
    """The table of a body."""
    half = body["half"]
    keys = {"mass": given(body["mass"], "kg"), "velocity": given(body["velocity"], "m/s"),
            "angular_velocity": given(body["spin"], "rad/s")}
    if body["shape"] == "ball":
        table, more = "balls", {"centre": given(body["centre"], "m"), "radius": given(half[0], "m")}
    elif body["shape"] == "box":
        table, more = "boxes", {"centre": given(body["centre"], "m"), "size": given([2 * edge for edge in half], "m"),
                                "yaw": given(body["yaw"], "rad")}
    else:
        file = f"{name}.{number}.obj"
        (folder / file).write_text(obj(body), encoding="utf-8")
        table, more = "meshes", {"file": f'"{file}"', "position": given(body["centre"], "m"), "solid": '"convex"',
                                 "yaw": given(body["yaw"], "rad"), "scale": given(1, "m")}
    lines = "".join(f"{key} = {value}\n" for key, value in (more | keys).items())
    return f'[[{table}]]\nname = "body {number}"\n{lines}'


def write(case, folder):
    """Writes the scene, its meshes and the manifest of a case; the path of the manifest."""
    name = case["name"]
    text = f'name = "{name}"\nfriction = {given(case["friction"], "1")}\nrestitution = {given(case["restitution"], "1")}\n'
    for number, wall in enumerate(case["walls"]):
        size = [2 * edge for edge in wall["half"]]
        text += f'[[boxes]]\nname = "wall {number}"\ncentre = {given(wall["centre"], "m")}\nsize = {given(size, "m")}\n'
    text += "".join(placed(body, number, name, folder) for number, body in enumerate(case["bodies"]))
    (folder / f"{name}.scene.toml").write_text(text, encoding="utf-8")
    (folder / "idle.csv").write_text("t,zero,one\n0,0,1\n10,0,1\n", encoding="utf-8")
    manifest = folder / f"{name}.toml"
    vehicle = ROOT / "vehicles/hummingbird.toml"
    manifest.write_text(MANIFEST.format(duration=case["duration"], vehicle=vehicle, name=name), encoding="utf-8")
    return manifest
