"""Makes a file for the Rerun viewer of a recording: the vehicles in their scene, and plots of what was flown and asked.

Usage: python3 scripts/rerun_view.py hover.mcap hover.rrd [VEHICLE] && rerun hover.rrd   (rerun-sdk 0.41, mcap-ros2-support)

All vehicles are drawn; the plots are of VEHICLE, else of the first. The airframes are those of `hummingbus urdf`: the program is
that of the environment variable HUMMINGBUS, else of target/release or target/debug, else of the PATH.
"""

import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import tomllib
import types

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping
from rerun.urdf import UrdfTree

MESSAGE = "hummingbus_msgs.msg.{}:message"
# Name of a plot, and its lines: topic, message type, field, colour. What was asked for is grey.
BLUE, RED, GREEN, GREY = [0, 114, 178], [213, 94, 0], [0, 158, 115], [90, 90, 90]
PLOTS = {
    "Position [m]": [
        ("plant/state", "PlantState", ".position.x", BLUE),
        ("plant/state", "PlantState", ".position.y", RED),
        ("plant/state", "PlantState", ".position.z", GREEN),
        ("pilot/set_point", "SetPoint", ".altitude", GREY),
    ],
    "Velocity [m/s]": [
        ("plant/state", "PlantState", ".velocity.x", BLUE),
        ("plant/state", "PlantState", ".velocity.y", RED),
        ("plant/state", "PlantState", ".velocity.z", GREEN),
    ],
}


METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
MESHES = {".obj": "model/obj", ".stl": "model/stl", ".glb": "model/gltf-binary"}
# Length of the axes at a vehicle, in metres, so that one is seen from afar: tuned, no source.
AXES_M = 0.3


def read(recording):
    """The topics of a recording with their types, its scene, and the attached mesh files by their names."""
    scene, meshes = {}, {}
    with open(recording, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        topics = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
        for attachment in reader.iter_attachments():
            if pathlib.Path(attachment.name).suffix.lower() in MESHES:
                meshes[pathlib.PurePosixPath(attachment.name).name] = attachment.data
                continue
            table = tomllib.loads(attachment.data.decode())
            if any(things in table for things in ("boxes", "meshes", "balls")):
                scene = table
    return topics, scene, meshes


def program():
    """The program `hummingbus`; None where there is none."""
    target = pathlib.Path(__file__).resolve().parent.parent / "target"
    known = [os.environ.get("HUMMINGBUS"), target / "release/hummingbus", target / "debug/hummingbus"]
    found = (str(path) for path in known if path and os.access(path, os.X_OK))
    return next(found, None) or shutil.which("hummingbus")


def log_airframe(recording, vehicle, frame, folder):
    """Logs what is seen of a vehicle, and what of it touches; returns the entity of the latter, which is hidden at first."""
    urdf = str(pathlib.Path(folder) / "vehicle.urdf")
    command = [program() or "hummingbus", "urdf", recording, "--frame", frame, "--out", urdf]
    try:
        command += ["--vehicle", vehicle] if vehicle else []
        subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError:
        print("no airframe: the program `hummingbus` is not built, and not in the PATH", file=sys.stderr)
        return None
    except subprocess.CalledProcessError as error:
        print(f"no airframe of {vehicle or 'the vehicle'}: {error.stderr.strip()}", file=sys.stderr)
        return None
    parts = ["airframe", vehicle] if vehicle else ["airframe"]
    rr.log_file_from_path(urdf, entity_path_prefix=rr.new_entity_path(parts), static=True)
    return rr.new_entity_path([*parts, UrdfTree.from_file_path(urdf).name, "collision_geometries"])


def line(message, field, colour):
    """A line of a plot that shows one number of a message."""
    source = VisualizerComponentMapping(
        "Scalars:scalars",
        ComponentSourceKind.SourceComponent,
        source_component=MESSAGE.format(message),
        selector=field,
    )
    return rr.SeriesLines(names=field[1:], colors=colour).visualizer(mappings=[source])


def plot(name, lines, prefix, topics):
    overrides = {}
    for topic, message, field, colour in lines:
        if prefix + topic in topics:
            overrides.setdefault(prefix + topic, []).append(line(message, field, colour))
    return rrb.TimeSeriesView(name=name, contents=list(overrides), overrides=overrides)


def roll_pitch_yaw_deg(q):
    """The angles of a quaternion in the sequence z-y-x."""
    roll = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2))
    pitch = math.asin(max(-1, min(1, 2 * (q.w * q.y - q.z * q.x))))
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
    return [math.degrees(angle) for angle in (roll, pitch, yaw)]


def log_angles(entity, colours, suffix, messages, angles_deg):
    """Logs roll, pitch and yaw over time, which the viewer cannot make of a message by itself."""
    names = [f"{angle}{suffix}" for angle in ("roll", "pitch", "yaw")]
    rr.log(entity, rr.SeriesLines(colors=colours, names=names), static=True)
    times = rr.TimeColumn("message_log_time", timestamp=[message.log_time_ns * 1e-9 for message in messages])
    scalars = rr.Scalars.columns(scalars=[angles_deg(message.ros_msg) for message in messages])
    rr.send_columns(entity, [times], scalars)


def log_attitude(states, set_points):
    def asked_deg(message):
        return [math.degrees(angle) for angle in (message.roll, message.pitch, message.yaw)]

    log_angles("flown/attitude", [BLUE, RED, GREEN], "", states, lambda state: roll_pitch_yaw_deg(state.attitude))
    if set_points:
        log_angles("asked/attitude", [GREY] * 3, " set point", set_points, asked_deg)


def metres(quantity):
    """A length of a scene file, or three."""
    value, unit = quantity["value"], METRES[quantity["unit"]]
    return [length * unit for length in value] if isinstance(value, list) else value * unit


def yaw_deg(thing):
    """How a thing of a scene file is turned about the vertical."""
    yaw = thing.get("yaw", {"value": 0, "unit": "deg"})
    return yaw["value"] if yaw["unit"] == "deg" else math.degrees(yaw["value"])


def log_boxes(boxes):
    centres = [metres(box["centre"]) for box in boxes]
    halves = [[length / 2 for length in metres(box["size"])] for box in boxes]
    turns = [rr.RotationAxisAngle([0, 0, 1], degrees=yaw_deg(box)) for box in boxes]
    names = [box["name"] for box in boxes]
    shape = rr.Boxes3D(centers=centres, half_sizes=halves, rotation_axis_angles=turns, labels=names)
    rr.log("scene", rr.CoordinateFrame("map"), shape, static=True)


def log_mesh(mesh, files):
    """Logs a mesh of a scene file, if its file is attached: by its name alone."""
    name = pathlib.PurePath(mesh["file"]).name
    if name not in files:
        print(f"not drawn: {mesh['name']}, whose file {name} the recording has not attached", file=sys.stderr)
        return
    kind = pathlib.Path(name).suffix.lower()
    scale = metres(mesh["scale"]) if "scale" in mesh else 1.0
    half = math.radians(yaw_deg(mesh)) / 2
    # glTF has y up: turned about x by 90 degrees first. Half of that has the sine and the cosine of 45 degrees.
    s, c = (math.sqrt(0.5), math.sqrt(0.5)) if kind == ".glb" else (0.0, 1.0)
    turn = [math.cos(half) * s, math.sin(half) * s, math.sin(half) * c, math.cos(half) * c]
    place = rr.InstancePoses3D(translations=[metres(mesh["position"])], quaternions=[turn], scales=[[scale] * 3])
    shape = rr.Asset3D(contents=files[name], media_type=MESHES[kind])
    rr.log(rr.new_entity_path(["scene", mesh["name"]]), rr.CoordinateFrame("map"), place, shape, static=True)


def log_balls(balls):
    shape = rr.Ellipsoids3D(
        centers=[metres(ball["centre"]) for ball in balls],
        half_sizes=[[metres(ball["radius"])] * 3 for ball in balls],
        labels=[ball["name"] for ball in balls],
        fill_mode="solid",
    )
    rr.log("balls", rr.CoordinateFrame("map"), shape, static=True)


def log_bodies(scene, messages):
    """Logs the free bodies of a scene, which move as `messages` say: in their order, boxes before meshes before balls."""
    moving = [
        (kind, thing) for kind in ("boxes", "meshes", "balls") for thing in scene.get(kind, []) if "mass" in thing
    ]
    for number, (kind, thing) in enumerate(moving):
        frame, entity = f"body {thing['name']}", rr.new_entity_path(["bodies", thing["name"]])
        if kind == "boxes":
            half = [length / 2 for length in metres(thing["size"])]
            shape = rr.Boxes3D(half_sizes=[half], labels=[thing["name"]], fill_mode="solid")
        elif kind == "balls":
            half = [metres(thing["radius"])] * 3
            shape = rr.Ellipsoids3D(half_sizes=[half], labels=[thing["name"]], fill_mode="solid")
        else:
            # What moves is its centre of mass, which the file does not say: its axes are seen.
            shape = rr.TransformAxes3D(AXES_M)
        rr.log(entity, rr.CoordinateFrame(frame), shape, static=True)
        states = [
            types.SimpleNamespace(
                log_time_ns=message.log_time_ns,
                ros_msg=types.SimpleNamespace(
                    position=message.ros_msg.position[number], attitude=message.ros_msg.attitude[number]
                ),
            )
            for message in messages[::10]
        ]
        log_motion(rr.new_entity_path(["bodies", thing["name"], "motion"]), states, frame)


def log_path(entity, states, colour):
    points = [[at.x, at.y, at.z] for at in (message.ros_msg.position for message in states)]
    # A point each 20 samples: more would only make the file larger.
    rr.log(entity, rr.CoordinateFrame("map"), rr.LineStrips3D([points[::20]], colors=colour), static=True)


def log_motion(entity, states, frame):
    """Logs how a frame moves in the world, where the recording has no transforms of it."""
    # 100 a second are enough to look at.
    period_ns, last_ns, shown = 10_000_000, None, []
    for message in states:
        if last_ns is None or message.log_time_ns - last_ns >= period_ns:
            last_ns = message.log_time_ns
            shown.append(message)
    times = rr.TimeColumn("message_log_time", timestamp=[message.log_time_ns * 1e-9 for message in shown])
    at = [message.ros_msg.position for message in shown]
    turned = [message.ros_msg.attitude for message in shown]
    poses = rr.Transform3D.columns(
        translation=[[p.x, p.y, p.z] for p in at],
        quaternion=[[q.x, q.y, q.z, q.w] for q in turned],
        parent_frame=["map"] * len(shown),
        child_frame=[frame] * len(shown),
    )
    rr.send_columns(entity, [times], poses)


def log_vehicle(recording, vehicle, number, has_transforms):
    """Logs a vehicle's body and path; returns its states, and the entity of what touches.

    `has_transforms` is true if the recording holds the transforms of its frame.
    """
    states = list(read_ros2_messages(recording, topics=[f"/{vehicle}/plant/state" if vehicle else "/plant/state"]))

    def entity(name):
        return rr.new_entity_path([name, vehicle] if vehicle else [name])

    # The frame that the vehicle's plant publishes, where its output `tf` is recorded.
    frame = f"{vehicle}/body" if vehicle else "hb_body"
    # The axes of the body, x forward, y left, z up.
    rr.log(entity("body"), rr.CoordinateFrame(frame), rr.TransformAxes3D(AXES_M), static=True)
    if states:
        log_path(entity("path"), states, [BLUE, RED, GREEN][number % 3])
    if states and not has_transforms:
        log_motion(entity("motion"), states, frame)
    with tempfile.TemporaryDirectory() as folder:
        return states, log_airframe(recording, vehicle, frame, folder)


def vehicles_of(topics):
    """The vehicles by name, h2 before h10; one without a name where none has one."""
    suffix = "/plant/state"
    names = {topic.removesuffix(suffix).strip("/") for topic in topics if topic.endswith(suffix)}
    return sorted((name for name in names if not name.startswith("shadow")), key=lambda name: (len(name), name)) or [""]


def main(recording, out, shown=None):
    topics, scene, meshes = read(recording)
    vehicles = vehicles_of(topics)
    shown = vehicles[0] if shown is None else shown
    rr.init("hummingbus")
    # The view is told at the end, when it is known what is to be hidden.
    rr.save(out)
    rr.log_file_from_path(recording)
    transforms = [topic for topic, name in topics.items() if name == "tf2_msgs/msg/TFMessage"]
    hidden = []
    for number, vehicle in enumerate(vehicles):
        has_transforms = any(topic.startswith(f"/{vehicle}/" if vehicle else "/") for topic in transforms)
        states, touching = log_vehicle(recording, vehicle, number, has_transforms)
        hidden += [touching] if touching else []
        if vehicle == shown and states:
            topic = f"/{vehicle}/pilot/set_point" if vehicle else "/pilot/set_point"
            log_attitude(states, list(read_ros2_messages(recording, topics=[topic])))
    still = {kind: [thing for thing in scene.get(kind, []) if "mass" not in thing] for kind in ("boxes", "meshes", "balls")}
    if still["boxes"]:
        log_boxes(still["boxes"])
    if still["balls"]:
        log_balls(still["balls"])
    for mesh in still["meshes"]:
        log_mesh(mesh, meshes)
    bodies = [topic for topic, name in topics.items() if name == "hummingbus_msgs/msg/BodyStates"]
    if bodies:
        log_bodies(scene, list(read_ros2_messages(recording, topics=bodies[:1])))
    prefix = f"/{shown}/" if shown else "/"
    plots = [plot(name, lines, prefix, topics) for name, lines in PLOTS.items()]
    plots.insert(1, rrb.TimeSeriesView(name="Attitude [deg]", contents=["/flown/attitude", "/asked/attitude"]))
    overrides = {entity: rrb.EntityBehavior(visible=False) for entity in hidden}
    inside = rrb.SpatialInformation(target_frame="map")
    space = rrb.Spatial3DView(name="Space", spatial_information=inside, overrides=overrides)
    rr.send_blueprint(rrb.Blueprint(rrb.Horizontal(space, rrb.Vertical(*plots)), rrb.TimePanel(timeline="message_log_time")))
    rr.disconnect()


if __name__ == "__main__":
    main(*sys.argv[1:])
