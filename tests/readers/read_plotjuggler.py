"""Compares a recording as rosx_introspection decodes it. Usage: read_plotjuggler.py RECORDING LINES_OF_CAT

It is the parser of PlotJuggler's ROS 2 messages. PlotJuggler has no package; mcap-bag-parser ships the library.
"""

import sys

import msgpack
from expected import Expected, fail
from mcap.reader import make_reader
from rosx_introspection import Parser


def main(recording, lines):
    expected = Expected(lines)
    parsers = {}
    with open(recording, "rb") as file:
        reader = make_reader(file)
        require_summary(reader)
        for schema, channel, message in reader.iter_messages():
            if channel.id not in parsers:
                parsers[channel.id] = Parser("", schema.name, schema.data.decode())
            packed = parsers[channel.id].parse_to_msgpack(message.data)
            found = {as_ours(path): value for path, value in msgpack.unpackb(packed).items()}
            expected.compare(channel.topic, message.log_time, found)
    expected.finish("rosx_introspection")


def require_summary(reader):
    """Requires what PlotJuggler's loader does: a summary, and for each channel a schema of an encoding that it knows."""
    summary = reader.get_summary()
    if summary is None or summary.statistics is None:
        fail("the recording has no summary, and PlotJuggler does not open it")
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
        encodings = (channel.message_encoding, schema and schema.encoding)
        if encodings != ("cdr", "ros2msg"):
            fail(f"{channel.topic}: message and schema are {encodings}, PlotJuggler parses cdr and ros2msg")


def as_ours(path):
    """A path of PlotJuggler, /pose/position/x, as hummingbus writes it."""
    return path.removeprefix("/").replace("/", ".")


main(*sys.argv[1:])
