"""Flies the shipped homing policy with an estimator, sensor noise and latency, to three targets."""

import numpy as np

import volery
from volery.graph.messages import Point, PoseStamped

TARGETS = [(12.0, 6.0, 6.0), (4.0, -5.0, 3.0), (0.0, 0.0, 8.0)]

with volery.make("policy_homing") as simulation:
    uav = simulation.uavs["uav1"]
    goal = simulation.graph.advertise("/uav1/policy/goal_pose", PoseStamped)
    simulation.run(5.0)  # the take-off
    for target in TARGETS:
        message = PoseStamped()
        message.header.frame_id = "map"
        message.pose.position = Point(*target)
        goal.publish(message)
        simulation.run_until(
            lambda target=target: np.linalg.norm(uav.position_map - target) < 0.4, timeout_s=40.0
        )
        x, y, z = uav.position_map
        print(f"{simulation.time_s:5.1f} s: at {x:.2f}, {y:.2f}, {z:.2f} m, target {target}")
