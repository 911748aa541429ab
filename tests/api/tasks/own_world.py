"""Makes a world in Python and flies over it."""

import volery
from volery.scenario import LidarSensor, ProceduralForest, Scenario, UavType, Wind, World, circle

forest = ProceduralForest(region_m=(10, -40, 90, 40), trees=200, species={"broadleaf": 1.0})
world = World(forest=forest, wind=Wind(velocity_m_s=(3.0, 0.0, 0.0), turbulence="light"))
scout = UavType(airframe="iris", sensors=(LidarSensor(position_m=(0.0, 0.0, 0.18)),))
uavs = circle("scout", 3, radius_m=5.0)
with volery.make(Scenario(name="wood", world=world, types={"scout": scout}, uavs=uavs)) as run:
    run.run(3.0)
