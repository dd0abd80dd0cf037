"""Content of a recording by hummingbus's own reader, against which every other reader is compared."""

import json
import math
import re
import struct
import sys

# Leaves that fill gaps of a layout.
PADDING = re.compile(r"(^|\.)pad\d+(\[\d+\])?$")


class Expected:
    """The lines of `hummingbus cat`, by topic and time."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as lines:
            messages = [json.loads(line) for line in lines]
        self.messages = {(m["topic"], m["time_ns"]): m for m in messages}
        if len(self.messages) != len(messages):
            fail(f"{path}: two messages of one topic have the same time")
        self.unseen = set(self.messages)
        self.values = 0

    def take(self, topic, time_ns):
        """The message of `topic` at `time_ns`; each may be taken once."""
        key = (topic, time_ns)
        if key not in self.unseen:
            again = "a second time" if key in self.messages else "but hummingbus does not"
            fail(f"{topic} at {time_ns} ns: the reader finds this message {again}")
        self.unseen.remove(key)
        return self.messages[key]

    def compare(self, topic, time_ns, found, hidden=(), single=()):
        """Compares a message's leaves, in the order of the definition.

        `hidden` names the leaves that the reader does not show, `single` those that it stores as float32. Leaves that fill
        gaps of the layout are left out: `hummingbus cat` does not print them.
        """
        found = {path: value for path, value in found.items() if not PADDING.search(path)}
        fields = self.take(topic, time_ns)["fields"]
        wanted = [path for path in fields if path not in hidden]
        if wanted != list(found):
            fail(f"{topic} at {time_ns} ns: the reader has the fields {list(found)}, hummingbus has {wanted}")
        for path in wanted:
            ours = as_single(fields[path]) if path in single else fields[path]
            if not same(ours, found[path]):
                fail(f"{topic} at {time_ns} ns: {path} is {found[path]!r}, hummingbus reads {ours!r}")
        self.values += len(wanted)

    def finish(self, reader, more=""):
        """Fails if a message was left out or nothing was compared; else says what was compared."""
        if self.unseen:
            topic, time_ns = min(self.unseen, key=lambda key: (key[1], key[0]))
            fail(f"{topic} at {time_ns} ns: the reader does not find this message")
        topics = {topic for topic, _ in self.messages}
        if not topics or not self.values:
            fail("nothing was compared: there are no messages")
        print(f"{reader}: {len(topics)} topics, {len(self.messages)} messages, {self.values} values equal{more}")


def fail(reason):
    """Ends the comparison at its first difference."""
    sys.exit(f"{sys.argv[0].rsplit('/', 1)[-1]}: {reason}")


def same(ours, theirs):
    """True if two leaves are equal: floats bit by bit, except that all NaN are one."""
    if isinstance(theirs, str):
        return ours == theirs
    if isinstance(theirs, float):
        # JSON has no NaN and no infinity: they come as strings.
        ours = float(ours)
        return struct.pack("<d", ours) == struct.pack("<d", theirs) or math.isnan(ours) and math.isnan(theirs)
    return isinstance(ours, int) and ours == int(theirs)


def as_single(number):
    """A number rounded to float32."""
    return struct.unpack("<f", struct.pack("<f", float(number)))[0]


def leaves(value, path=""):
    """The leaves of a decoded message as (path, value), with hummingbus's paths."""
    if hasattr(value, "tolist"):
        # An array or a number of numpy.
        value = value.tolist()
    if isinstance(value, (bool, int, float, str)):
        yield path, value
        return
    fields = named_fields(value)
    if fields is None:
        for index, element in enumerate(value):
            yield from leaves(element, f"{path}[{index}]")
        return
    for name, field in fields:
        yield from leaves(field, f"{path}.{name}" if path else name)


def named_fields(value):
    """The fields of a message as the readers represent them; None for an array."""
    if isinstance(value, dict):
        return value.items()
    for names in ("__dataclass_fields__", "__slots__"):
        if hasattr(value, names):
            # Neither `__msgtype__` nor a constant, in capitals, is a field of the message.
            fields = [name for name in getattr(value, names) if not name.startswith("__") and not name.isupper()]
            return [(name, getattr(value, name)) for name in fields]
    return None
