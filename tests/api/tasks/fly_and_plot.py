"""Flies, and draws the paths and the heights."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    result = simulation.fly(4.0)
result.plot().figure.savefig("paths.png")
result.plot_over_time("height").figure.savefig("height.png")
