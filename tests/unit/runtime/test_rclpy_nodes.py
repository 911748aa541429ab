"""Node files written for rclpy run in a scenario as they are."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from volery.bridges.ros1.environment import rospy_is_installed
from volery.core.errors import NodeError, ScenarioError
from volery.graph.messages import Log, String
from volery.graph.nodes.imports import withdraw_ros_imports
from volery.graph.parameters import ParameterSetting

FOLDER = Path(__file__).parent / "rclpy_nodes"


@pytest.fixture(autouse=True)
def no_stand_ins_left(monkeypatch, without_ros1):
    """Each test reloads its modules and leaves no stand-ins."""
    monkeypatch.chdir(FOLDER)
    yield
    withdraw_ros_imports()
    for name in [
        name for name in sys.modules if name in ("minimal_nodes", "broken_nodes", "idiom_nodes")
    ]:
        del sys.modules[name]


@pytest.fixture
def fly(simulate, flat_data):
    """Run with nodes of `minimal_nodes`; returns simulation and what was logged."""

    def run(*names, seconds=2.4, **entry):
        nodes = [{"node": f"minimal_nodes:{name}", **entry} for name in names]
        flat_data["types"]["f450"]["nodes"] = nodes
        simulation = simulate(flat_data)
        logs = []
        simulation.graph.subscribe("/rosout", lambda p: logs.append(p.message), Log)
        simulation.run(seconds)
        return simulation, logs

    return run


def test_a_publisher_with_a_timer(fly):
    simulation, logs = fly("Talker")
    entries = [(entry.stamp.sec, entry.stamp.nanosec, entry.msg) for entry in logs]
    assert entries == [
        (k // 2, k % 2 * 500_000_000, f"publishing 'hello {k - 1}'") for k in range(1, 5)
    ]
    first = logs[0]
    assert (first.name, first.level) == ("uav1.talker", Log.INFO)
    assert (first.file, first.function) == ("minimal_nodes.py", "Talker.timer_callback")
    assert simulation.vehicles.nodes[0].count == 4


def test_a_subscriber_with_parameters(fly):
    simulation, _ = fly("Talker", "Listener", parameters={})
    listener = simulation.vehicles.nodes[1]
    assert listener.lines == ["heard hello 0", "again hello 1", "again hello 2", "again hello 3"]
    results = listener.set_parameters(
        [ParameterSetting("speed", value=3.0), ParameterSetting("speed", value=2)]
    )
    assert [(r.successful, r.reason) for r in results] == [(False, "too fast"), (True, "")]
    assert listener.get_parameter("speed").get_parameter_value().double_value == 2.0
    outside = simulation.graph.parameters.get("/uav1/listener", "speed")
    outside.set(0.5)
    assert listener.get_parameter("speed").value == 0.5
    with pytest.raises(Exception, match="too fast"):
        outside.set(5.0)


def test_a_client_that_waits_for_a_service_of_a_later_node(fly):
    simulation, logs = fly("AddClient", "AddServer", seconds=3.2)
    client = simulation.vehicles.nodes[0]
    assert client.sums == [42, 43, 44]
    assert [entry.msg for entry in logs] == ["42 at 1", "43 at 2", "44 at 3"]


def test_nodes_with_a_latency_too(fly):
    simulation, _ = fly("AddClient", "AddServer", "Talker", "Listener", latency_s=0.05, seconds=3.4)
    client, _, _, listener = simulation.vehicles.nodes
    assert client.sums == [42, 43, 44]
    assert len(listener.lines) == 6


def test_what_a_node_says_while_it_is_made_is_recorded(simulate, flat_data, tmp_path, monkeypatch):
    (tmp_path / "early_words.py").write_text(
        "from rclpy.node import Node\n"
        "class Early(Node):\n"
        "    def __init__(self):\n"
        "        super().__init__('early')\n"
        "        self.get_logger().warning('one')\n"
        "        self.get_logger().debug('too low')\n"
        "        self.get_logger().error('two')\n"
    )
    monkeypatch.chdir(tmp_path)
    flat_data["types"]["f450"]["nodes"] = [{"node": "early_words:Early"}]
    simulation = simulate(flat_data)
    received = []
    simulation.graph.subscribe_all(received.append)
    simulation.run(0.01)
    assert [(p.message.level, p.message.msg) for p in received if p.topic == "/rosout"] == [
        (30, "one"),
        (40, "two"),
    ]


def test_a_message_may_be_used_again_after_its_publication(simulate, flat_data):
    simulation = simulate(flat_data)
    from volery.graph.nodes.node import Context, Node

    context = Context(simulation.graph, simulation._engine, lambda: simulation.time_ns)
    node = Node("again", context=context)
    received = []
    node.create_subscription(String, "text", lambda m: received.append(m.data))
    publisher, message = node.create_publisher(String, "text"), String()
    for text in ("a", "b"):
        message.data = text
        publisher.publish(message)
    simulation.run(0.01)
    assert received == ["a", "b"]


def test_unknown_types_and_modules_are_import_errors(tmp_path, monkeypatch, simulate, flat_data):
    monkeypatch.chdir(tmp_path)
    for k, line in enumerate(("from std_msgs.msg import Strin", "import rclpy.nothing")):
        (tmp_path / f"wrong_import_{k}.py").write_text(f"{line}\n")
        flat_data["types"]["f450"]["nodes"] = [{"node": f"wrong_import_{k}:X"}]
        with pytest.raises(ScenarioError, match=rf"cannot be imported: .*wrong_import_{k}.py:1"):
            simulate(flat_data)


@pytest.mark.parametrize(
    ("line", "advice"),
    [
        ("import rospy", "node of ROS 1: .* --bridge ros1"),
        ("from nav2_msgs.msg import Costmap", "files of nav2_msgs in message_packages"),
        ("import ament_index_python.packages", "no stand-in for ament_index_python"),
        ("import not_of_ros", r"No module named 'not_of_ros' \(wrong.py:1\)\s"),
    ],
)
def test_a_missing_package_of_ros_comes_with_advice(
    tmp_path, monkeypatch, simulate, flat_data, line, advice
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wrong.py").write_text(f"{line}\n")
    flat_data["types"]["f450"]["nodes"] = [{"node": "wrong:X"}]
    with pytest.raises(ScenarioError, match=rf"cannot be imported: ModuleNotFound.*{advice}"):
        simulate(flat_data)


def test_a_missing_node_file_is_said_in_one_line(tmp_path, monkeypatch, simulate, flat_data):
    monkeypatch.chdir(tmp_path)
    flat_data["types"]["f450"]["nodes"] = [{"node": "not_there:X"}]
    with pytest.raises(ScenarioError, match="no module 'not_there' is installed or") as raised:
        simulate(flat_data)
    assert str(tmp_path) in str(raised.value)
    assert not hasattr(raised.value, "__notes__")


def test_spinning_says_that_volery_does_it(simulate, flat_data, tmp_path, monkeypatch):
    (tmp_path / "spins.py").write_text(
        "import rclpy\n"
        "from rclpy.node import Node\n"
        "class Spins(Node):\n"
        "    def __init__(self):\n"
        "        super().__init__('spins')\n"
        "        self.create_timer(0.1, self.on_timer)\n"
        "    def on_timer(self):\n"
        "        rclpy.spin_once(self)\n"
    )
    monkeypatch.chdir(tmp_path)
    flat_data["types"]["f450"]["nodes"] = [{"node": "spins:Spins"}]
    with pytest.raises(NodeError, match=r"add_done_callback.*\(spins.py:8\)"):
        simulate(flat_data).run(0.2)


@pytest.mark.skipif(not rospy_is_installed(), reason="rospy is not installed")
def test_node_files_find_volerys_messages_beside_rospy():
    """In a process of its own: rospy imports ROS 1's packages of the same names."""
    program = """
        from volery.bridges.ros1.environment import load_rospy
        from volery.graph.nodes.imports import provide_ros_imports

        rospy = load_rospy()
        provide_ros_imports()
        from std_msgs.msg import Header, String
        from rosgraph_msgs.msg import Clock

        assert String.__msgtype__ == "std_msgs/msg/String"
        assert Clock.__msgtype__ == "rosgraph_msgs/msg/Clock"
        assert rospy.Header is not Header
        assert rospy.Header._md5sum
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=True, timeout=60)


def test_node_files_find_volerys_messages_before_other_packages(tmp_path):
    """In a process of its own, where ROS 1's packages are on the path, unless ROS 2's are."""
    for name in ("std_msgs", "rclpy"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "std_msgs" / "msg.py").write_text("class String: pass\n")
    program = """
        import sys
        sys.path.append({!r})
        from volery.graph.nodes.imports import provide_ros_imports
        provide_ros_imports()
        from std_msgs.msg import String
        assert hasattr(String, "__msgtype__") is {}
    """
    for has_ros2 in (True, False):
        text = textwrap.dedent(program).format(str(tmp_path), not has_ros2)
        subprocess.run([sys.executable, "-c", text], check=True, timeout=60)
        if has_ros2:
            (tmp_path / "rclpy" / "__init__.py").unlink()
            (tmp_path / "rclpy").rmdir()


def fly_idioms(simulate, flat_data, name):
    flat_data["types"]["f450"]["nodes"] = [{"node": f"idiom_nodes:{name}"}]
    simulation = simulate(flat_data)
    simulation.run(0.35)
    return simulation.vehicles.nodes[0]


def test_idioms_of_published_nodes(simulate, flat_data):
    seen = fly_idioms(simulate, flat_data, "Idioms").seen
    assert seen.pop("yaw") == pytest.approx(1.0)
    assert seen.pop("inside") == pytest.approx(1.683, abs=1e-3)  # 2 sin(1)
    assert seen == {
        "time": 7_000_000_000,
        "qos": 1,
        "sim": True,
        "nodes": ["idioms"],
        "count": (1, 0),
        "msg_type": True,
        "slices": (6, False, 0),
        "x": 2.0,
        "moon": "there is no frame 'moon'",
    }


def test_a_value_of_a_wrong_type_is_reported_with_node_line_and_field(simulate, flat_data):
    with pytest.raises(NodeError) as caught:
        fly_idioms(simulate, flat_data, "Typed")
    text = str(caught.value)
    line = next(
        k
        for k, line in enumerate((FOLDER / "idiom_nodes.py").read_text().splitlines(), 1)
        if "self.out.publish(message)" in line
    )
    assert "/uav1/typed" in text
    assert "data must be a string, not 7 (int)" in text
    assert "idiom_nodes.py" in text
    assert f"line {line}" in text or f":{line}" in text


def test_what_cannot_wait_is_refused_in_one_line(simulate, flat_data):
    with pytest.raises(Exception, match="use a timer"):
        fly_idioms(simulate, flat_data, "Waiting")
