"""What the recipes of docs/ros2.md name is there: topics, types, frames, quality of service."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from volery.bridges.ros2.middleware import Profile
from volery.bridges.ros2.profiles import profile_of
from volery.bridges.shared_names import COMMANDS, SharedNames
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

ROOT = Path(__file__).parents[3]
RVIZ = ROOT / "examples" / "ros2" / "volery.rviz"
SQUARE = ROOT / "examples" / "ros2" / "fly_square.py"
DOC = (ROOT / "docs" / "ros2.md").read_text(encoding="utf-8")

CARRIED = {
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Odometry": "nav_msgs/msg/Odometry",
    "Image": "sensor_msgs/msg/Image",
    "Map": "nav_msgs/msg/OccupancyGrid",
}
"""Displays of rviz_default_plugins and the messages they take (its plugins_description.xml)."""
PLAIN = {"Grid", "TF", "MoveCamera", "Select", "Measure", "SetGoal", "ThirdPersonFollower"}
"""Of the same file: displays without a topic, tools, views."""
PANELS = {"rviz_common/Displays", "rviz_common/Views", "rviz_common/Time"}
POLICIES = {
    "Depth": range(1, 101),
    "History Policy": {"Keep Last"},
    "Reliability Policy": {"Reliable", "Best Effort"},
    "Durability Policy": {"Volatile", "Transient Local"},
}


class Flown:
    """Topics and frames of scenarios."""

    def __init__(self, *names):
        self.published, self.listened, self.services, self.frames = {}, {}, {}, set()
        for name in names:
            with Simulation(load_scenario(name)) as simulation:
                for topic in ("/tf", "/tf_static"):
                    simulation.graph.subscribe(topic, self.note)
                simulation.step(40)
                for topic in simulation.graph.topics():
                    if topic.publishers:
                        self.published[topic.name] = topic
                    if topic.subscribers:
                        self.listened[topic.name] = topic.msgtype
                self.services |= simulation.graph.services()

    def note(self, published):
        for transform in published.message.transforms:
            self.frames |= {transform.header.frame_id, transform.child_frame_id}

    def offers(self, name):
        """Type and quality of service of a topic."""
        topic = self.published[name]
        return topic.msgtype, profile_of(name, topic.msgtype, latched=topic.latched)


@pytest.fixture(scope="module")
def flown():
    return Flown("forest_cameras", "grid_map")


@pytest.fixture(scope="module")
def rviz():
    return YAML(typ="safe", pure=True).load(RVIZ.read_text(encoding="utf-8"))


def asked(topic):
    """Quality of service that a display asks for."""
    for word, allowed in POLICIES.items():
        assert topic[word] in allowed
    return Profile(
        reliable=topic["Reliability Policy"] == "Reliable",
        latched=topic["Durability Policy"] == "Transient Local",
    )


def test_rviz_knows_every_class(rviz):
    manager = rviz["Visualization Manager"]
    assert {panel["Class"] for panel in rviz["Panels"]} <= PANELS
    parts = [*manager["Displays"], *manager["Tools"], manager["Views"]["Current"]]
    names = [part["Class"].removeprefix("rviz_default_plugins/") for part in parts]
    assert set(names) <= CARRIED.keys() | PLAIN


def test_rviz_shows_what_is_flown_and_asks_for_no_more_than_is_offered(rviz, flown):
    shown = [d for d in rviz["Visualization Manager"]["Displays"] if "Topic" in d]
    assert len(shown) == 6
    for display in shown:
        kind, wanted = display["Class"].rpartition("/")[2], asked(display["Topic"])
        msgtype, offered = flown.offers(display["Topic"]["Value"])
        assert msgtype == CARRIED[kind]
        assert offered.reliable or not wanted.reliable
        assert offered.latched or not wanted.latched


def test_rviz_names_frames_that_there_are(rviz, flown):
    manager = rviz["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] in flown.frames
    assert manager["Views"]["Current"]["Target Frame"] in flown.frames


def test_goals_of_rviz_are_taken(rviz, flown):
    (tool,) = [t for t in rviz["Visualization Manager"]["Tools"] if "Topic" in t]
    name = tool["Topic"]["Value"]
    assert flown.listened[name] == "geometry_msgs/msg/PoseStamped"
    assert SharedNames(("*",), COMMANDS).takes(name, 1, 1)
    asked(tool["Topic"])


def test_topics_and_frames_of_the_recipes_are_there(flown):
    recipes = DOC[DOC.index("## Recipes") : DOC.index("## When something")]
    topics = set(re.findall(r"/uav1/[a-z_/]+", recipes))
    assert {"/uav1/odom", "/uav1/cmd_vel", "/uav1/laser/horizontal/scan"} <= topics
    assert topics <= flown.published.keys() | flown.listened.keys()
    frames = set(re.findall(r"(?<![/\w])uav1/(?:odom|base_link|\w+_optical)", recipes))
    assert {"uav1/odom", "uav1/base_link"} <= frames <= flown.frames
    assert flown.offers("/map") == ("nav_msgs/msg/OccupancyGrid", Profile(latched=True, depth=1))


def test_the_square_asks_for_what_is_offered(flown):
    calls = {}
    for node in ast.walk(ast.parse(SQUARE.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            words = [a.value for a in node.args if isinstance(a, ast.Constant)]
            types = [a.id for a in node.args if isinstance(a, ast.Name)]
            calls.setdefault(node.func.attr, []).append((types[:1], words[:1]))
    assert calls["create_publisher"] == [(["Twist"], ["cmd_vel"])]
    assert flown.listened["/uav1/cmd_vel"] == "geometry_msgs/msg/Twist"
    assert calls["create_subscription"] == [(["Odometry"], ["odom"])]
    assert flown.offers("/uav1/odom") == ("nav_msgs/msg/Odometry", Profile())
    assert calls["create_client"] == [(["Trigger"], ["take_off"]), (["Trigger"], ["land"])]
    for word in ("take_off", "land"):
        assert flown.services[f"/uav1/{word}"] == "std_srvs/srv/Trigger"
