"""Flies a UAV in a stepped simulation: take-off, a flight to a position, landing."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    uav = simulation.uavs["uav1"]
    simulation.run(5.0)  # seconds of simulated time; the scenario starts with a take-off
    uav.go_to([5.0, 3.0, 3.0], yaw=1.57)  # metres in the map, radians
    simulation.run(8.0)
    print("position", uav.position_map.round(2), "mode", uav.mode.name)
    uav.land()
    simulation.run(10.0)
    print("mode", uav.mode.name)
