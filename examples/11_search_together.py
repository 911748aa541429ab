"""Searches a meadow for a red object with three UAVs that meet at the detected object."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("cooperative_search")) as simulation:
    phases = {}

    def hear(published):
        name = published.topic.split("/")[1]
        phase = published.message.phase
        if phases.get(name) != phase:
            phases[name] = phase
            print(f"{simulation.time_s:5.1f} s  {name} {phase}")

    def on_found(published):
        place = published.message.point
        print(f"{simulation.time_s:5.1f} s  found at ({place.x:.2f}, {place.y:.2f}) m")

    for uav in simulation.uavs:
        simulation.graph.subscribe(f"/{uav}/search/state", hear)
        simulation.graph.subscribe(f"/{uav}/search/found", on_found)
    while not simulation.clock.finished:
        simulation.run(10.0)
