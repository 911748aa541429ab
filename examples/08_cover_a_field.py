"""Covers a small field around a pond with three UAVs, which then return."""

import json
import tempfile
from pathlib import Path

from volery import Simulation
from volery.scenario.load import parse_scenario

FIELD = """\
0,0,0,0,0,0,0,0
0,0,0,1,1,0,0,0
0,0,0,1,1,1,0,0
0,0,0,0,0,0,0,0
0,0,0,0,0,0,0,0
"""


def scenario_of(folder):
    field = folder / "field.csv"
    field.write_text(FIELD)
    planner = {
        "node": "coverage",
        "parameters": {"uavs": ["uav1", "uav2", "uav3"], "height_m": 2.5},
    }
    data = {
        "name": "field",
        "ends_when": "all_landed",
        "duration_s": 300.0,
        "world": {"grid_map": {"maps": [{"file": str(field)}], "cell_size_m": 4.0}},
        "types": {"f450": {"sensors": [{"kind": "odometry", "noise": False}]}},
        "uavs": [{"type": "f450", "count": 3, "position_m": [2, 2], "last_position_m": [26, 2]}],
        "nodes": [planner],
    }
    return parse_scenario(data)


told = {}
with tempfile.TemporaryDirectory() as name, Simulation(scenario_of(Path(name))) as simulation:
    simulation.graph.subscribe(
        "/coverage/status", lambda published: told.update(json.loads(published.message.data))
    )
    while not simulation.clock.finished:
        simulation.run(20.0)
        print(f"{simulation.time_s:5.1f} s  {told['covered']:4.0%} covered")
    print("cells of each UAV:", told["cells"])
