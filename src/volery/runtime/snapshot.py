"""A kept state of a simulation, to which it can go back exactly."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from volery.core.clock import s_from_ns
from volery.core.errors import SnapshotError
from volery.core.saved_state import Stateful
from volery.engine.lock_step import Partner
from volery.graph.nodes.node import Node
from volery.runtime.build.placement import StartPose

NodeKey = tuple[str, int]
"""Namespace of a node, and which of those there it is."""
NodeStates = dict[NodeKey, Any]


@dataclass(frozen=True)
class Snapshot:
    """State of one simulation at `time_ns`; only that simulation can go back to it.

    It holds plants and controllers, sensors and their noise, wind, contacts, faults, what is due
    when, undelivered messages, the fingerprint, events and the state of every node. Outside it are
    log files, and outside programs, which see the clock jump.
    """

    time_ns: int
    owner: int
    starts: tuple[StartPose, ...]
    """The UAVs that it is of."""
    state: dict[str, Any]

    @property
    def time_s(self) -> float:
        """Simulated time of the state."""
        return s_from_ns(self.time_ns)


def keep_nodes(nodes: Sequence[Node]) -> NodeStates:
    """States of nodes, None of one that does not offer it, and what every node has."""
    for node in nodes:
        node.join()
    return {
        key: copy.deepcopy(
            (node.get_state() if isinstance(node, Stateful) else None, node.save_base_state())
        )
        for key, node in _keyed(nodes)
    }


def put_back_nodes(nodes: Sequence[Node], states: NodeStates) -> None:
    """Give all nodes back what `keep_nodes` kept."""
    for key, node in _keyed(nodes):
        state, base = copy.deepcopy(states[key])
        node.join()
        node.restore_base_state(base)
        if isinstance(node, Stateful):
            node.set_state(state)


def _keyed(nodes: Sequence[Node]) -> Iterator[tuple[NodeKey, Node]]:
    seen: Counter[str] = Counter()
    for node in nodes:
        namespace = node.get_namespace()
        yield (namespace, seen[namespace]), node
        seen[namespace] += 1


def without_state(nodes: Sequence[Node]) -> list[Node]:
    """The nodes that do not offer their state: a start has them made anew."""
    return [node for node in nodes if not isinstance(node, Stateful)]


def check_nodes(nodes: Sequence[Node], what: str) -> None:
    """Refuse `what` where nodes cannot take part in it."""
    lacking = ", ".join(node.full_name for node in without_state(nodes))
    if lacking:
        raise SnapshotError(
            f"{what} in mid-flight needs the state of every node; without get_state() and "
            f"set_state(state): {lacking}. A reset to the start needs none"
        )


def check_partners(partners: Sequence[Partner], what: str, *, to_start: bool = False) -> None:
    """Refuse `what` while an outside program takes part whose state nobody can keep.

    to_start: it goes back to the start, where those can come along that begin anew.
    """
    for partner in partners:
        if not (partner.has_left or (to_start and partner.supports_reset)):
            raise SnapshotError(
                f"{what} is not possible: the state of lock-step partner '{partner.name}' is its "
                "own; it must leave first"
            )
