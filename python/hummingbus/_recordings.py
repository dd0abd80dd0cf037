"""Recordings as columns of numpy, pandas and polars."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from typing import Any

import numpy as np

from . import _native


class Recording:
    """A recording of a run.

        recording = hummingbus.Recording("hover.mcap")
        recording.topics["/plant/state"]             # ('hummingbus_msgs/msg/PlantState', 12000)
        state = recording.pandas("/plant/state")     # a column for each number, over time in seconds
    """

    def __init__(self, path: str | PathLike[str]):
        self._native = _native.Recording(path)

    @property
    def topics(self) -> dict[str, tuple[str, int]]:
        """Types of the topics, and the numbers of their messages."""
        return {name: (type_name, count) for name, type_name, count in self._native.topics()}

    def numpy(self, topic: str, fields: Iterable[str] = ()) -> dict[str, np.ndarray]:
        """Columns of `topic`: `time_s`, and an array of doubles for each of `fields`, such as `position.z` or `command[2]`,
        or `attitude.yaw` of a quaternion; all numbers of its messages without `fields`.
        """
        columns, _ = self._native.columns(topic, list(fields))
        time_s = np.frombuffer(columns.pop("time_ns"), "<u8") * 1e-9
        return {"time_s": time_s} | {name: np.frombuffer(column, "<f8") for name, column in columns.items()}

    def units(self, topic: str, fields: Iterable[str] = ()) -> dict[str, str]:
        """Units of the columns of `topic`."""
        return dict(self._native.columns(topic, list(fields))[1])

    def pandas(self, topic: str, fields: Iterable[str] = ()) -> Any:
        """The same columns as a `pandas.DataFrame`, whose index is the time in seconds."""
        import pandas

        return pandas.DataFrame(self.numpy(topic, fields)).set_index("time_s")

    def polars(self, topic: str, fields: Iterable[str] = ()) -> Any:
        """The same columns as a `polars.DataFrame`."""
        import polars

        return polars.DataFrame(self.numpy(topic, fields))
