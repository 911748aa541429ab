"""Crosses a field of dead trees with a depth camera.

`region` as argument selects the simpler method, which may hit a tree.
"""

import sys

from volery import Simulation, load_scenario
from volery.scenario.schema import Scenario

way = sys.argv[1] if len(sys.argv) > 1 else "whole"
nodes = {
    "whole": "depth_avoidance",
    "region": "region_avoidance",
}

if way not in nodes:
    sys.exit(f"no method '{way}': whole or region")

data = load_scenario("obstacle_field").model_dump()
data["types"]["scout"]["nodes"][0]["node"] = nodes[way]

with Simulation(Scenario.model_validate(data)) as simulation:
    uav = simulation.uavs["uav1"]
    while not simulation.clock.finished and not uav.crashed:
        simulation.run(10.0)
        x, y, z = uav.position_map
        print(f"{simulation.time_s:5.1f} s  x {x:5.1f}  y {y:5.1f}  z {z:4.1f}  {uav.mode.name}")
    for event in simulation.diagnostics.events:
        print(event.describe())
