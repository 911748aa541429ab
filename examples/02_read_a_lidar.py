"""Reads the LIDARs of flying UAVs and prints the nearest range of each once a second."""

import numpy as np

from volery import Simulation, load_scenario

with Simulation(load_scenario("longleaf")) as simulation:
    for _ in range(5):
        simulation.run(1.0)
        nearest = []
        for name, uav in simulation.uavs.items():
            ranges = uav.sensors["horizontal"].latest.ranges  # m, inf without an echo
            nearest.append(f"{name} {ranges[np.isfinite(ranges)].min():5.2f} m")
        print(f"{simulation.time_s:4.1f} s  {'  '.join(nearest)}")
