"""Restores a snapshot to repeat a flight, the second time with a motor fault."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    uav = simulation.uavs["uav1"]
    uav.wait()  # the scenario starts with a take-off
    snapshot = simulation.snapshot()

    simulation.run(4.0)
    print(f"whole:  {uav.position_map[2]:.2f} m high, {uav.mode.name}")

    simulation.restore(snapshot)
    at_s = simulation.time_s + 0.5
    simulation.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": at_s})
    event = simulation.run_until("impact")
    print(f"broken: hits the ground at {event.speed_m_s:.1f} m/s, {uav.mode.name}")
