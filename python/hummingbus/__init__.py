"""hummingbus for Python: nodes of a simulation, runs of manifests, and recordings.

A node is a program that a manifest names as a `command`; it takes part in lockstep, as one in Rust does:

    import hummingbus as hb

    def climb(tick, state, set_point):
        set_point["altitude"] = state["position"]["z"] + 0.5

    hb.run_node(climb, inputs={"state": "PlantState"}, outputs={"set_point": "SetPoint"})

A run and its recording:

    outcome = hb.fly("manifests/hover.toml", record="hover.mcap")
    state = hb.Recording("hover.mcap").pandas("/plant/state")
"""

from ._native import Error, __version__
from ._campaigns import Campaign, campaign, identify
from ._messages import Field, Message, Schema, SchemaField, dtype, message, messages, schema, set_values, vector
from ._nodes import Component, Optional, run_node
from ._recordings import Recording
from ._runs import Outcome, Run, fly, start
from ._simulations import Simulation

__all__ = [
    "Campaign",
    "Component",
    "Error",
    "Field",
    "Message",
    "Optional",
    "Outcome",
    "Recording",
    "Run",
    "Schema",
    "SchemaField",
    "Simulation",
    "__version__",
    "campaign",
    "dtype",
    "fly",
    "identify",
    "message",
    "messages",
    "run_node",
    "schema",
    "set_values",
    "start",
    "vector",
]
