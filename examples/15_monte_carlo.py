"""Flies one scenario with twenty seeds and prints a table of the results."""

import numpy as np
import pandas

from volery import Simulation, load_scenario

SCENARIO = load_scenario("hover").with_(
    world={"wind": {"velocity_m_s": [5.0, 0.0, 0.0], "turbulence": "moderate"}}
)


def fly(seed):
    with Simulation(SCENARIO.with_(seed=seed)) as simulation:
        result = simulation.fly(12.0)
    drift_m = np.linalg.norm(result["uav1"].position_map[-1, :2])
    return result.summary() | {"drift_m": drift_m}


table = pandas.DataFrame([fly(seed) for seed in range(20)])
print(table[["seed", "contacts", "distance_m", "max_speed_m_s", "drift_m"]].round(2))
print(f"drift: {table.drift_m.mean():.2f} m in the mean, {table.drift_m.max():.2f} m at most")
