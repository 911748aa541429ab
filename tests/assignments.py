"""An assignment and submissions for tests."""

from __future__ import annotations

import textwrap

SCENARIO = """
name = "task"
duration_s = 6.0

[types.bird]
airframe = "f450"
[[types.bird.sensors]]
kind = "odometry"

[[uavs]]
type = "bird"
count = 2
position_m = [0.0, 0.0]
last_position_m = [0.0, 9.0]
on_start = "take_off"

[[expect]]
kind = "no_contact"

[[expect]]
name = "arrives"
kind = "arrives"
uavs = ["uav1"]
position_m = [2.0, 0.0]
within_m = 0.5
"""
ASSIGNMENT = """
scenario = "task.toml"
seeds = 1
timeout_s = 60.0
[points]
arrives = 3
"""
CONTROLLER = """
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node


class Pilot(Node):
    def __init__(self):
        super().__init__("pilot")
        self.command = self.create_publisher(Twist, "cmd_vel", 1)
        self.create_subscription(Odometry, "odom", self.on_odometry, 1)
        self.started()

    def started(self):
        pass

    def on_odometry(self, odometry):
        self.command_to(2.0, odometry)

    def command_to(self, x, odometry):
        command = Twist()
        command.linear.x = min(1.0, x - odometry.pose.pose.position.x)
        self.command.publish(command)
"""


def write_assignment(folder, text=ASSIGNMENT, scenario=SCENARIO):
    """Writes the files; returns that of the assignment."""
    (folder / "task.toml").write_text(scenario, encoding="utf-8")
    file = folder / "assignment.toml"
    file.write_text(text, encoding="utf-8")
    return file


def write_controller(file, method=""):
    """Writes a submission, with a method in place of the one of this name."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(CONTROLLER + textwrap.indent(textwrap.dedent(method), "    "), encoding="utf-8")
