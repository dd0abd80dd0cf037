"""Makes a file for the Rerun viewer of a recording: the vehicle in its scene, and plots of what was flown and asked.

Usage: python3 scripts/rerun_view.py hover.mcap hover.rrd [VEHICLE] && rerun hover.rrd   (rerun-sdk 0.41, mcap-ros2-support)
"""

import math
import sys
import tomllib

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

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


def read(recording):
    """The topics of a recording with their types, and the boxes of its scene."""
    with open(recording, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        topics = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
        files = [tomllib.loads(attachment.data.decode()) for attachment in reader.iter_attachments()]
    return topics, [box for file in files if "boxes" in file for box in file["boxes"]]


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


def log_scene(boxes):
    centres = [box["centre"]["value"] for box in boxes]
    halves = [[length / 2 for length in box["size"]["value"]] for box in boxes]
    yaws = [box.get("yaw", {"value": 0, "unit": "rad"}) for box in boxes]
    degrees = [yaw["value"] if yaw["unit"] == "deg" else math.degrees(yaw["value"]) for yaw in yaws]
    turns = [rr.RotationAxisAngle([0, 0, 1], degrees=angle) for angle in degrees]
    names = [box["name"] for box in boxes]
    shape = rr.Boxes3D(centers=centres, half_sizes=halves, rotation_axis_angles=turns, labels=names)
    rr.log("scene", rr.CoordinateFrame("map"), shape, static=True)


def log_path(states):
    points = [[at.x, at.y, at.z] for at in (message.ros_msg.position for message in states)]
    # A point each 20 samples: more would only make the file larger.
    rr.log("path", rr.CoordinateFrame("map"), rr.LineStrips3D([points[::20]], colors=BLUE), static=True)


def main(recording, out, vehicle=""):
    topics, boxes = read(recording)
    prefix = f"/{vehicle}/" if vehicle else "/"
    plots = [plot(name, lines, prefix, topics) for name, lines in PLOTS.items()]
    plots.insert(1, rrb.TimeSeriesView(name="Attitude [deg]", contents=["/flown/attitude", "/asked/attitude"]))
    space = rrb.Spatial3DView(name="Space", spatial_information=rrb.SpatialInformation(target_frame="map"))
    view = rrb.Blueprint(rrb.Horizontal(space, rrb.Vertical(*plots)), rrb.TimePanel(timeline="message_log_time"))
    rr.init("hummingbus")
    rr.save(out, default_blueprint=view)
    rr.log_file_from_path(recording)
    # The axes of the body, x forward, y left, z up: a pose alone is not seen.
    rr.log("body", rr.CoordinateFrame("hb_body"), rr.TransformAxes3D(0.4), static=True)
    states = list(read_ros2_messages(recording, topics=[prefix + "plant/state"]))
    if states:
        log_path(states)
        log_attitude(states, list(read_ros2_messages(recording, topics=[prefix + "pilot/set_point"])))
    if boxes:
        log_scene(boxes)
    rr.disconnect()


if __name__ == "__main__":
    main(*sys.argv[1:])
