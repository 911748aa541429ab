"""Restores a snapshot to repeat a flight, the second time with a motor fault."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    uav = simulation.uavs["uav1"]
    simulation.run(5.0)
    snapshot = simulation.snapshot()

    simulation.run(4.0)
    print(f"whole:  {uav.position_map[2]:.2f} m high, {uav.mode.name}")

    simulation.restore(snapshot)
    simulation.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 5.5})
    simulation.run(4.0)
    print(f"broken: {uav.position_map[2]:.2f} m high, {uav.mode.name}")
