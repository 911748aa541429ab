"""Flies a UAV in a stepped simulation: take-off, a flight to a position, landing."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    uav = simulation.uavs["uav1"]
    uav.wait()  # the scenario starts with a take-off
    reached = uav.go_to([5.0, 3.0, 3.0], yaw=1.57).wait()  # metres in the map, radians
    print(f"{reached.time_s:.1f} s  position", uav.position_map.round(2), "mode", uav.mode.name)
    landed = uav.land().wait()
    print(f"{landed.time_s:.1f} s  mode", uav.mode.name)
