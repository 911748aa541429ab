"""The parts of a simulation that a connection to the other machines of its run needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from volery.engine.engine import Engine, SensorBank
from volery.graph.graph import Graph
from volery.graph.nodes.node import Node
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.replay.command_repeater import CommandRepeater


class DivisionParts(NamedTuple):
    """Parts of one machine's simulation."""

    engine: Engine
    graph: Graph
    commands: CommandLog
    repeater: CommandRepeater
    """Repeats the commands that a leader's clients give."""
    causes_actions: Callable[[SensorBank], bool]
    """Returns whether nodes of this machine may act on messages of a bank's sensors, or other
    machines receive them."""
    nodes: Callable[[], Sequence[Node]]
    """Returns the nodes of this machine."""
