"""Saves the state of a simulation and restores it exactly."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from volery.core.clock import s_from_ns
from volery.core.errors import SnapshotError
from volery.core.plurals import counted
from volery.core.saved_state import Stateful
from volery.core.uncopied import Uncopied
from volery.engine.lock_step import Partner
from volery.graph.nodes.node import Node
from volery.runtime.construction.placement import StartPose

NodeKey = tuple[str, int]
"""Namespace of a node, and its index among the nodes of that namespace."""
NodeStates = dict[NodeKey, Any]


@dataclass(frozen=True)
class Snapshot(Uncopied):
    """Holds the state of one simulation at `time_ns`; only that simulation can restore it.

    The state contains plants and controllers, sensors and their noise, wind, contacts, faults,
    scheduled tasks, undelivered messages, the digest, events and the state of every node. It
    excludes log files and external programs, which see the clock jump.
    """

    time_ns: int
    owner: int
    starts: tuple[StartPose, ...]
    """UAVs of the simulation at that time."""
    state: dict[str, Any]

    def __repr__(self) -> str:
        return f"<Snapshot at {self.time_s:.3f} s of {counted(len(self.starts), 'UAV')}>"

    @property
    def time_s(self) -> float:
        """Simulated time of the state, s."""
        return s_from_ns(self.time_ns)


def save_nodes(nodes: Sequence[Node]) -> NodeStates:
    """Returns the state of each node (None without `get_state`) and its base state."""
    for node in nodes:
        node.join()
    return {
        key: copy.deepcopy(
            (node.get_state() if isinstance(node, Stateful) else None, node.save_base_state())
        )
        for key, node in _keyed(nodes)
    }


def restore_nodes(nodes: Sequence[Node], states: NodeStates) -> None:
    """Restores the node states that `save_nodes` returned."""
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
    """Returns the nodes without `get_state`/`set_state`; a reset constructs them again."""
    return [node for node in nodes if not isinstance(node, Stateful)]


def check_nodes(nodes: Sequence[Node], what: str) -> None:
    """Raises `SnapshotError` if some node lacks the state that `what` requires."""
    lacking = ", ".join(node.full_name for node in without_state(nodes))
    if lacking:
        raise SnapshotError(
            f"{what} in mid-flight needs the state of every node. These nodes lack get_state() and "
            f"set_state(state): {lacking}. A reset to the start needs neither"
        )


def check_partners(partners: Sequence[Partner], what: str, *, to_start: bool = False) -> None:
    """Raises `SnapshotError` if a lock-step partner prevents `what`, as its state is external.

    With `to_start`, partners that support a reset are allowed.
    """
    for partner in partners:
        if not (partner.has_left or (to_start and partner.supports_reset)):
            raise SnapshotError(
                f"{what} is not possible: the state of lock-step partner '{partner.name}' is "
                "external; it must leave first"
            )
