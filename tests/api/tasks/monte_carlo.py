"""Flies twenty seeds and prints a table of the results."""

import pandas

from volery import Simulation, load_scenario


def fly(seed):
    with Simulation(load_scenario("hover").with_(seed=seed)) as simulation:
        return simulation.fly(4.0).summary()


table = pandas.DataFrame([fly(seed) for seed in range(20)])
print(table.describe())
