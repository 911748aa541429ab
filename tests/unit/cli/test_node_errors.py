"""What a user sees of an exception in a node: file, line and frames; in logs too."""

import logging

import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from volery.bridges.logs.reader import summarize
from volery.cli import node_logs
from volery.cli.app import app
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.nodes import PYTHON_LOGGER

BROKEN = """\
import json
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String


class Broken(Node):
    def __init__(self):
        super().__init__("broken")
        self.get_logger().info("begins")
        self.divisor = 0
        self.create_timer(0.1, self.on_timer)

    def on_timer(self):
        self.helper()

    def helper(self):
        return 1 / self.divisor


class Wrong(Broken):
    def helper(self):
        self.create_publisher(String, "text", 1).publish("no message")


class High(Node):
    def __init__(self):
        super().__init__("high")
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)

    def on_odometry(self, message):
        if message.pose.pose.position.z > 0.1:
            raise RuntimeError("too high")


class Leaves(Broken):
    def helper(self):
        raise SystemExit(0)


class Deep(Broken):
    def helper(self):
        json.loads("{")


class Unborn(Node):
    def __init__(self):
        super().__init__("unborn")
        self.nothing.here()
"""
SCENARIO = """\
name = "broken"
duration_s = 1.0

[types.f450]
[[types.f450.nodes]]
node = "{node}"

[[types.f450.sensors]]
kind = "odometry"
noise = false

[[uavs]]
type = "f450"
count = {uavs}
position_m = [0.0, 0.0]
last_position_m = [5.0, 0.0]
on_start = "take_off"
"""


@pytest.fixture
def run(tmp_path, monkeypatch, without_ros1):
    """Run a scenario with a node of BROKEN; returns the result and the log's path."""
    monkeypatch.chdir(tmp_path)
    logger = logging.getLogger(PYTHON_LOGGER)
    before = list(logger.handlers), logger.level, logger.propagate

    def go(node, *words, uavs=1):
        module = f"broken_{node.lower()}"
        (tmp_path / f"{module}.py").write_text(BROKEN)
        (tmp_path / "broken.toml").write_text(SCENARIO.format(node=f"{module}:{node}", uavs=uavs))
        node_logs.show_node_logs()
        command = ["run", "broken.toml", "--trust", "--record", "log.mcap", "--overwrite", *words]
        return CliRunner().invoke(app, command), tmp_path / "log.mcap"

    yield go
    logger.handlers, logger.level, logger.propagate = before


def fatal_of(log):
    with log.open("rb") as file:
        found = make_reader(file).iter_messages(topics=["/rosout"])
        return [decode_cdr(entry.data, "rcl_interfaces/msg/Log") for _, _, entry in found]


def test_the_users_frames_are_shown_and_recorded(run):
    result, log = run("Broken")
    assert result.exit_code == 2, result.output
    output = result.output
    assert "[INFO] [0.000000000] [uav1.broken]: begins" in output
    assert (
        "error: node /uav1/broken failed at 0.100 s in its timer (on_timer): "
        "ZeroDivisionError: division by zero (broken_broken.py:18)" in output
    )
    assert 'broken_broken.py", line 15, in on_timer' in output
    assert 'broken_broken.py", line 18, in helper\n    return 1 / self.divisor' in output
    assert "/volery/graph/" not in output
    begun, fatal = fatal_of(log)
    assert (begun.level, begun.msg) == (20, "begins")
    assert (fatal.level, fatal.name, fatal.line) == (50, "uav1.broken", 18)
    assert fatal.stamp.nanosec == 100_000_000
    assert "in its timer (on_timer)" in fatal.msg
    assert "line 18, in helper" in fatal.msg


def test_the_first_of_two_errors_ends_the_flight_and_its_log_is_whole(run):
    result, log = run("High", uavs=2)
    assert "error: node /uav1/high failed at " in result.output
    assert "uav2" not in result.output
    assert "The flight ended with an error: flew" in result.output
    assert summarize(log).problem == ""


def test_a_node_that_exits_is_an_error(run):
    result, _ = run("Leaves")
    assert result.exit_code == 2
    assert "in its timer (on_timer): SystemExit: 0 (broken_leaves.py:" in result.output


def test_a_failed_node_may_fail_the_flight(run):
    assert run("Broken", "--fail-on", "crash")[0].exit_code == 2
    assert run("Broken", "--fail-on", "crash,node-error")[0].exit_code == 1


def test_errors_of_volery_and_of_libraries_point_to_the_users_line_too(run):
    output = run("Wrong")[0].output
    assert "carries std_msgs/msg/String, not a str (broken_wrong.py:23)" in output
    output = run("Deep")[0].output
    assert "JSONDecodeError" in output
    assert "(broken_deep.py:43)" in output
    assert "json/decoder.py" not in output


def test_traceback_shows_all(run):
    output = run("Broken", "--traceback")[0].output
    assert "Traceback (most recent call last)" in output
    assert "/graph/nodes/node.py" in output


def test_a_constructor_that_fails_shows_its_line(run):
    result, _ = run("Unborn")
    assert result.exit_code == 2
    assert "does not start: AttributeError: " in result.output
    assert "(broken_unborn.py:49)" in result.output
    assert 'broken_unborn.py", line 49, in __init__' in result.output
