"""Nodes in processes of their own from the first step on: the same run, topic by topic."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from volery.cli.app import app

NODE = """\
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String


class Climbing(Node):
    def __init__(self):
        super().__init__("climbing")
        self.command = self.create_publisher(Twist, "cmd_vel", 1)
        self.said = self.create_publisher(String, "said", 1)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_timer(0.05, self.on_timer)
        self.height = 0.0

    def on_odometry(self, message):
        self.height = message.pose.pose.position.z
        self.said.publish(String(data=f"at {self.height:.9f}"))

    def on_timer(self):
        command = Twist()
        command.linear.x = 0.5
        command.linear.z = 1.0 - self.height
        self.command.publish(command)
"""
SCENARIO = """\
name = "climb"
duration_s = 2.0

[types.f450]
[[types.f450.sensors]]
kind = "odometry"
[[types.f450.sensors]]
kind = "imu"
[[types.f450.nodes]]
node = "climbing_node:Climbing"

[[uavs]]
type = "f450"
position_m = [0.0, 0.0]
on_start = "take_off"
"""
HANG_S = 600.0


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "climbing_node.py").write_text(NODE)
    (tmp_path / "climb.toml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def digests(text):
    """In order, and by topic."""
    return re.search(r"digest +(\w+)", text)[1], re.search(r"topics +(\w+)", text)[1]


def fly_with_node_outside():
    volery = [sys.executable, "-m", "volery"]
    bridge = [
        "--bridge",
        "rosbridge=0",
        "--wait-for",
        "climbing",
        "--wait-timeout",
        f"{HANG_S}",
    ]
    words = ["run", "climb.toml", "--trust", "--no-nodes", "--speed", "max", "--digest", *bridge]
    pipe = subprocess.PIPE
    with subprocess.Popen([*volery, *words], stdout=pipe, stderr=pipe, text=True) as run:
        try:
            found = (re.match(r"open .*(127\.0\.0\.1:\d+)", line) for line in run.stderr)
            address = next(filter(None, found))[1]
            connection = ["--via", f"rosbridge://{address}", "--namespace", "/uav1"]
            with subprocess.Popen(
                [*volery, "node", "climbing_node:Climbing", *connection, "--lock-step", "0.001"],
                stderr=subprocess.DEVNULL,
            ) as node:
                try:
                    return digests(run.communicate(timeout=HANG_S)[0])
                finally:
                    node.terminate()
                    node.wait(HANG_S)
        finally:
            run.kill()


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_a_lock_step_node_in_its_own_process_is_byte_for_byte_the_one_inside():
    inside = CliRunner().invoke(app, ["run", "climb.toml", "--trust", "--digest"])
    assert inside.exit_code == 0, inside.output
    first, second = fly_with_node_outside(), fly_with_node_outside()
    assert first == second
    assert first[1] == digests(inside.output)[1]


def test_what_does_not_come_is_named():
    words = ["run", "hover", "--wait-for", "a,/uav1/b", "--wait-timeout", "0.1"]
    result = CliRunner().invoke(app, [*words, "--bridge", "rosbridge=0"])
    assert result.exit_code == 2
    assert "waiting for a, /uav1/b, at most 0.1 s" in result.output
    assert "a, /uav1/b not connected within 0.1 s; connected: none" in result.output


def test_a_start_that_nothing_can_resume_is_refused():
    result = CliRunner().invoke(app, ["run", "hover", "--start-paused"])
    assert result.exit_code == 2
    assert "nothing can resume this run" in result.output
