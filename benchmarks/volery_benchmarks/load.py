"""Measures the CPU load of a search's parts, by the number of UAVs.

It flies the scenario `forest_search` as fast as possible on one thread; figures are CPU time in
percent of one core at real time. Nodes are measured by their callbacks, wherever they run. The
graph's load is that of the stage that delivers messages, less the nodes that are called in it.
"""

from __future__ import annotations

import time

from volery.runtime import Simulation
from volery_benchmarks.forest_flight import search_scenario

_FLEETS, _SECONDS = (1, 2, 3, 6), 30.0
_QUICK_FLEETS, _QUICK_SECONDS = (1, 3), 10.0
_CLIMB_S = 15.0
"""Excludes the take-off and the first map, for which kernels may still be compiled."""
_ENGINE = ("take_commands", "advance_vehicles", "resolve_contacts", "raise_events", "meet_partners")
_SENSORS, _GRAPH = "sample_sensors", "publish"


def measure(*, quick: bool = False) -> dict[str, float]:
    """Returns the figures of the bench."""
    fleets, seconds = (_QUICK_FLEETS, _QUICK_SECONDS) if quick else (_FLEETS, _SECONDS)
    figures: dict[str, float] = {}
    for uavs in fleets:
        for part, percent in percentages(uavs, seconds).items():
            figures[f"{part}_{uavs}_uav{'s' if uavs > 1 else ''}"] = percent
    return figures


def percentages(uavs: int, seconds: float) -> dict[str, float]:
    """Returns percent of one core at real time by part, and of the whole process."""
    scenario = search_scenario(uavs, 1, _CLIMB_S + seconds + 1.0)
    with Simulation(scenario, threads=1) as simulation:
        simulation.run(_CLIMB_S)
        simulation.diagnostics.count_cpu_time()
        nodes, stages = _busy(simulation), simulation.diagnostics.stage_seconds
        began = time.process_time()
        simulation.run(seconds)
        process_s = time.process_time() - began
        took = {k: v - stages[k] for k, v in simulation.diagnostics.stage_seconds.items()}
        thought = {name: busy - nodes[name] for name, busy in _busy(simulation).items()}
        inline_s = sum(
            busy for name, busy in thought.items() if name not in _with_latency(simulation)
        )
    found = {
        "engine_percent": sum(took[stage] for stage in _ENGINE),
        "sensors_percent": took[_SENSORS],
        "graph_percent": max(took[_GRAPH] - inline_s, 0.0),
        **{f"{name}_percent": busy for name, busy in sorted(thought.items())},
        "process_percent": process_s,
    }
    return {part: 100.0 * busy_s / seconds for part, busy_s in found.items()}


def _busy(simulation: Simulation) -> dict[str, float]:
    """Returns the nodes' CPU seconds so far, by name; waits for workers."""
    busy: dict[str, float] = {}
    for node in simulation.vehicles.nodes:
        node.join()
        busy[node.get_name()] = busy.get(node.get_name(), 0.0) + node.busy_s
    return busy


def _with_latency(simulation: Simulation) -> set[str]:
    """Returns the names of nodes with threads of their own."""
    return {node.get_name() for node in simulation.vehicles.nodes if node.has_worker}
