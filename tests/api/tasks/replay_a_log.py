"""Publishes the messages of a log into a running simulation."""

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    simulation.replay_log("flight.mcap")
    simulation.run(2.0)
