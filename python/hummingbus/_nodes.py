"""Nodes: programs in Python that take part in runs."""

from __future__ import annotations

import gc
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from . import _native
from ._messages import Message, of


@dataclass(frozen=True)
class Optional:
    """A port that the manifest may leave out; the step gets `None` for it then."""

    message: str | Message


class Parameters(dict):
    """The parameters that the manifest gives a node, or a table of them. One that the program does not read is refused; to look at
    all of them (`items()`, `dict(parameters)`) reads all. Of a table, too, all keys have to be read as soon as one is."""

    def __init__(self, values: Mapping[str, Any], path: str = ""):
        tables = {key: Parameters(value, f"{path}{key}.") if isinstance(value, dict) else value for key, value in values.items()}
        super().__init__(tables)
        self._path = path
        self._read: set[str] = set()

    def __getitem__(self, key: str) -> Any:
        self._read.add(key)
        if not super().__contains__(key):
            known = ", ".join(f"`{self._path}{name}`" for name in super().keys()) or "none"
            raise _native.Error(f"parameters.{self._path}{key} is missing; the manifest gives {known}")
        return super().__getitem__(key)

    def __iter__(self) -> Any:
        self._read.update(super().keys())
        return super().__iter__()

    def items(self) -> Any:
        self._read.update(super().keys())
        return super().items()

    def values(self) -> Any:
        self._read.update(super().keys())
        return super().values()

    def __contains__(self, key: object) -> bool:
        self._read.add(str(key))
        return super().__contains__(key)

    def get(self, key: str, default: Any = None) -> Any:
        self._read.add(key)
        return super().get(key, default)

    def _require_all_read(self) -> None:
        if unread := self._unread():
            read = ", ".join(f"`{name}`" for name in self._names()) or "none"
            raise _native.Error(f"parameters.{unread} is not read; the program reads {read}")

    def _unread(self) -> str | None:
        """The first key that the program has not read, with its tables."""
        for key in super().keys():
            if key not in self._read:
                return f"{self._path}{key}"
            table = super().__getitem__(key)
            # A table of which nothing was read is kept whole, perhaps for the steps.
            if isinstance(table, Parameters) and table._read and (unread := table._unread()):
                return unread
        return None

    def _names(self) -> list[str]:
        """The keys that the program has read, with their tables."""
        names = []
        for key in sorted(self._read):
            table = super().get(key)
            within = table._names() if isinstance(table, Parameters) else []
            names += within or [f"{self._path}{key}"]
        return names


@dataclass(frozen=True)
class Node:
    """Facts of a node that its component may know.

    `period_s` is the simulated time between two steps, `seed` that of the run.
    """

    name: str
    period_s: float
    seed: int
    parameters: Parameters
    _native: _native.Node

    def file(self, key: str) -> str:
        """Contents of the file that the parameter `key` names, as it was when the run began."""
        return self._native.file(str(self.parameters[key]))


class Component:
    """A node with ports, and what it computes.

    `inputs` and `outputs` are messages by the names of their ports; `state` is the message that holds all that changes from
    tick to tick: whoever takes the node's place goes on from it, and checkpoints hold it. `step` gets the number of the run's
    tick, each message under the name of its port, and the state as `state`: numpy arrays of no dimension in shared memory,
    valid until it returns. An output is zeros, and `None` where none is due.

        class Climb(hummingbus.Component):
            inputs = {"state": "PlantState"}
            outputs = {"set_point": "SetPoint"}

            def __init__(self, node):
                self.more_m = node.parameters["more_m"]

            def step(self, tick, state, set_point):
                set_point["altitude"] = state["position"]["z"] + self.more_m

        hummingbus.run_node(Climb)
    """

    inputs: Mapping[str, str | Message | Optional] = {}
    outputs: Mapping[str, str | Message | Optional] = {}
    state: str | Message | None = None

    def __init__(self, node: Node):
        """Reads the parameters of `node`."""

    def step(self, tick: int, **messages: Any) -> None:
        """Computes one tick."""
        raise NotImplementedError

    def take_over(self, sent: Mapping[str, Any]) -> None:
        """Called before the step at which this node takes another's place without its state: `sent` has copies of what that
        process sent last, by output, to go on from without a jump."""


def run_node(
    component: type[Component] | Callable[..., None],
    *,
    inputs: Mapping[str, str | Message | Optional] | None = None,
    outputs: Mapping[str, str | Message | Optional] | None = None,
    state: str | Message | None = None,
) -> None:
    """Runs a component, or a function with these ports, as the node that the launcher started this process for: all of a
    program that a manifest names as a `command`. Errors are printed, and the process exits with code 1 then. A function reads no
    parameters.
    """
    try:
        _run(component, inputs, outputs, state)
    except _native.Error as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)


def _require_own_names(inputs: Any, outputs: Any, state: Any) -> None:
    """Refuses ports whose messages `step` would get under one name."""
    names = ["tick", *inputs, *outputs] + ([] if state is None else ["state"])
    for name in names:
        if names.count(name) > 1:
            raise _native.Error(
                f"`step` would get two values under the name `{name}`: `tick`, each input, each output and `state` need names of "
                "their own; rename the port in the program and in the manifest"
            )


def _run(component: Any, inputs: Any, outputs: Any, state: Any) -> None:
    node = _native.Node()
    parameters = Parameters(json.loads(node.parameters()))
    is_class = isinstance(component, type)
    declared = (component.inputs, component.outputs, component.state) if is_class else (inputs or {}, outputs or {}, state)
    _require_own_names(*declared)
    absent: dict[str, Any] = {}
    for ports, wired, declare in zip(declared, node.wired(), (node.input, node.output)):
        names = [name for name, _ in wired]
        for port, of_port in ports.items():
            if isinstance(of_port, Optional):
                if port not in names:
                    absent[port] = None
                    continue
                of_port = of_port.message
            message = of(of_port)
            declare(port, message._description, message.dtype)
    if declared[2] is not None:
        message = of(declared[2])
        node.declare_state(message._description, message.dtype)
    of_node = Node(node.name, node.period_s, node.seed, parameters, node)
    made = component(of_node) if is_class else None
    step = component if made is None else made.step
    # Only of a component that has its own: it costs a look at each tick.
    follows = made is not None and getattr(component, "take_over", None) is not Component.take_over
    parameters._require_all_read()
    # Objects that are there now stay: the collector need not look at them again at every tick.
    gc.collect()
    gc.freeze()
    called = step if not absent else lambda tick, **messages: step(tick, **messages, **absent)
    node.run(called, getattr(made, "take_over", None) if follows else None)
