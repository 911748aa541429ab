"""Flies 100 UAVs in a circle."""

import volery
from volery.scenario import circle

with volery.make("hover", uavs=circle("f450", 100, radius_m=60.0, heading="along")) as run:
    run.run(4.0)
    positions = [uav.position_map for uav in run.uavs.values()]
    print(len(positions), "UAVs at", positions[0])
