"""Saves a depth image, mm in 16 bits."""

from PIL import Image

from volery import Simulation, load_scenario

with Simulation(load_scenario("forest_cameras")) as simulation:
    Image.fromarray(simulation.uavs["uav1"].sensors["front"].next().depth_mm()).save("depth.png")
