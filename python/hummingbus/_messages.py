"""Messages: their types of numpy, and messages of one's own."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _native

_NUMBERS = {
    "float64": "<f8",
    "float32": "<f4",
    "int64": "<i8",
    "uint64": "<u8",
    "int32": "<i4",
    "uint32": "<u4",
    "int16": "<i2",
    "uint16": "<u2",
    "int8": "i1",
    "uint8": "u1",
}


@dataclass(frozen=True)
class Message:
    """A message: its ROS 2 name of three parts, and its type of numpy with the layout of shared memory."""

    type_name: str
    dtype: np.dtype
    _description: str

    def zeros(self) -> np.ndarray:
        """A message of zeros: an array of no dimension, as steps get them."""
        return np.zeros((), self.dtype)


@dataclass(frozen=True)
class Field:
    """A field of a message: a number such as `float64`, a built-in message such as `Vector3`, or a `Message`; `length` makes
    it an array. `unit` is `1` for numbers without one."""

    name: str
    type: str | Message = "float64"
    unit: str = ""
    frame: str = ""
    doc: str = ""
    length: int = 0


@dataclass(frozen=True)
class SchemaField:
    """A field of a schema. `type` is a number such as `float64`, or the name of a message; `[4]` behind it is an array, `[<=16]` a
    sequence. `offset` is in bytes."""

    name: str
    type: str
    unit: str
    frame: str
    doc: str
    offset: int


@dataclass(frozen=True)
class Schema:
    """A built-in message: its name, its size in bytes, the hash of its layout as `hummingbus schema` prints it, its fields."""

    type_name: str
    doc: str
    size: int
    layout_hash: str
    fields: tuple[SchemaField, ...]


def messages() -> list[str]:
    """Names of the built-in messages, and of states of components that are messages.

    >>> "hummingbus_msgs/msg/PlantState" in messages()
    True
    """
    return _native.messages()


@functools.lru_cache(maxsize=None)
def _built_in(name: str) -> Message:
    description = json.loads(_native.message(name))
    return Message(description["type_name"], _fields(description), json.dumps(description["type_name"]))


def message(name: str, fields: Iterable[Field] = (), doc: str = "") -> Message:
    """The built-in message `name`, with or without its package; with `fields`, a message of one's own.

    >>> message("SetPoint").dtype.names
    ('stamp', 'altitude', 'roll', 'pitch', 'yaw')
    >>> battery = message("my_msgs/msg/Battery", [Field("stamp", "Time"), Field("voltage", unit="V")])
    >>> battery.dtype.itemsize
    16
    """
    fields = list(fields)
    if not fields:
        return _built_in(name)
    described, offset = [], 0
    for field in fields:
        kind, size = _kind(field.type)
        if field.length:
            kind, size = {"array": kind, "length": field.length}, size * field.length
        described.append(
            {"name": field.name, "doc": field.doc, "unit": field.unit, "frame": field.frame, "offset": offset, "kind": kind}
        )
        offset += size
    description = {"type_name": name, "doc": doc, "size": offset, "fields": described}
    return Message(name, _fields(description), json.dumps(description))


def schema(name: str) -> Schema:
    """Fields, units, frames and layout hash of the built-in message `name`, with or without its package.

    >>> altitude = schema("SetPoint").fields[1]
    >>> altitude.name, altitude.type, altitude.unit, altitude.frame, altitude.offset
    ('altitude', 'float64', 'm', 'world', 8)
    """
    described = json.loads(_native.message(name))
    fields = (
        SchemaField(
            field["name"], _type(field["kind"]), field["unit"], field["frame"], field["doc"], field["offset"]
        )
        for field in described["fields"]
    )
    return Schema(
        described["type_name"], described["doc"], described["size"], described["layout_hash"], tuple(fields)
    )


def dtype(name: str | Message) -> np.dtype:
    """The type of numpy of a message.

    >>> dtype("PlantState")["position"].names
    ('x', 'y', 'z')
    """
    return of(name).dtype


def of(declared: str | Message) -> Message:
    """The message that is declared by its name or as itself."""
    return declared if isinstance(declared, Message) else message(declared)


def vector(field: np.ndarray) -> np.ndarray:
    """The numbers of a field with parts, such as a `Vector3` or a `Quaternion` (x, y, z, w): an array on the same memory.

    >>> state = message("PlantState").zeros()
    >>> vector(state["position"])[2] = 1.5
    >>> float(state["position"]["z"])
    1.5
    """
    if field.shape:
        raise TypeError(f"it is an array of shape {field.shape} itself")
    shape, kind, _ = _parts.get(id(field.dtype)) or _parts_of(field.dtype)
    return np.ndarray(shape, kind, field)


# Shapes and types of vectors by the identity of their types, which are kept: to hash one takes as long as a step.
_parts: dict[int, tuple[tuple[int], np.dtype, np.dtype]] = {}


def _parts_of(dtype: np.dtype) -> tuple[tuple[int], np.dtype, np.dtype]:
    kinds = [dtype[part] for part in range(len(dtype.names or ()))]
    if kinds[0].names or any(kind != kinds[0] for kind in kinds):
        raise TypeError(f"its parts are of several types: {dtype}")
    return _parts.setdefault(id(dtype), ((len(kinds),), kinds[0], dtype))


def set_values(field: np.ndarray, values: Any) -> None:
    """Sets a sequence, a field with a count and room for values, such as `command["command"]` of a MotorCommand.

    >>> command = message("MotorCommand").zeros()
    >>> set_values(command["command"], [76.5] * 4)
    >>> set_values(command["command"], [80.0] * 3)
    >>> int(command["command"]["count"]), command["command"]["values"][:5].tolist()
    (3, [80.0, 80.0, 80.0, 0.0, 0.0])
    """
    count, room = len(values), field["values"]
    if count > len(room):
        raise ValueError(f"{count} values, and there is room for {len(room)}")
    room[:count] = values
    # Values beyond the count are zeros, also where the count has been set by hand.
    room[count:].fill(0)
    field["count"] = count


def _kind(declared: str | Message) -> tuple[Any, int]:
    """A type as it is declared, and its bytes."""
    if declared in _NUMBERS:
        return declared, np.dtype(_NUMBERS[declared]).itemsize
    if isinstance(declared, Message):
        description = json.loads(declared._description)
        if not isinstance(description, str):
            return description, declared.dtype.itemsize
    name = declared.type_name if isinstance(declared, Message) else declared
    description = json.loads(_native.message(name))
    return description, description["size"]


def _fields(description: dict) -> np.dtype:
    fields = description["fields"]
    return np.dtype(
        {
            "names": [field["name"] for field in fields],
            "formats": [_format(field["kind"]) for field in fields],
            "offsets": [field["offset"] for field in fields],
            "itemsize": description["size"],
        }
    )


def _type(kind: Any) -> str:
    """The name of a type."""
    if isinstance(kind, str):
        return kind
    if "array" in kind:
        return f"{_type(kind['array'])}[{kind['length']}]"
    if "sequence" in kind:
        return f"{_type(kind['sequence'])}[<={kind['most']}]"
    return kind["type_name"]


def _format(kind: Any) -> Any:
    if isinstance(kind, str):
        return _NUMBERS[kind]
    if "array" in kind:
        return (_format(kind["array"]), (kind["length"],))
    if "sequence" in kind:
        return np.dtype([("count", "<u4"), ("pad", "<u4"), ("values", _format(kind["sequence"]), (kind["most"],))])
    return _fields(kind)
