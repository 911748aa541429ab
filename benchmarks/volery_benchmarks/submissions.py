"""Submissions for the grading of the bench `verdicts`: fair nodes, and hostile ones."""

from __future__ import annotations

from pathlib import Path

_SCENARIO = """name = "across"
duration_s = 20.0

[types.bird]
airframe = "f450"

[[types.bird.sensors]]
kind = "odometry"

[[uavs]]
type = "bird"
position_m = [0.0, 0.0]
on_start = "take_off"

[[expect]]
kind = "no_contact"

[[expect]]
name = "arrives"
kind = "arrives"
position_m = [8.0, 0.0]
within_m = 0.5

[[expect]]
name = "stays on its way"
kind = "inside"
region_m = [-1.0, -1.0, 9.0, 1.0]
"""
_ASSIGNMENT = """scenario = "across.toml"
seeds = 3
timeout_s = 60.0
memory_mb = 2048
"""
_FAIR = """from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node


class Pilot(Node):
    def __init__(self):
        super().__init__("pilot")
        self.command = self.create_publisher(Twist, "cmd_vel", 1)
        self.create_subscription(Odometry, "odom", self.on_odometry, 1)

    def on_odometry(self, odometry):
        command = Twist()
        command.linear.x = {gain} * (8.0 - odometry.pose.pose.position.x)
        self.command.publish(command)
"""
_HOSTILE = {
    "loop": """
        if odometry.header.stamp.sec >= 5:
            while True:
                pass
""",
    "memory": """
        if odometry.header.stamp.sec >= 5:
            self.kept = [bytearray(50_000_000) for _ in range(10_000)]
""",
    "reader": """
        import glob
        from pathlib import Path
        others = glob.glob({others!r} + "/*.py") + [str(Path.home() / ".ssh")]
        raise SystemExit(f"it can read {{[path for path in others if Path(path).exists()]}}")
""",
}


def write_assignment(folder: Path) -> Path:
    """Writes an assignment and its scenario; returns the assignment's file."""
    (folder / "across.toml").write_text(_SCENARIO, encoding="utf-8")
    file = folder / "assignment.toml"
    file.write_text(_ASSIGNMENT, encoding="utf-8")
    return file


def write_fair(folder: Path, count: int) -> None:
    """Writes submissions that fly at different speeds."""
    folder.mkdir()
    for number in range(count):
        text = _FAIR.format(gain=round(0.3 + 0.02 * number, 2))
        (folder / f"student_{number:02}.py").write_text(text, encoding="utf-8")


def write_hostile(folder: Path) -> None:
    """Writes submissions that never return, take all memory, or read others."""
    for name, lines in _HOSTILE.items():
        text = _FAIR.format(gain=0.5) + lines.format(others=str(folder))
        (folder / f"hostile_{name}.py").write_text(text, encoding="utf-8")
