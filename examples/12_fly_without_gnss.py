"""Searches a forest without satellite navigation and prints the position error of the SLAM."""

import math

import volery

with volery.make("forest_search", uavs=1) as simulation:
    uav = simulation.uavs["uav1"]
    errors = []

    def on_pose(published):
        believed = published.message.pose.pose.position
        errors.append(math.dist((believed.x, believed.y, believed.z), uav.position_map))

    simulation.graph.subscribe("/uav1/slam/pose", on_pose)
    for _ in range(5):
        simulation.run(5.0)
        x, y, z = uav.position_map
        print(
            f"{simulation.time_s:4.1f} s  at ({x:.1f}, {y:.1f}, {z:.1f}) m, "
            f"SLAM off by {errors[-1]:.2f} m, at most {max(errors):.2f} m so far"
        )
