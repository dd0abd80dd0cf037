"""Compares a recording as rosbags decodes it. Usage: read_rosbags.py RECORDING LINES_OF_CAT"""

import pathlib
import sys

from expected import Expected, fail, leaves
from rosbags.highlevel import AnyReader


def main(recording, lines):
    expected = Expected(lines)
    # Without a default typestore the reader knows only the types that the recording itself defines.
    with AnyReader([pathlib.Path(recording)]) as reader:
        for connection, time_ns, cdr in reader.messages():
            message = reader.deserialize(cdr, connection.msgtype)
            expected.compare(connection.topic, time_ns, dict(leaves(message)))
            # The reader's own serialisation has the same bytes: none is padding of ours, none is left over.
            if bytes(reader.typestore.serialize_cdr(message, connection.msgtype)) != bytes(cdr):
                fail(f"{connection.topic} at {time_ns} ns: rosbags serialises the message to other bytes")
    expected.finish("rosbags", ", serialised to the same bytes")


main(*sys.argv[1:])
