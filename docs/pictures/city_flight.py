"""Makes city_flight.png: the street of uav1 in `city_flight`, seen by our own camera.

Run it in this folder: python city_flight.py. It needs matplotlib alone, which Volery brings.
"""

import matplotlib.image
import numpy as np

from volery import load_scenario
from volery.core import rotations
from volery.runtime.construction.fleet import add_bodies, place
from volery.runtime.construction.worlds import build_city, build_forest, build_terrain
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import new_history
from volery.world.scene import Scene
from volery.world.trees import DetailLevel

CAMERA = CameraModel(width=1200, height=675, horizontal_fov_deg=70.0, far_m=3000.0, samples=4)
# The eye is that of uav1, which does not see itself; the others fly ahead.
UAVS = np.array([[-55.0, -304.6, 10.8], [-51.0, -304.2, 10.6], [-46.0, -306.6, 11.4]])
POSES = np.radians([[0.0, 2.0, 0.0], [3.0, 8.0, 10.0], [-4.0, 6.0, -5.0]])

scenario = load_scenario("city_flight")
terrain = build_terrain(scenario)
city = build_city(scenario, terrain)
forest = build_forest(scenario, terrain, city)
visual = DetailLevel.VISUAL  # every leaf
scene = Scene(terrain, forest, detail=visual, solids=city.solids, cover=city.cover, threads=2)
add_bodies(scene, place(scenario, scene, terrain))
history = new_history(UAVS, [rotations.from_rpy(*pose) for pose in POSES], 1_000_000)
batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
light = make_light(sun_elevation_deg=40.0, sun_azimuth_deg=225.0)
picture = take(scene, CAMERA, light, batch, history, parts=("colour",))
matplotlib.image.imsave("city_flight.png", picture.colour[0])
scene.close()
