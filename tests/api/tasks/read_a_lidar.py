"""Reads a LIDAR: ranges, and points in the UAV's frame."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("longleaf")) as simulation:
    scan = simulation.uavs["uav1"].sensors["horizontal"].next()
    print(scan.ranges.min(), "m", scan.points_base().shape)
