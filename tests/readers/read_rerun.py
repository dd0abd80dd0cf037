"""Compares a recording as `rerun mcap convert` reads it. Usage: read_rerun.py RECORDING LINES_OF_CAT"""

import os
import pathlib
import subprocess
import sys
import tempfile

import pyarrow
import rerun.chunk
from expected import Expected, fail, leaves

ROTATION, TRANSLATION = ["x", "y", "z", "w"], ["x", "y", "z"]

# Schemas that Rerun knows become 3-D archetypes: which, where the message has its stamp, and which of the
# message's fields the elements of each component are.
DRAWN = {
    "geometry_msgs/msg/PoseStamped": (
        "rerun.archetypes.InstancePoses3D",
        "header.stamp",
        {
            "CoordinateFrame:frame": ["header.frame_id"],
            "InstancePoses3D:translations": [f"pose.position.{axis}" for axis in TRANSLATION],
            "InstancePoses3D:quaternions": [f"pose.orientation.{axis}" for axis in ROTATION],
        },
    ),
    "tf2_msgs/msg/TFMessage": (
        "rerun.archetypes.Transform3D",
        "transforms[0].header.stamp",
        {
            "Transform3D:parent_frame": ["transforms[0].header.frame_id"],
            "Transform3D:child_frame": ["transforms[0].child_frame_id"],
            "Transform3D:translation": [f"transforms[0].transform.translation.{axis}" for axis in TRANSLATION],
            "Transform3D:quaternion": [f"transforms[0].transform.rotation.{axis}" for axis in ROTATION],
        },
    ),
}


def convert(recording, rrd):
    # Rerun sends usage data, except where CI is set.
    environment = {**os.environ, "CI": "true"}
    command = [sys.executable, "-m", "rerun", "mcap", "convert", recording, "--output", rrd]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        fail(f"rerun mcap convert: {result.stderr}")


def times_ns(batch, timeline):
    return batch.column(timeline).cast(pyarrow.int64()).to_pylist()


def component(batch, row, name):
    """The one instance of a component in a row."""
    instances = batch.column(name)[row].as_py()
    if len(instances) != 1:
        fail(f"{name} has {len(instances)} instances")
    return instances[0]


def compare_reflected(expected, chunk, batch, schema):
    """Compares messages of a type that Rerun does not know: it shows them as they are."""
    name = f"{schema.replace('/', '.')}:message"
    log_times = times_ns(batch, "message_log_time")
    # Rerun makes a timeline of a message's stamp.
    for row, (time_ns, stamp_ns) in enumerate(zip(log_times, times_ns(batch, "ros2_timestamp"), strict=True)):
        message = component(batch, row, name)
        stamp = message["stamp"]
        if stamp["sec"] * 10**9 + stamp["nanosec"] != stamp_ns:
            fail(f"{chunk.entity_path} at {time_ns} ns: Rerun's timeline has {stamp_ns} ns, the stamp is {stamp}")
        expected.compare(chunk.entity_path, time_ns, dict(leaves(message)))


def compare_drawn(expected, chunk, batch, schema):
    """Compares messages that Rerun turned into a 3-D archetype, whose numbers are float32."""
    archetype, stamp, components = DRAWN[schema]
    archetypes = {(field.metadata or {}).get(b"rerun:archetype", b"").decode() for field in batch.schema}
    if archetype not in archetypes:
        fail(f"{chunk.entity_path}: {schema} has become {archetypes - {''}}, not {archetype}")
    stamp = (f"{stamp}.sec", f"{stamp}.nanosec")
    # Rerun shows the stamp as a timeline; that of a transform in a list it does not show.
    has_stamp = "ros2_timestamp" in chunk.timeline_names
    stamps_ns = times_ns(batch, "ros2_timestamp") if has_stamp else None
    single = [path for paths in components.values() if len(paths) > 1 for path in paths]
    for row, time_ns in enumerate(times_ns(batch, "message_log_time")):
        found = dict(zip(stamp, divmod(stamps_ns[row], 10**9), strict=True)) if has_stamp else {}
        for name, paths in components.items():
            value = component(batch, row, name)
            found.update(zip(paths, [value] if isinstance(value, str) else value, strict=True))
        expected.compare(chunk.entity_path, time_ns, found, () if has_stamp else stamp, single)


def compare(expected, rrd):
    """Compares every chunk of messages; returns which topics became which archetype."""
    schemas, drawn = {}, {}
    for chunk in rerun.chunk.RrdReader(rrd).stream():
        batch = chunk.to_record_batch()
        topic = chunk.entity_path
        if "McapSchema:name" in batch.schema.names:
            schemas[topic] = component(batch, 0, "McapSchema:name")
        elif not chunk.is_static and schemas[topic] in DRAWN:
            compare_drawn(expected, chunk, batch, schemas[topic])
            drawn[topic] = DRAWN[schemas[topic]][0].rsplit(".", 1)[-1]
        elif not chunk.is_static:
            compare_reflected(expected, chunk, batch, schemas[topic])
    return drawn


def main(recording, lines):
    expected = Expected(lines)
    with tempfile.TemporaryDirectory() as folder:
        rrd = str(pathlib.Path(folder) / "recording.rrd")
        convert(recording, rrd)
        drawn = compare(expected, rrd)
    if not drawn:
        fail("no topic has become a 3-D archetype")
    shown = ", ".join(f"{topic} as {archetype}" for topic, archetype in sorted(drawn.items()))
    expected.finish("rerun", f"; drawn in 3-D, in float32: {shown}")


main(*sys.argv[1:])
