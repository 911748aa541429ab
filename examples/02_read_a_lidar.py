"""Subscribes to LIDARs on the graph and prints the nearest range of each UAV once a second."""

import numpy as np

from volery import Simulation, load_scenario

nearest = {}


def on_scan(published):
    ranges = published.message.ranges
    nearest[published.topic] = float(ranges[np.isfinite(ranges)].min())


with Simulation(load_scenario("longleaf")) as simulation:
    for topic in simulation.vehicles.lidar_mounts:
        simulation.graph.subscribe(topic, on_scan)
    for _ in range(5):
        simulation.run(1.0)
        line = "  ".join(f"{topic} {metres:5.2f} m" for topic, metres in sorted(nearest.items()))
        print(f"{simulation.time_s:4.1f} s  {line}")
