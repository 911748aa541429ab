"""Divides the UAVs of a scenario among machines.

The nodes of a UAV, and those of other UAVs with which they share topics or services, stay on one
machine: their messages then take no detour and arrive in their order. What nodes of the whole
system share stays with the leader.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from volery.core.errors import DivisionError
from volery.core.plurals import counted
from volery.graph.nodes.handles import NodeEndpoints
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario

_COMMON = frozenset({"/rosout", "/clock", "/parameter_events"})
"""Topics that join no nodes."""


def check_divisible(scenario: Scenario) -> None:
    """Raises `DivisionError` for a scenario that only one machine can simulate."""
    if scenario.radio is not None:
        raise DivisionError(
            f"{scenario.name} has a radio network, whose collisions depend on the order of all "
            "messages: it cannot be divided; fly it without --workers"
        )


def divided(scenario: Scenario, machines: int) -> list[frozenset[str]]:
    """Returns the UAVs of each machine, the leader's first; contiguous in fleet order if possible.

    Builds the scenario to see which nodes belong together. Raises `DivisionError` if there are
    fewer groups than machines.
    """
    check_divisible(scenario)
    with Simulation(scenario, threads=1) as simulation:
        uavs = list(simulation.uavs)
        groups, central = _groups(uavs, simulation.diagnostics.nodes)
    parts = [set(central)] + [set() for _ in range(machines - 1)]
    left, machine = len(uavs) - len(central), 0
    for group in groups:
        fair = -(-(left + len(parts[machine])) // (machines - machine))
        if parts[machine] and len(parts[machine]) + len(group) > fair and machine < machines - 1:
            machine += 1
        parts[machine].update(group)
        left -= len(group)
    if not all(parts[1:]):
        raise DivisionError(
            f"{scenario.name} has {_counted(len(groups), central)} to be divided, too few for "
            f"{counted(machines - 1, 'worker')} besides the leader"
        )
    return [frozenset(part) for part in parts]


def _counted(groups: int, central: Sequence[str]) -> str:
    if central:
        return f"{counted(groups, 'group')} of UAVs"
    return f"{counted(groups, 'UAV')} (or groups of them)"


def _groups(
    uavs: Sequence[str], nodes: Mapping[str, NodeEndpoints]
) -> tuple[list[list[str]], list[str]]:
    """Returns the groups of UAVs, in fleet order, and the UAVs that belong to the leader."""
    parent = {name: name for name in ["", *uavs]}  # "": the whole system

    def root(name: str) -> str:
        while parent[name] != name:
            name = parent[name]
        return name

    for first, second in _pairs(nodes):
        a, b = root(first), root(second)
        if a != b:
            parent[max(a, b)] = min(a, b)  # the system's root stays the system
    groups: dict[str, list[str]] = {}
    for name in uavs:
        groups.setdefault(root(name), []).append(name)
    central = groups.pop("", [])
    return list(groups.values()), central


def _pairs(nodes: Mapping[str, NodeEndpoints]) -> Iterator[tuple[str, str]]:
    """Yields the owners of nodes that share a topic or a service."""
    used = [(_owner(name), ends) for name, ends in nodes.items()]
    sources: dict[str, set[str]] = {}
    for owner, ends in used:
        for name in (*(ends.publishes - _COMMON), *(f"{name}()" for name in ends.serves)):
            sources.setdefault(name, set()).add(owner)
    for owner, ends in used:
        for name in (*ends.subscribes, *(f"{name}()" for name in ends.calls)):
            for source in sorted(sources.get(name, ())):
                yield owner, source


def _owner(node: str) -> str:
    """Returns the UAV of a node by its full name; empty for nodes of the whole system."""
    first, *rest = node.strip("/").split("/")
    return first if rest else ""
