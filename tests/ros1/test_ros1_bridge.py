"""The simulation in a real ROS 1 graph: Debian's tools and plain rospy programs around it."""

from __future__ import annotations

import gc
import re
import sys
import threading
from xmlrpc.client import ServerProxy

import numpy as np
import pytest
from ros1_bench import (
    SYSTEM_PYTHON,
    WallGraph,
    ours,
    peer,
    require_ros1,
    running,
    shared_master,
    tool,
    wait_until,
)
from rosbags.highlevel import AnyReader

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros1.bridge import Ros1Bridge
from volery.bridges.ros1.environment import load_rospy
from volery.bridges.ros1.node import join_ros1
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.definition_files import find_definition_files
from volery.graph.codecs.interface_packages import DEFINITIONS, write_generator, write_package
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    Header,
    Point,
    String,
    TFMessage,
    Time,
    Twist,
    Vector3,
    message_type,
)
from volery.graph.service_reply import ServiceReply

require_ros1()
pytestmark = [  # rospy uses what is deprecated and forgets to close sockets
    pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

STRING = "std_msgs/msg/String"
HEADER = "std_msgs/msg/Header"
TWIST = "geometry_msgs/msg/Twist"
TRIGGER = "std_srvs/srv/Trigger"
GO_TO = "volery_interfaces/srv/GoTo"
FLIGHT_STATE = "volery_interfaces/msg/FlightState"
Triggered = message_type(f"{TRIGGER}_Response")
UNICODE = "Grüße, 無人機 🚁"


@pytest.fixture(scope="module")
def master():
    return shared_master()


@pytest.fixture(scope="module")
def live(master):
    live = WallGraph()
    with live.clock():
        yield live
    live.close()
    gc.collect()


@pytest.fixture(scope="module")
def bridge(live, master):
    bridge = Ros1Bridge(remote_services={"/remote": TRIGGER})
    with BridgeHost(live.gateway) as bridges:
        bridges.open(bridge)
        yield bridge
    assert "/use_sim_time" not in tool("rosparam", "list")


@pytest.fixture
def registered(bridge, live):
    """Waits until the bridge has registered a topic or service of the graph."""

    def wait(name, method="getTopicTypes"):
        node = join_ros1("volery")

        def known():
            if method == "getTopicTypes":
                return name in dict(node.master.ask(method))
            try:
                return bool(node.master.ask("lookupService", name))
            except BridgeError:
                return False

        assert wait_until(known)

    return wait


def wanted(live, topic):
    """Whether a topic of the graph has subscribers."""
    return any(t.name == topic and t.subscribers for t in live.graph.topics())


def readers(topic):
    """How many connections the bridge has to subscribers of a topic in ROS 1."""
    with ServerProxy(join_ros1("volery").master.ask("lookupNode", "/volery")) as node:
        rows = node.getBusInfo("/test")[2]
    return sum(row[2] == "o" and row[4] == topic for row in rows)


@pytest.fixture(scope="module")
def trigger(live):
    """A service of the graph."""
    live.graph.create_service(
        "/trigger", TRIGGER, lambda _request: Triggered(True, f"done, {UNICODE}")
    )


def test_topics_are_listed_with_their_types(live, registered):
    live.publisher("/uav1/listed", "sensor_msgs/msg/LaserScan")
    live.publisher("/map_tree", "octomap_msgs/msg/Octomap")  # no package of it is installed
    registered("/uav1/listed")
    registered("/map_tree")
    listed = tool("rostopic", "list", "-v")
    assert "/uav1/listed [sensor_msgs/LaserScan] 1 publisher" in listed
    assert "/map_tree [octomap_msgs/Octomap] 1 publisher" in listed
    assert "/use_sim_time" in tool("rosparam", "list")


def test_nothing_is_taken_from_the_graph_without_subscribers(live, registered):
    publish = live.publisher("/idle", STRING)
    registered("/idle")
    assert not wanted(live, "/idle")
    with peer("listen", "/idle", "--count=1") as listener:
        assert listener.next() == "ready"
        assert wait_until(lambda: wanted(live, "/idle"))
        publish(String(UNICODE))
        assert listener.next() == [UNICODE, "0", "/volery"]
    assert wait_until(lambda: not wanted(live, "/idle"))


def test_clock_and_transforms(live, registered):
    transforms = live.publisher("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
    transforms(TFMessage([]))
    registered("/tf_static")
    assert re.search(r"secs: \d+\n\s+nsecs:\s+\d+\n", tool("rostopic", "echo", "-n1", "/clock"))
    assert "transforms: []" in tool("rostopic", "echo", "-n1", "/tf_static")


def test_rates_are_measured(live, registered):
    publish = live.publisher("/rated", STRING)
    registered("/rated")
    stop = threading.Event()

    def talk():
        while not stop.wait(0.02):
            publish(String("x"))

    talking = threading.Thread(target=talk)
    talking.start()
    try:
        with running("rostopic", "hz", "--wall-time", "-w20", "/rated") as lines:
            assert wait_until(lambda: "average rate" in "".join(lines))
            measured = re.findall(r"average rate: ([\d.]+)", "".join(lines))
    finally:
        stop.set()
        talking.join()
    assert float(measured[0]) > 0.0  # how many a busy machine sends is its own business


def test_sequence_numbers_count_what_was_sent(live, registered):
    publish = live.publisher("/counted", HEADER)
    registered("/counted")
    with peer("headers", "/counted", "--count=3") as listener:
        assert listener.next() == "ready"
        assert wait_until(lambda: wanted(live, "/counted"))
        for k in range(3):
            publish(Header(Time(k, 7), "map"))
        assert [listener.next() for _ in range(3)] == [
            [k, k * 1_000_000_000 + 7, "map"] for k in range(3)
        ]


def test_a_wrong_md5_sum_is_refused_and_others_are_served(live, registered):
    publish = live.publisher("/summed", STRING)
    registered("/summed")
    with peer("listen", "/summed", "--altered") as wrong, peer("listen", "/summed") as right:
        assert wrong.next() == "ready"
        assert right.next() == "ready"
        assert wait_until(lambda: readers("/summed") and wanted(live, "/summed"))
        assert "0123456789abcdef0123456789abcdef" in wrong.next()["refused"]
        publish(String("fits"))
        assert right.next()[0] == "fits"
        assert readers("/summed") == 1


def test_the_late_get_what_was_latched_each_publisher_s_own(live, registered):
    first = live.publisher("/latched", STRING, latched=True)
    second = live.publisher("/latched", STRING, latched=True)
    first(String("old"))
    first(String("first"))
    second(String("second"))
    registered("/latched")
    for _ in range(2):
        with peer("listen", "/latched", "--count=2") as late:
            assert late.next() == "ready"
            got = [late.next() for _ in range(2)]
        assert sorted(text for text, _, _ in got) == ["first", "second"]
        assert {latching for _, latching, _ in got} == {"1"}
    with peer("listen", "/latched", "--count=5") as early:
        assert early.next() == "ready"
        assert {early.next()[0] for _ in range(2)} == {"first", "second"}
        with peer("listen", "/latched", "--count=2") as later:
            assert later.next() == "ready"
            assert {later.next()[0] for _ in range(2)} == {"first", "second"}
        first(String("new"))
        assert early.next()[0] == "new"  # and nothing twice


def test_a_slow_reader_delays_no_other(live, bridge, registered):
    publish = live.publisher("/flood", STRING)
    registered("/flood")
    with peer("hang", "/flood") as slow, peer("listen", "/flood", "--count=1000000") as quick:
        assert slow.next() == "ready"
        assert quick.next() == "ready"
        assert wait_until(lambda: readers("/flood") == 2)
        assert wait_until(lambda: wanted(live, "/flood"))
        big = "x" * 200_000
        for _ in range(200):
            publish(String(big))
        publish(String("last"))
        last = ""
        while last != "last":
            last = quick.next()[0]
        assert wait_until(lambda: bridge.dropped.get("/flood", 0) > 50)


def subscribed():
    """Topics with subscribers in ROS 1, and the names of those."""
    return join_ros1("volery").master.ask("getSystemState")[1]


def test_commands_come_in_and_do_not_come_back(live, registered):
    ours = live.publisher("/uav1/cmd_vel", TWIST)  # the graph may have publishers of its own
    seen = live.collect("/uav1/cmd_vel", TWIST)
    registered("/uav1/cmd_vel")
    assert wait_until(lambda: "/uav1/cmd_vel" in dict(subscribed()))
    twist = "{linear: {x: 1.5}, angular: {z: -0.5}}"
    kind, received = "geometry_msgs/Twist", []
    with peer("listen", "/uav1/cmd_vel", "--twist", "--count=1000000") as listener:
        assert listener.next() == "ready"
        assert wait_until(lambda: readers("/uav1/cmd_vel"))
        with running("rostopic", "pub", "-r5", "/uav1/cmd_vel", kind, twist):
            assert wait_until(lambda: len(seen) >= 3)
            while sum(sender.startswith("/rostopic") for _, _, sender in received) < 3:
                received.append(listener.next())
        ours(Twist(Vector3(9.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        while received[-1][0] != 9.0:
            received.append(listener.next())
    assert seen[0] == Twist(Vector3(1.5, 0.0, 0.0), Vector3(0.0, 0.0, -0.5))
    assert [x for x, _, sender in received if sender == "/volery"] == [9.0]  # and none twice


def test_topics_without_publishers_come_in_as_they_appear(live, bridge):
    with peer("talk", "/from_outside") as talker:
        assert talker.next() == "ready"
        seen = live.collect("/from_outside", STRING)

        def arrives():
            talker.send_line(UNICODE)
            return seen

        assert wait_until(arrives)
        assert seen[0].data.endswith(UNICODE)
    assert "/from_outside" in {t for s in live.gateway.sessions() for t in s.publishes}


@pytest.mark.usefixtures("trigger")
def test_services_of_the_graph(live, registered):
    bool_response = message_type("std_srvs/srv/SetBool_Response")
    live.graph.create_service(
        "/set", "std_srvs/srv/SetBool", lambda q: bool_response(q.data, f"{q.data}")
    )

    def broken(_request):
        raise GraphError("out of order")

    live.graph.create_service("/broken", TRIGGER, broken)
    registered("/broken", "lookupService")
    assert "success: True" in tool("rosservice", "call", "/trigger")
    assert "std_srvs/Trigger" in tool("rosservice", "type", "/trigger")
    assert 'message: "True"' in tool("rosservice", "call", "/set", "data: true")
    assert "out of order" in tool("rosservice", "call", "/broken")
    with peer("call", "/trigger") as caller:
        assert caller.next() == [True, f"done, {UNICODE}"]
    with peer("call", "/trigger", "--altered") as caller:
        assert "md5sums do not match" in caller.next()
    live.graph.destroy_service("/broken")
    assert wait_until(lambda: "/broken" not in tool("rosservice", "list"))


@pytest.fixture(scope="module")
def own_types(tmp_path_factory):
    """Environment in which ROS 1 knows the types that come with Volery, made without catkin."""
    folder = tmp_path_factory.mktemp("ros1_packages")
    for name in ("volery_interfaces", "mavros_msgs", "simulation_interfaces", "octomap_msgs"):
        write_package(name, folder, ros1=True)
    paths = dict(
        line.removeprefix("export ").split("=", 1)
        for line in tool(SYSTEM_PYTHON, str(write_generator(folder))).splitlines()
    )
    return {name: path.replace(":$PYTHONPATH", "") for name, path in paths.items()}


def test_rostopic_and_rosservice_know_our_own_types(live, registered, own_types):
    request, response = (message_type(f"{GO_TO}_{part}") for part in ("Request", "Response"))
    asked = []

    def go_to(request):
        asked.append(request)
        return response(True, "on the way")

    live.graph.create_service("/uav1/go_to", GO_TO, go_to)
    state = zero_message(FLIGHT_STATE)
    state.mode, state.battery_charge = "HOLD", 0.5
    live.publisher("/uav1/flight_state", FLIGHT_STATE, latched=True)(state)
    registered("/uav1/flight_state")
    registered("/uav1/go_to", "lookupService")
    output = tool("rostopic", "echo", "-n1", "/uav1/flight_state", **own_types)
    assert 'mode: "HOLD"' in output
    assert "battery_charge: 0.5" in output
    wanted = "{position: {x: 1.0, y: -2.0, z: 3.0}, yaw: 0.5}"
    assert "on the way" in tool("rosservice", "call", "/uav1/go_to", wanted, **own_types)
    assert asked == [request(Point(1.0, -2.0, 3.0), 0.5, False)]


def test_packages_for_ros1_have_the_sums_of_the_bridge(own_types):
    """All of them: ROS 1 refuses connections of other sums."""
    names = [
        file.base
        for package in ("volery_interfaces", "mavros_msgs", "simulation_interfaces")
        for file in find_definition_files(DEFINITIONS / package)
        if file.kind != "action"
    ]
    asked = [
        f"{name.partition('/')[0]}.{name.split('/')[1]}:{name.split('/')[2]}" for name in names
    ]
    program = (
        "import importlib, sys\n"
        "for text in sys.argv[1:]:\n"
        "    module, name = text.split(':')\n"
        "    print(getattr(importlib.import_module(module), name)._md5sum)\n"
    )
    sums = tool(SYSTEM_PYTHON, "-c", program, *asked, **own_types).split()
    assert dict(zip(names, sums, strict=True)) == {name: ros1_codec().md5(name) for name in names}


def test_services_of_ros1_for_the_graph(live, bridge):
    def call():
        come, got = threading.Event(), []
        reply = ServiceReply(got.append, got.append)
        reply.when_done(come.set)
        live.do(lambda: live.graph.call_async("/remote", None, reply))
        assert come.wait(60.0)
        wait_until(lambda: got)
        return got[0]

    assert isinstance(call(), GraphError)
    with peer("serve", "/remote") as server:
        assert server.next() == "ready"
        assert call().message == "from rospy, übrigens"


def test_a_bag_is_recorded(live, registered, tmp_path):
    scans = live.publisher("/uav1/recorded", HEADER)
    kept = live.publisher("/map_recorded", "octomap_msgs/msg/Octomap", latched=True)
    octomap = message_type("octomap_msgs/msg/Octomap")
    tree = np.arange(-50, 50, dtype=np.int8)
    kept(octomap(Header(Time(3, 4), "map"), True, "OcTree", 0.25, tree))
    registered("/uav1/recorded")
    registered("/map_recorded")
    bag = tmp_path / "flight.bag"
    done = []
    topics = ("/uav1/recorded", "/map_recorded")
    command = ("rosbag", "record", "-O", str(bag), "--limit=5", *topics)  # of each topic
    recording = threading.Thread(target=lambda: done.append(tool(*command)))
    recording.start()
    assert wait_until(lambda: all(map(readers, topics)) and wanted(live, "/uav1/recorded"))
    for k in range(5):
        scans(Header(Time(k, 0), "laser"))
        if k:  # the first one was latched
            kept(octomap(Header(Time(9, 9), "map"), True, "OcTree", 0.25, tree))
    recording.join()
    with AnyReader([bag]) as reader:
        read = [(c.topic, reader.deserialize(d, c.msgtype)) for c, _, d in reader.messages()]
    headers = [message for topic, message in read if topic == "/uav1/recorded"]
    assert [message.stamp.sec for message in headers] == [0, 1, 2, 3, 4]
    map_read, *later = [message for topic, message in read if topic == "/map_recorded"]
    assert map_read.header.stamp.sec == 3
    assert len(later) == 4
    np.testing.assert_array_equal(map_read.data, tree)


def test_one_node_a_process(bridge):
    with pytest.raises(BridgeError, match="one node per process"):
        join_ros1("another")


@pytest.mark.usefixtures("trigger")
def test_a_program_of_ours(live, registered):
    live.publisher("/latched", STRING, latched=True)(String("third"))
    live.graph.create_service("/trigger_ours", TRIGGER, lambda _: Triggered(True, "yes"))
    seen = live.collect("/from_program", STRING)
    headers = live.collect("/headers_in", HEADER)
    registered("/latched")
    del headers
    registered("/trigger", "lookupService")
    with ours("client_program.py") as program:
        text, received = program.next()
        assert text in {"new", "second", "third"}
        assert received >= 1
        assert program.next() == "topic '/headers_in' carries std_msgs/msg/Header"
        assert program.next() == f"done, {UNICODE}"
        assert "has no server" in program.next()
        assert program.next() == "offered"
        assert wait_until(lambda: [m.data for m in seen] == ["published"])
        assert "answered" in tool("rosservice", "call", "/program")
        program.send_line("end")
        assert program.next() == []


def test_a_node_with_the_hostname_localhost_receives(live, registered):
    """rosgraph then looks up the addresses of this machine, with a package that may be missing."""
    publish = live.publisher("/to_localhost", STRING, latched=True)
    publish(String("heard"))
    registered("/to_localhost")
    with ours("localhost_program.py", ROS_HOSTNAME="localhost") as program:
        assert program.next() == "heard"


@pytest.mark.usefixtures("trigger")
def test_a_restarted_master_gets_all_registrations(live, master, registered, caplog):
    publish = live.publisher("/lasting", STRING)
    registered("/lasting")
    registered("/trigger", "lookupService")
    master.stop()
    live.publisher("/appeared_meanwhile", STRING)
    assert wait_until(lambda: "ROS master" in caplog.text)  # the bridge has missed it
    master.start()
    registered("/lasting")
    registered("/appeared_meanwhile")
    registered("/trigger", "lookupService")
    with peer("listen", "/lasting") as listener:
        assert listener.next() == "ready"
        assert wait_until(lambda: readers("/lasting") and wanted(live, "/lasting"))
        publish(String("still here"))
        assert listener.next()[0] == "still here"
    assert wait_until(lambda: "/use_sim_time" in tool("rosparam", "list"))


def test_no_master_is_a_clear_refusal(tmp_path):
    program = (
        "from volery.bridges.ros1.node import join_ros1\n"
        "from volery.core.errors import BridgeError\n"
        "try: join_ros1('late', master_uri='http://127.0.0.1:9')\n"
        "except BridgeError as error: print(error)\n"
        "try: join_ros1('late', master_uri='nonsense')\n"
        "except BridgeError as error: print(error)\n"
        "try: join_ros1('late', master_uri='http://127.0.0.1:9', host='10.0.0.1')\n"
        "except BridgeError as error: print(error)\n"
    )
    output = tool(sys.executable, "-c", program)
    assert "no ROS master answers at http://127.0.0.1:9" in output
    assert "'nonsense' is not the address of a ROS master" in output
    assert "allow that with" in output


def test_numpy_stays_the_environments_own():
    load_rospy()
    assert "dist-packages" not in np.__file__
