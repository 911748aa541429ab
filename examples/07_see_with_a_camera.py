"""Saves a camera's colour image and depth of a forest, side by side, in camera.png."""

import sys

import matplotlib
import numpy as np
from PIL import Image

from volery import Simulation, load_scenario

file = sys.argv[1] if len(sys.argv) > 1 else "camera.png"

with Simulation(load_scenario("forest_cameras")) as simulation:
    simulation.run(12.0)  # take-off and flight with the LIDARs
    sample = simulation.uavs["uav1"].sensors["front"].next()  # renders one image

depth = sample.depth  # m along the optical axis, inf for sky
near = 1.0 - np.log(np.clip(depth, 1.0, 100.0)) / np.log(100.0)
coloured = (255 * matplotlib.colormaps["magma"](near)[..., :3]).astype(np.uint8)
Image.fromarray(np.hstack([sample.image, coloured])).save(file)
height, width = depth.shape
print(f"{width} x {height} pixels in {file}, the nearest thing is {depth.min():.1f} m away")
