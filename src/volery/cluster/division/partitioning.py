"""Divides the UAVs of a scenario among machines, by the cost of their LIDARs, cameras and nodes.

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
_NODE_S, _UAV_S = 0.01, 0.0005
"""CPU time that a node, and the rest of a UAV, are taken to need, s per simulated second."""
_TIE_S = 1e-9
"""Of two divisions that are equally good, the first machine takes more."""


def check_divisible(scenario: Scenario) -> None:
    """Raises `DivisionError` for a scenario that only one machine can simulate."""
    if scenario.radio is not None:
        raise DivisionError(
            f"{scenario.name} has a radio network, whose collisions depend on the order of all "
            "messages: it cannot be divided; fly it without --workers"
        )


def divided(scenario: Scenario, machines: int) -> list[frozenset[str]]:
    """Returns the UAVs of each machine, the leader's first; contiguous in fleet order if possible.

    Builds the scenario to see which nodes belong together and what its sensors cost. Raises
    `DivisionError` if there are fewer groups than machines.
    """
    check_divisible(scenario)
    with Simulation(scenario, threads=1) as simulation:
        nodes = simulation.diagnostics.nodes
        groups, central = _groups(list(simulation.uavs), nodes)
        costs = _costs(simulation, nodes)
    if len(groups) < machines - bool(central):
        raise DivisionError(
            f"{scenario.name} has {_counted(len(groups), central)} to be divided, too few for "
            f"{counted(machines - 1, 'worker')} besides the leader"
        )
    found = [sum(map(costs.__getitem__, group)) for group in (central, *groups)]
    shares = _shares(found[1:], machines, found[0], first_is_used=bool(central))
    parts = [frozenset(uav for k in share for uav in groups[k]) for share in shares]
    return [parts[0] | frozenset(central), *parts[1:]]


def _shares(
    costs: Sequence[float], machines: int, first: float, *, first_is_used: bool
) -> list[list[int]]:
    """Returns consecutive numbers of `costs` for each machine, of nearly the same sum.

    first: what the first machine has besides; with `first_is_used` it may have no number.
    """
    shares: list[list[int]] = [[]]
    used, left = first, first + sum(costs)
    for k, cost in enumerate(costs):
        others = machines - len(shares)
        is_enough = used + cost / 2.0 > left / (others + 1) + _TIE_S
        is_last_chance = len(costs) - k <= others
        if others and (shares[-1] or first_is_used) and (is_enough or is_last_chance):
            shares.append([])
            left, used, first_is_used = left - used, 0.0, False
        shares[-1].append(k)
        used += cost
    return shares


def _costs(simulation: Simulation, nodes: Mapping[str, NodeEndpoints]) -> dict[str, float]:
    """Returns the cost of each UAV, s of CPU time for a simulated second.

    The LIDARs and cameras measure at the start for it; all nodes count alike.
    """
    costs = dict.fromkeys(simulation.uavs, _UAV_S)
    for path, seconds in simulation.diagnostics.measure_sensors().items():
        costs[path.split("/")[0]] += seconds
    for owner in filter(None, map(_owner, nodes)):
        costs[owner] += _NODE_S
    return costs


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
