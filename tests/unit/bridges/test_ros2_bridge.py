"""The ROS 2 bridge seen by another participant: nodes, parameters, actions, and what goes wrong."""

from __future__ import annotations

import os
import socket
import struct
import time

import numpy as np
import pytest
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from live_graph import NOW_NS, LiveGraph
from ros2_bench import DOMAIN, Other
from ros_tcp_client import until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.client import Ros2Client
from volery.bridges.ros2.dds import library
from volery.bridges.ros2.dds.discovery_info import TYPE as RECORD
from volery.bridges.ros2.dds.discovery_info import record_message
from volery.bridges.ros2.dds.idl_types import message_struct, request_struct
from volery.bridges.ros2.dds.qos import qos_of
from volery.bridges.ros2.dds.service_peers import why_foreign
from volery.bridges.ros2.environment import Ros2Environment, join_ros2
from volery.bridges.ros2.middleware import Profile, ServiceSpec
from volery.bridges.ros2.names import NodeName
from volery.bridges.rosbridge.rosapi_bridge import RosApiBridge
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.zero import zero_message
from volery.graph.connection import call_and_wait
from volery.graph.messages import (
    Clock,
    LaserScan,
    String,
    Twist,
    header,
    message_type,
    time_from_ns,
)
from volery.graph.parameter_values import parameter_message, plain_of
from volery.graph.parameters import Parameter
from volery.graph.typestore import typestore

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
TWIST = "geometry_msgs/msg/Twist"
STEPS = "simulation_interfaces/action/SimulateSteps"
NODE = "/uav1/gap_following"


class World(LiveGraph):
    """A graph with all that a simulation has, and a bridge."""

    def __init__(self):
        super().__init__()
        self.goals, self.commands = [], []
        self.chatter = self.graph.advertise("/chatter", STRING)
        self.graph.advertise("/größe", STRING)
        self.graph.parameters.declare(NODE, Parameter("height_m", 3.0, like=3.0, read_only=False))
        self.graph.parameters.declare(NODE, Parameter("name", "x", like="x"))
        self.graph.parameters.enter("/uav1/quiet")
        self.graph.actions.create_server("/simulate_steps", STEPS, self.goals.append)
        self.graph.create_service("/broken", TRIGGER, self.break_down)
        self.do(lambda: self.graph.subscribe("/uav1/cmd_vel", self.commands.append, Twist))
        self.bridges = BridgeHost(self.gateway)
        self.bridge = Ros2Bridge(Ros2Environment(domain_id=DOMAIN))
        self.bridges.open(RosApiBridge(self.bridge))

    def break_down(self, _request):
        raise GraphError("no such luck")

    def close(self):
        self.bridges.close()
        super().close()


@pytest.fixture(scope="module")
def world():
    made = World()
    yield made
    made.close()


@pytest.fixture(scope="module")
def other(world):
    made = Other()
    yield made
    made.close()


def test_nodes_and_their_endpoints_are_published(world, other):
    """As rmw_dds_common publishes them: a latched record a participant."""
    records = []
    inner = other.participant._participant
    reader = DataReader(
        inner,
        Topic(inner, "ros_discovery_info", message_struct(RECORD)),
        qos=qos_of(Profile(latched=True, depth=100)),
    )

    def names():
        records.extend(
            decode_cdr(s.cdr, RECORD) for s in reader.take(10) if s.sample_info.valid_data
        )
        found = {}
        for record in records:
            for entry in record.node_entities_info_seq:
                found[entry.node_namespace, entry.node_name] = entry
        return found

    until(lambda: {("/", "volery"), ("/uav1", "gap_following"), ("/uav1", "quiet")} <= set(names()))
    volery = names()["/", "volery"]
    assert len({gid.data.tobytes() for gid in volery.writer_gid_seq}) > 5
    node = names()["/uav1", "gap_following"]
    assert len(node.reader_gid_seq) == len(node.writer_gid_seq) == 6  # services of parameters


def test_a_record_has_the_bytes_of_rmw():
    nodes = {NodeName("/uav1", "a"): ([bytes(range(16))], [])}
    data = encode_cdr(record_message(b"\7" * 16, nodes), RECORD)
    text = struct.pack("<I6s2xI2s2x", 6, b"/uav1\0", 2, b"a\0")
    assert data == (
        b"\0\1\0\0" + b"\7" * 16 + struct.pack("<I", 1) + text
        + struct.pack("<I", 1) + bytes(range(16)) + struct.pack("<I", 0)
    )  # fmt: skip


def test_messages_are_encoded_only_for_subscribers(world, other):
    topic = {t.name: t for t in world.graph.topics()}["/chatter"]
    assert topic.subscribers == 0
    received = other.subscribe("/chatter", STRING)
    until(lambda: {t.name: t for t in world.graph.topics()}["/chatter"].subscribers)
    world.do(lambda: world.chatter.publish(String("hello")))
    assert received.get(timeout=60.0).data == "hello"


def test_bytes_are_made_once_for_all_bridges(world, other, monkeypatch):
    second = Ros2Bridge(Ros2Environment(domain_id=DOMAIN + 1), "/twin")
    bridges = BridgeHost(world.gateway)
    bridges.open(second)
    there = Other(Ros2Environment(domain_id=DOMAIN + 1))
    try:
        image = world.graph.advertise("/once", STRING)
        received = [one.subscribe("/once", STRING) for one in (other, there)]
        until(lambda: {t.name: t for t in world.graph.topics()}["/once"].subscribers == 2)
        store, made = typestore(), []
        original = store.serialize_cdr
        monkeypatch.setattr(store, "serialize_cdr", lambda *a: made.append(a) or original(*a))
        world.do(lambda: image.publish(String("once")))
        assert [h.get(timeout=60.0).data for h in received] == ["once", "once"]
        assert len([1 for message, _ in made if getattr(message, "data", "") == "once"]) == 1
    finally:
        there.close()
        bridges.close()


def test_messages_of_best_effort_publishers_are_received_too(world, other):
    writer, publish = other.speak(
        "/uav1/cmd_vel", "geometry_msgs/msg/Twist", Profile(reliable=False)
    )
    twist = zero_message("geometry_msgs/msg/Twist")
    before = len(world.commands)

    def arrives():
        publish(twist)
        time.sleep(0.02)
        return len(world.commands) > before

    until(arrives)
    writer.close()


def test_foreign_types_and_other_definitions_are_warned_of(world, other, caplog):
    wrong, _ = other.speak("/uav1/cmd_vel", STRING)
    until(lambda: "publisher of std_msgs/msg/String is ignored" in caplog.text)
    wrong.close()
    topics = world.bridge._shared.topics
    fake = next(p for p in other.participant.publishers() if p.topic == "/chatter")
    topic = {t.name: t for t in world.graph.topics()}["/chatter"]
    topics._look_at(topic, [fake._replace(type_hash="RIHS01_00")])
    assert "another definition of std_msgs/msg/String (RIHS01_00)" in caplog.text
    assert caplog.text.count("RIHS01_00") == 1
    topics._look_at(topic, [fake._replace(type_hash="RIHS01_00"), fake])
    assert caplog.text.count("RIHS01_00") == 1


def test_names_that_ros2_does_not_allow_stay_inside(world, other):
    until(lambda: any(p.topic == "/chatter" for p in other.participant.publishers()))
    assert not any("gr" in p.topic for p in other.participant.publishers())


def test_messages_of_other_domains_are_not_received(world):
    """Not by the time at which a later message in its own domain is received."""
    elsewhere = Ros2Environment(domain_id=DOMAIN + 2)
    stranger, friend_there, friend = Other(elsewhere), Other(elsewhere), Other()
    _, publish = stranger.speak("/uav1/cmd_vel", TWIST)
    received_there = friend_there.subscribe("/uav1/cmd_vel", TWIST)
    _, publish_here = friend.speak("/uav1/cmd_vel", TWIST)
    theirs, ours = zero_message(TWIST), zero_message(TWIST)
    theirs.linear.x, ours.linear.x = 2.5, 3.5

    def both_arrive():
        publish(theirs)
        publish_here(ours)
        time.sleep(0.01)
        return received_there.qsize() and any(c.message.linear.x == 3.5 for c in world.commands)

    until(both_arrive)
    assert not any(c.message.linear.x == 2.5 for c in world.commands)
    assert [p.topic for p in friend_there.participant.publishers()] == ["/uav1/cmd_vel"]
    for one in (stranger, friend_there, friend):
        one.close()


def test_one_domain_has_one_configuration_in_a_process(world):
    with pytest.raises(BridgeError, match="other interfaces"):
        join_ros2(Ros2Environment(domain_id=DOMAIN, interfaces=("eth0",)))


def test_sockets_receive_from_this_machine_alone(world):
    # Otherwise Python makes every socket non-blocking that it wraps, for its owner as well.
    default = socket.getdefaulttimeout()
    socket.setdefaulttimeout(None)
    try:
        assert _confined() >= 2
    finally:
        socket.setdefaulttimeout(default)


def _confined():
    """Sockets of the domain, each bound to loopback."""
    found = 0
    for name in os.listdir("/proc/self/fd"):
        try:
            sock = socket.socket(fileno=os.dup(int(name)))
        except OSError:
            continue  # no socket, or one that has closed
        with sock:
            port = sock.getsockname()[1] if sock.type == socket.SOCK_DGRAM else 0
            if 0 <= port - 7400 - 250 * DOMAIN < 250:
                device = sock.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
                assert device.rstrip(b"\0") == b"lo"
                found += 1
    return found


def test_unknown_interfaces_are_an_error():
    with pytest.raises(
        BridgeError, match="unknown network interface 'no_such_interface'; known are "
    ):
        join_ros2(Ros2Environment(domain_id=DOMAIN + 3, interfaces=("no_such_interface",)))


def test_failures_are_reported_in_responses_with_a_message(world, other):
    answer = other.call("/broken", TRIGGER)
    assert not answer.success
    assert answer.message


def test_rosapi_is_not_shown(world, other):
    until(lambda: "/broken" in other.participant.service_types())
    assert not any(name.startswith("/rosapi") for name in other.participant.service_types())


# ------------------------------------------------------------------------------------- parameters


def parameters(other, base, node=NODE, **fields):
    word = "".join(f"_{c.lower()}" if c.isupper() else c for c in base).strip("_")
    return other.call(f"{node}/{word}", f"rcl_interfaces/srv/{base}", **fields)


def test_parameters_are_listed_described_and_read(world, other):
    names = parameters(other, "ListParameters").result.names
    assert names == ["height_m", "name", "use_sim_time"]
    values = parameters(other, "GetParameters", names=["height_m", "use_sim_time", "none"]).values
    assert [plain_of(value) for value in values] == [3.0, True, None]
    assert parameters(other, "GetParameterTypes", names=["name", "none"]).types.tolist() == [4, 0]
    found = parameters(other, "DescribeParameters", names=["height_m", "name"]).descriptors
    assert [(d.name, d.type, d.read_only) for d in found] == [
        ("height_m", 3, False),
        ("name", 4, True),
    ]
    assert parameters(other, "ListParameters", node="/volery").result.names == ["use_sim_time"]


def test_parameters_are_set_and_an_event_is_published(world, other):
    events = other.subscribe("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
    until(lambda: any(p.topic == "/parameter_events" for p in other.participant.publishers()))
    wanted = [parameter_message("height_m", 4.5), parameter_message("name", "y")]

    def is_published():
        results = parameters(other, "SetParameters", parameters=wanted).results
        assert [r.successful for r in results] == [True, False]
        assert "read-only" in results[1].reason
        return events.qsize()

    until(is_published)
    assert world.graph.parameters.get(NODE, "height_m").value == 4.5
    event = events.get(timeout=60.0)
    assert (event.node, event.changed_parameters[0].name) == (NODE, "height_m")


@pytest.mark.parametrize("node", [NODE, "/volery", "/uav1/quiet"])
@pytest.mark.parametrize("base", ["SetParameters", "SetParametersAtomically"])
def test_simulated_time_is_what_launch_files_may_ask_for_and_nothing_else(world, other, base, node):
    for value in (True, False):
        wanted = [parameter_message("use_sim_time", value)]
        response = parameters(other, base, node=node, parameters=wanted)
        (result,) = getattr(response, "results", None) or [response.result]
        assert result.successful is value
        assert ("read-only" in result.reason) is not value


def test_parameters_are_set_all_or_none(world, other):
    before = world.graph.parameters.get(NODE, "height_m").value
    wanted = [parameter_message("height_m", 9.0), parameter_message("name", "y")]
    result = parameters(other, "SetParametersAtomically", parameters=wanted).result
    assert not result.successful
    assert "name" in result.reason
    assert world.graph.parameters.get(NODE, "height_m").value == before
    wanted = [parameter_message("height_m", 6.0)]
    assert parameters(other, "SetParametersAtomically", parameters=wanted).result.successful
    assert world.graph.parameters.get(NODE, "height_m").value == 6.0


# ---------------------------------------------------------------------------------------- actions


def uuid(number):
    message = zero_message("unique_identifier_msgs/msg/UUID")
    message.uuid = np.full(16, number, np.uint8)
    return message


def send_goal(world, other, number):
    goal = zero_message(f"{STEPS}_Goal")
    goal.steps = 10
    response = other.call(
        "/simulate_steps/_action/send_goal", f"{STEPS}_SendGoal", goal_id=uuid(number), goal=goal
    )
    return response, world.goals[-1]


def result_of(other, number):
    return other.call(
        "/simulate_steps/_action/get_result", f"{STEPS}_GetResult", goal_id=uuid(number)
    )


def test_an_action_gives_feedback_and_a_result(world, other):
    feedback = other.subscribe("/simulate_steps/_action/feedback", f"{STEPS}_FeedbackMessage")
    status = other.subscribe(
        "/simulate_steps/_action/status",
        "action_msgs/msg/GoalStatusArray",
        Profile(latched=True, depth=1),
    )
    response, goal = send_goal(world, other, 1)
    assert response.accepted
    assert response.stamp == time_from_ns(NOW_NS)
    assert goal.request.steps == 10
    progress = zero_message(f"{STEPS}_Feedback")
    progress.completed_steps = 4
    until(lambda: any("feedback" in p.topic for p in other.participant.publishers()))
    world.do(lambda: goal.feedback(progress))
    message = feedback.get(timeout=60.0)
    assert message.feedback.completed_steps == 4
    assert message.goal_id.uuid.tolist() == [1] * 16
    world.do(lambda: goal.succeed(zero_message(f"{STEPS}_Result")))
    assert result_of(other, 1).status == 4
    until(lambda: [s.status for s in status.get(timeout=60.0).status_list][-1:] == [4])


def test_a_goal_is_cancelled(world, other):
    _, goal = send_goal(world, other, 2)
    goal.when_cancelled(lambda: goal.canceled(zero_message(f"{STEPS}_Result")))
    info = zero_message("action_msgs/msg/GoalInfo")
    info.goal_id = uuid(2)
    cancel = "/simulate_steps/_action/cancel_goal", "action_msgs/srv/CancelGoal"
    response = other.call(*cancel, goal_info=info)
    assert (response.return_code, len(response.goals_canceling)) == (0, 1)
    assert result_of(other, 2).status == 5
    assert other.call(*cancel, goal_info=info).return_code == 3  # it has ended
    info.goal_id = uuid(9)
    assert other.call(*cancel, goal_info=info).return_code == 2  # unknown


def test_a_goal_of_an_id_that_is_taken_is_refused(world, other):
    response, goal = send_goal(world, other, 3)
    assert response.accepted
    again, same = send_goal(world, other, 3)
    assert not again.accepted
    assert same is goal
    world.do(lambda: goal.abort(zero_message(f"{STEPS}_Result")))
    assert result_of(other, 3).status == 6
    assert result_of(other, 77).status == 0


def test_scans_go_out_best_effort_and_the_clock_reliably(world, other):
    world.graph.advertise("/uav1/scan", LaserScan)
    world.graph.advertise("/clock", Clock)
    world.graph.advertise("/map", STRING, latched=True)

    def profiles():
        return {p.topic: p.profile for p in other.participant.publishers()}

    until(lambda: {"/uav1/scan", "/clock", "/map"} <= set(profiles()))
    found = profiles()
    assert not found["/uav1/scan"].reliable
    assert found["/clock"].reliable
    assert found["/map"].latched
    assert not found["/clock"].latched


def test_a_message_that_does_not_fit_is_left_out_and_the_rest_goes_on(world, other, caplog):
    odd = world.graph.advertise("/odd", "std_msgs/msg/Header")
    received = other.subscribe("/odd", "std_msgs/msg/Header")
    until(lambda: {t.name: t for t in world.graph.topics()}["/odd"].subscribers)
    broken = header(1, "x")
    broken.frame_id = 7
    world.do(lambda: odd.publish(broken))
    world.do(lambda: odd.publish(header(2, "fine")))
    assert received.get(timeout=60.0).frame_id == "fine"
    assert "/odd" in caplog.text


def test_a_bridge_without_a_name_of_ros2_does_not_open(world):
    bridges = BridgeHost(world.gateway)
    with pytest.raises(BridgeError, match="does not allow"):
        bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN), "/my-node"))
    bridges.close()


def test_a_client_of_another_type_is_reported(world, other, caplog):
    spec = ServiceSpec(other.node, "/broken", "std_srvs/srv/Empty")
    caller = other.participant.caller(spec)
    until(lambda: "a client of std_srvs/srv/Empty is not answered" in caplog.text)
    caller.close()


def test_a_domain_is_joined_once_as_one_node(world):
    bridges = BridgeHost(world.gateway)
    with pytest.raises(BridgeError, match=rf"domain {DOMAIN} is joined already over dds"):
        bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN)))
    bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN + 4)))
    bridges.close()
    bridges = BridgeHost(world.gateway)
    bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN + 4)))  # free again
    bridges.close()


def test_nothing_is_written_into_the_present_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    participant = join_ros2(Ros2Environment(domain_id=DOMAIN + 4))
    participant.close()
    assert list(tmp_path.iterdir()) == []


def test_everything_is_given_back():
    made = LiveGraph()
    message_type(f"{TRIGGER}_Request")
    bridges = BridgeHost(made.gateway)
    bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN + 4)))
    watcher = Other(Ros2Environment(domain_id=DOMAIN + 4))
    made.graph.advertise("/x", STRING)
    until(watcher.participant.publishers)
    bridges.close()
    until(lambda: not watcher.participant.publishers())
    assert made.gateway.sessions() == []
    watcher.close()
    made.close()


def test_what_is_not_understood_is_named_by_the_vendor_of_its_dds():
    rest = bytes(14)
    assert "uses rmw_fastrtps" in why_foreign("clientid", b"\x01\x0f" + rest)
    assert "fastrtps" not in why_foreign("clientid", b"\x01\x10" + rest)
    assert "RTI Connext DDS and lacks 'serviceid=" in why_foreign("serviceid", b"\x01\x01" + rest)
    assert "a DDS of vendor 01.77" in why_foreign("clientid", b"\x01\x77" + rest)


def test_clients_and_servers_of_another_kind_are_reported_and_not_misread(world, other, caplog):
    """Those without the user data of rmw_cyclonedds, whatever DDS they are of."""
    inner = other.participant._participant
    asked = []
    world.graph.create_service("/strange", TRIGGER, asked.append)
    request, response = (request_struct(f"{TRIGGER}_{part}") for part in ("Request", "Response"))
    quality = qos_of(Profile())  # without the user data of rmw_cyclonedds
    writer = DataWriter(inner, Topic(inner, "rq/strangeRequest", request), qos=quality)
    until(lambda: library.subscriptions(writer))
    until(
        lambda: (
            "/strange: a client is not answered: it is of Cyclone DDS and lacks 'clie"
            in caplog.text
        )
    )
    for _ in range(20):
        library.write(writer, b"\0\1\0\0" + bytes(20))
    caller = other.participant.caller(ServiceSpec(other.node, "/strange", TRIGGER))
    until(lambda: caller.ready)
    caller.call(encode_cdr(zero_message(f"{TRIGGER}_Request"), f"{TRIGGER}_Request"), print, print)
    until(lambda: asked)
    assert len(asked) == 1  # which was put behind the others
    assert caplog.text.count("/strange") == 1
    caller.close()
    library.delete(writer)

    server = DataReader(inner, Topic(inner, "rq/foreignRequest", request), qos=quality)
    answers = DataWriter(inner, Topic(inner, "rr/foreignReply", response), qos=quality)
    link = Ros2Client(Ros2Environment(domain_id=DOMAIN), "/asker")
    with pytest.raises(GraphError, match="its server is of Cyclone DDS and lacks 'serviceid="):
        call_and_wait(link, "/foreign", None, 60.0)
    link.close()
    library.delete(server)
    library.delete(answers)
