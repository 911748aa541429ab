"""ROS 2 over zenoh: what rmw_zenoh's design document states, and two participants of ours.

No rmw_zenoh can be built here, so that nothing of this was seen by a real one.
"""

from __future__ import annotations

import json
import queue
import struct
import threading
import time

import pytest
import zenoh
from held_ports import held_port
from live_graph import LiveGraph
from ros2_bench import DOMAIN, Other
from ros_tcp_client import until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.environment import Ros2Environment
from volery.bridges.ros2.middleware import Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.zenoh import session as zenoh_session
from volery.bridges.ros2.zenoh.names import (
    CLIENT,
    PUBLISHER,
    SUBSCRIPTION,
    Attachment,
    node_token,
    qos_words,
    read_token,
    service_key,
    service_token,
    topic_key,
    topic_token,
)
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import String, add_definitions, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Triggered = message_type(f"{TRIGGER}_Response")
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TALKER = NodeName("/", "talker")

# ------------------------------------------------------------- the examples of the design document


def test_keys_are_those_of_the_document(tmp_path):
    assert topic_key(0, "/chatter", STRING) == f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"
    key = f"0/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert topic_key(0, "/robot1/chatter", STRING) == key
    folder = tmp_path / "example_interfaces" / "srv"
    folder.mkdir(parents=True)
    (folder / "AddTwoInts.srv").write_text("int64 a\nint64 b\n---\nint64 sum\n")
    add_definitions(tmp_path)
    assert service_key(2, "/add_two_ints", "example_interfaces/srv/AddTwoInts") == (
        "2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/"
        "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
    )


def test_tokens_are_those_of_the_document():
    zid = "aac3178e146ba6f1fc6e6a4085e77f21"
    listener = NodeName("/", "listener")
    assert node_token(2, zid, 0, listener) == f"@ros2_lv/2/{zid}/0/0/NN/%/%/listener"
    spec = TopicSpec(listener, "/chatter", STRING)
    token = topic_token(2, zid, (0, 10), SUBSCRIPTION, spec)
    front = f"@ros2_lv/2/{zid}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{HASH}/"
    assert token == f"{front}1:2:1,10:,:,:,,"  # the document leaves defaults out: ::,10:,:,:,,
    inside = TopicSpec(NodeName("/uav1", "gap"), "/uav1/scan", STRING, Profile(False, True, 5))
    token = topic_token(7, zid, (3, 4), PUBLISHER, inside)
    assert token.startswith(f"@ros2_lv/7/{zid}/3/4/MP/%/%uav1/gap/%uav1%scan/")
    assert token.endswith("/2:1:1,5:,:,:,,")
    ask = ServiceSpec(NodeName("/", "client"), "/land", TRIGGER)
    assert "/SC/%/%/client/%land/std_srvs::srv::dds_::Trigger_/RIHS01_" in service_token(
        2, zid, (0, 1), CLIENT, ask
    )


def test_tokens_are_read_with_defaults_left_out():
    front = "@ros2_lv/2/8b20/0/10/MP/%/%a%b/talker/%chatter/std_msgs::msg::dds_::String_"
    found = read_token(f"{front}/{HASH}/::,7:,:,:,,")
    assert found.node == ("/a/b", "talker")
    assert (found.name, found.msgtype, found.type_hash) == ("/chatter", STRING, HASH)
    assert found.profile == Profile(depth=7)
    assert not read_token(f"{front}/{HASH}/2:1:1,5:,:,:,,").profile.reliable
    assert read_token(f"{front}/{HASH}/2:1:1,5:,:,:,,").profile.latched


@pytest.mark.parametrize(
    "token",
    [
        "",
        "@ros2_lv",
        "@ros2_lv/0/a/0/0/NN/%/%/n",
        "@ros2_lv/" + "/".join("abcdefghijkl"),
        "x" * 999,
    ],
)
def test_tokens_of_no_entity_are_passed_over(token):
    assert read_token(token) is None


def test_attachments_have_33_bytes():
    gid = bytes(range(16))
    data = Attachment(5, 1_700_000_000_000_000_000, gid).encode()
    assert data == struct.pack("<qq", 5, 1_700_000_000_000_000_000) + b"\x10" + gid
    assert Attachment.decode(data) == (5, 1_700_000_000_000_000_000, gid)
    assert Attachment.decode(data[:-1]) is None
    assert Attachment.decode(data[:16] + b"\x0f" + gid) is None
    assert qos_words(Profile()) == "1:2:1,10:,:,:,,"


# ---------------------------------------------------------------------------------- two at a router


@pytest.fixture(scope="module")
def router():
    """A router of the tests' own."""
    with held_port() as port:
        address = f"127.0.0.1:{port}"
        config = zenoh.Config()
        for key, value in {
            "mode": "router",
            "listen/endpoints": [f"tcp/{address}"],
            "scouting/multicast/enabled": False,
        }.items():
            config.insert_json5(key, json.dumps(value))
        session = zenoh.open(config)
        yield address
        session.close()


@pytest.fixture(scope="module")
def world(router):
    live = LiveGraph()
    bridges = BridgeHost(live.gateway)
    bridge = Ros2Bridge(
        Ros2Environment("zenoh", DOMAIN, router=router), remote_services={"/theirs": TRIGGER}
    )
    bridges.open(bridge)
    yield live
    bridges.close()
    live.close()


@pytest.fixture(scope="module")
def other(world, router):
    made = Other(Ros2Environment("zenoh", DOMAIN, router=router))
    yield made
    made.close()


def test_messages_go_in_both_directions(world, other):
    chatter = world.graph.advertise("/chatter", STRING)
    seen = []
    world.do(lambda: world.graph.subscribe("/in", seen.append, STRING))
    received = other.subscribe("/chatter", STRING)
    until(lambda: {t.name: t for t in world.graph.topics()}["/chatter"].subscribers)
    world.do(lambda: chatter.publish(String("out")))
    assert received.get(timeout=60.0).data == "out"
    _, publish = other.speak("/in", STRING)

    def arrives():
        publish(String("in"))
        time.sleep(0.01)
        return seen

    until(arrives)
    assert seen[0].message.data == "in"


def test_what_is_latched_awaits_late_subscribers(world, other):
    latched = world.graph.advertise("/map", STRING, latched=True)
    world.do(lambda: latched.publish(String("kept")))
    until(lambda: any(p.topic == "/map" for p in other.participant.publishers()))
    assert other.subscribe("/map", STRING, Profile(latched=True)).get(timeout=60.0).data == "kept"


def test_services_go_in_both_directions(world, other):
    world.graph.create_service("/ours", TRIGGER, lambda _q: Triggered(True, "ours"))
    assert other.call("/ours", TRIGGER).message == "ours"
    spec = ServiceSpec(other.node, "/theirs", TRIGGER)
    answer = b"\0\1\0\0\1\0\0\0" + struct.pack("<I7s", 7, b"theirs\0")
    server = other.participant.server(spec, lambda _data, reply: reply(answer))
    assert call(world, "/theirs").get(timeout=60.0).message == "theirs"
    server.close()
    called = threading.Event()
    silent = other.participant.server(spec, lambda _data, _reply: called.set())
    asked = call(world, "/theirs")
    assert called.wait(60.0)
    silent.close()
    assert isinstance(asked.get(timeout=60.0), GraphError)


def call(world, service):
    come = queue.Queue()
    world.do(lambda: world.graph.call_async(service, None, ServiceReply(come.put, come.put)))
    return come


def test_a_flood_of_one_publisher_delays_no_other(world, other, router):
    stranger, _ = zenoh_session.open_session(router)
    world.graph.create_service("/calm", TRIGGER, lambda _q: Triggered(True, "calm"))
    flooded, stop = [], threading.Event()
    world.do(lambda: world.graph.subscribe("/flooded", flooded.append, STRING))
    key = topic_key(DOMAIN, "/flooded", STRING)

    def flood():
        while not stop.is_set():
            stranger.put(key, b"\0\1\0\0\2\0\0\0w\0")

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        until(lambda: len(flooded) > 1000)
        for _ in range(7):  # the flood itself never ends: a call that waited for that would fail
            assert other.call("/calm", TRIGGER).message == "calm"
    finally:
        stop.set()
        thread.join()
        stranger.close()
    world.do(lambda: None)  # what waits is bounded, and the graph is soon through with it


def test_strangers_do_no_harm(world, other, router):
    """Queries without attachment, bytes that are no message, another hash."""
    stranger, _ = zenoh_session.open_session(router)
    asked = []
    world.graph.create_service(
        "/asked", TRIGGER, lambda q: asked.append(q) or Triggered(True, "asked")
    )
    until(lambda: "/asked" in other.participant.service_types())
    replies = list(stranger.get(service_key(DOMAIN, "/asked", TRIGGER), payload=b"x", timeout=0.5))
    assert [reply for reply in replies if reply.ok is not None] == []
    seen = []
    world.do(lambda: world.graph.subscribe("/odd", seen.append, STRING))
    key = topic_key(DOMAIN, "/odd", STRING)

    def arrives():
        stranger.put(key, b"\0\1\0\0\2\0\0\0w\0")
        time.sleep(0.01)
        return seen

    until(arrives)
    stranger.put(key, b"no CDR")
    stranger.put(f"{DOMAIN}/odd/std_msgs::msg::dds_::String_/RIHS01_00", b"\0\1\0\0\2\0\0\0x\0")
    stranger.put(key, b"\0\1\0\0\2\0\0\0y\0")
    until(lambda: seen[-1].message.data == "y")
    assert {p.message.data for p in seen} == {"w", "y"}
    stranger.close()
    assert other.call("/asked", TRIGGER).message == "asked"
    assert len(asked) == 1


def test_a_router_that_is_not_there_is_named():
    with held_port() as port, pytest.raises(BridgeError, match=f"127.0.0.1:{port}"):
        zenoh_session.open_session(f"127.0.0.1:{port}")


def test_without_a_router_the_session_becomes_one(monkeypatch):
    with held_port() as port:
        monkeypatch.setattr(zenoh_session, "DEFAULT_ROUTER", f"127.0.0.1:{port}")
        first, where = zenoh_session.open_session("")
        second, there = zenoh_session.open_session("")
        assert "as the router" in where
        assert "as the router" not in there
        until(lambda: list(second.info.routers_zid()))
        second.close()
        first.close()
