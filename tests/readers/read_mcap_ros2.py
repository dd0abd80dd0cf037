"""Compares a recording as mcap-ros2-support decodes it. Usage: read_mcap_ros2.py RECORDING LINES_OF_CAT"""

import sys

from expected import Expected, leaves
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def main(recording, lines):
    expected = Expected(lines)
    with open(recording, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            expected.compare(channel.topic, message.log_time, dict(leaves(decoded)))
    expected.finish("mcap-ros2-support")


main(*sys.argv[1:])
