"""Checks a recording's MCAP container with the mcap package.

Usage: read_container.py RECORDING LINES_OF_CAT ATTACHED_FILE...
"""

import pathlib
import re
import struct
import sys

from expected import Expected, fail
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, DataEnd, Header, Message, MessageIndex
from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream

# The first fields of a message record, after its opcode and length: channel, sequence, log time.
MESSAGE_START = struct.Struct("<BQHIQ")
MESSAGE_OPCODE = 5
RULE = "=" * 80


def check(condition, reason):
    if not condition:
        fail(reason)


def check_definition(schema):
    """Checks what ROS 2 tools need of a type's name and definition."""
    name = schema.name
    check(re.fullmatch(r"[a-z0-9_]+/msg/[A-Za-z0-9]+", name), f"schema name {name} has not three parts")
    check(schema.encoding == "ros2msg", f"schema {name}: encoding {schema.encoding}")
    text = schema.data.decode()
    check(text.endswith("\n"), f"schema {name} does not end with a newline")
    _, *dependencies = text.split(f"{RULE}\n")
    names = [section.split("\n", 1)[0] for section in dependencies]
    check(len(set(names)) == len(names), f"schema {name} defines a type twice: {names}")
    for name_line in names:
        check(re.fullmatch(r"MSG: [a-z0-9_]+/[A-Za-z0-9]+", name_line), f"schema {name}: {name_line!r}")
    check(text.count(RULE) == len(names), f"schema {name} has a rule that is not a line of its own")


def check_channels(summary):
    for channel in summary.channels.values():
        topic = channel.topic
        check(channel.message_encoding == "cdr", f"{topic}: encoding {channel.message_encoding}")
        check("offered_qos_profiles" in channel.metadata, f"{topic}: no offered_qos_profiles in its metadata")
        check_definition(summary.schemas[channel.schema_id])


def check_statistics(summary, expected):
    """Checks the statistics against the messages that hummingbus reads."""
    statistics = summary.statistics
    check(statistics is not None, "the summary has no statistics")
    counts = {channel.topic: statistics.channel_message_counts.get(id, 0) for id, channel in summary.channels.items()}
    times = [time_ns for _, time_ns in expected.messages]
    topics = [topic for topic, _ in expected.messages]
    facts = {
        "message_count": len(expected.messages),
        "message_start_time": min(times),
        "message_end_time": max(times),
        "channel_count": len(summary.channels),
        "schema_count": len(summary.schemas),
        "chunk_count": len(summary.chunk_indexes),
        "attachment_count": len(summary.attachment_indexes),
    }
    for name, fact in facts.items():
        check(getattr(statistics, name) == fact, f"statistics: {name} is {getattr(statistics, name)}, not {fact}")
    for topic, count in counts.items():
        check(count == topics.count(topic) > 0, f"{topic}: {count} messages counted, {topics.count(topic)} read")


def check_message(topic, message, expected):
    where = f"{topic} at {message.log_time} ns"
    check(message.publish_time == message.log_time, f"{where}: publish time {message.publish_time} ns")
    tick = expected.take(topic, message.log_time)["tick"]
    check(message.sequence == tick, f"{where}: sequence {message.sequence}, tick {tick}")
    check(message.data[:4] == b"\0\1\0\0", f"{where}: its encapsulation header is {message.data[:4]}")
    expected.values += 1


def check_index(index, body, topic):
    """Checks that every entry of a message index leads to a message of its channel and time."""
    for log_time, offset in index.records:
        opcode, _, channel_id, _, time_ns = MESSAGE_START.unpack_from(body, offset)
        found = (opcode, channel_id, time_ns)
        wanted = (MESSAGE_OPCODE, index.channel_id, log_time)
        check(found == wanted, f"{topic} at {log_time} ns: its index leads to {found}, not {wanted}")
    return len(index.records)


def check_chunk(chunk, summary, expected):
    """Checks a chunk's messages; returns its content, uncompressed."""
    check(chunk.compression == "zstd", f"a chunk is compressed with {chunk.compression!r}")
    check(chunk.uncompressed_crc != 0, "a chunk has no checksum")
    messages = [record for record in breakup_chunk(chunk, validate_crc=True) if isinstance(record, Message)]
    check(messages, "a chunk has no messages")
    for message in messages:
        check_message(summary.channels[message.channel_id].topic, message, expected)
    times = [message.log_time for message in messages]
    check((min(times), max(times)) == (chunk.message_start_time, chunk.message_end_time), "a chunk's times are wrong")
    stream, length = get_chunk_data_stream(chunk)
    return stream.read(length)


def check_data(file, summary, expected):
    """Walks through the whole file; returns its attachments and the number of index entries."""
    attachments, entries, chunks, body = {}, 0, 0, b""
    for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
        if isinstance(record, Header):
            check(record.profile == "ros2", f"the header's profile is {record.profile!r}")
        elif isinstance(record, Attachment):
            attachments[record.name] = record.data
        elif isinstance(record, Chunk):
            body = check_chunk(record, summary, expected)
            chunks += 1
        elif isinstance(record, MessageIndex):
            entries += check_index(record, body, summary.channels[record.channel_id].topic)
        elif isinstance(record, DataEnd):
            check(record.data_section_crc != 0, "the data section has no checksum")
    check(chunks == len(summary.chunk_indexes), f"{chunks} chunks, {len(summary.chunk_indexes)} in the chunk index")
    check(entries == len(expected.messages), f"{entries} index entries, {len(expected.messages)} messages")
    return attachments, entries


def check_attachments(attachments, paths):
    files = {pathlib.Path(path).name: pathlib.Path(path).read_bytes() for path in paths}
    check(sorted(attachments) == sorted(files), f"the attachments are {sorted(attachments)}, not {sorted(files)}")
    for name, content in files.items():
        check(attachments[name] == content, f"the attachment {name} differs from the file")


def check_seeking(file, summary, expected):
    """Reads each topic through the indexes alone: as many messages, in the order of time."""
    for channel in summary.channels.values():
        file.seek(0)
        messages = make_reader(file).iter_messages(topics=[channel.topic])
        times = [message.log_time for _, _, message in messages]
        wanted = sorted(time_ns for topic, time_ns in expected.messages if topic == channel.topic)
        check(times == wanted, f"{channel.topic}: the indexes lead to {len(times)} messages of {len(wanted)}")


def main(recording, lines, *attached):
    expected = Expected(lines)
    with open(recording, "rb") as file:
        summary = make_reader(file).get_summary()
        check(summary is not None and summary.chunk_indexes, "the file has no summary with a chunk index")
        for index in summary.chunk_indexes:
            check(index.message_index_offsets, "a chunk has no message index")
        check(expected.messages, "nothing was compared: there are no messages")
        check_channels(summary)
        check_statistics(summary, expected)
        file.seek(0)
        attachments, entries = check_data(file, summary, expected)
        check_attachments(attachments, attached)
        check_seeking(file, summary, expected)
    chunks = len(summary.chunk_indexes)
    more = f": {chunks} zstd chunks, {entries} index entries, {len(attachments)} attachments"
    expected.finish("mcap container (times and ticks)", more)


main(*sys.argv[1:])
