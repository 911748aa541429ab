"""What plain DDS programs do to the ROS 2 bridge that stand still, vanish or talk nonsense."""

from __future__ import annotations

import base64
import itertools
import queue
import random
import socket

import numpy as np
import pytest
from live_graph import LiveGraph
from plain_peers import take_peer
from ros2_bench import DOMAIN
from ros_tcp_client import until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.environment import Ros2Environment
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.messages import String, header, message_type

STRING = "std_msgs/msg/String"
IMAGE = "sensor_msgs/msg/Image"
SIZE = 1_000_000
COUNT = 30
_numbers = itertools.count()


class World(LiveGraph):
    """A graph with a bridge, and a plain peer that proves that all goes on."""

    def __init__(self):
        super().__init__()
        self.received, self.seen = queue.Queue(), []
        self.chatter = self.graph.advertise("/chatter", STRING)
        self.images = self.graph.advertise("/pictures", IMAGE)
        self.atlas = self.graph.advertise("/atlas", IMAGE, latched=True)
        self.do(lambda: self.graph.subscribe("/in", self.note, STRING))
        self.bridges = BridgeHost(self.gateway)
        self.bridges.open(Ros2Bridge(Ros2Environment(domain_id=DOMAIN), reliable=("/pictures",)))
        self.witness = take_peer(self.received.put)
        self.subscribe(self.witness, "/chatter", STRING)
        assert self.witness.do("advertise", topic="/in", type=STRING, latched=False, wait=True)

    def note(self, published):
        self.seen.append(published.message.data)

    def subscribe(self, peer, topic, msgtype, *, latched=False):
        """Have a peer subscribe reliably, and wait for the bridge to know."""
        found = {t.name: t for t in self.graph.topics()}[topic]
        peer.do("subscribe", topic=topic, type=msgtype, reliable=True, latched=latched)
        until(lambda: self.has_subscribers(topic))
        assert found.msgtype == msgtype

    def has_subscribers(self, topic):
        return {t.name: t for t in self.graph.topics()}[topic].subscribers > 0

    def goes_on(self):
        """Send a word in each direction, and wait until both are there."""
        word = f"word {next(_numbers)};"
        self.do(lambda: self.chatter.publish(String(word)))
        publish(self.witness, "/in", encode_cdr(String(word), STRING))
        while True:
            data = base64.b64decode(self.received.get(timeout=60.0)["data"])
            if word.encode() in data:
                break
        until(lambda: word in self.seen)
        return True

    def close(self):
        self.witness.give_back()
        self.bridges.close()
        super().close()


def publish(peer, topic, cdr):
    return peer.do("publish", topic=topic, data=base64.b64encode(cdr).decode())


def image(number):
    pixels = np.full(SIZE, number, np.uint8)
    return message_type(IMAGE)(header(number, ""), 1, SIZE, "mono8", 0, SIZE, pixels)


@pytest.fixture(scope="module")
def world():
    made = World()
    yield made
    made.close()


@pytest.fixture
def peer():
    taken = take_peer(patient=True)
    yield taken
    taken.give_back()


@pytest.mark.parametrize("latched", [False, True])
def test_large_reliable_messages_do_not_wait_for_a_stalled_reader(world, peer, latched):
    topic = "/atlas" if latched else "/pictures"
    sizes = queue.Queue()
    peer.on_message = lambda report: sizes.put(report["size"])
    world.subscribe(peer, topic, IMAGE, latched=latched)
    publisher = world.atlas if latched else world.images
    world.do(lambda: publisher.publish(image(0)))
    assert sizes.get(timeout=60.0) >= SIZE
    world.goes_on()
    peer.stop()
    for number in range(COUNT):
        world.do(lambda n=number: publisher.publish(image(n)))
    assert world.goes_on()
    assert world.has_subscribers(topic)  # an engine that waits does so until it is taken for gone
    peer.go_on()
    assert sizes.get(timeout=60.0) >= SIZE  # it still receives, of what was queued


@pytest.mark.parametrize("kind", [b"\0\3", b"\0\7", b"\0\x7f", b"\1\2"])
def test_encodings_that_ros2_has_not_do_no_harm(world, peer, kind):
    """Parameter lists, XCDR2, and what there is not at all."""
    assert peer.do("advertise", topic="/in", type=STRING, latched=False, wait=True)
    before = len(world.seen)
    publish(peer, "/in", kind + b"\0\0\4\0\0\0abc\0")
    assert world.goes_on()
    assert "abc" not in world.seen[before:]


@pytest.mark.parametrize(
    ("type_name", "said"),
    [
        ("geometry_msgs.msg.dds_.Twist_", "a publisher of geometry_msgs/msg/Twist is ignored"),
        ("no_pkg.msg.dds_.Nothing_", "a publisher of no_pkg/msg/Nothing is ignored"),
        ("std_msgs.msg.dds_.String_", f"another definition of {STRING} (RIHS01_1234)"),
    ],
)
def test_publishers_of_something_else_are_warned_of_once(world, peer, caplog, type_name, said):
    odd = {"type_name": type_name, "user_data": "typehash=RIHS01_1234;"}
    peer.do("advertise_oddly", dds_topic="rt/in", **odd)
    until(lambda: said in caplog.text)
    for number in range(20):
        publish(peer, "rt/in", b"\0\1\0\0" + bytes([number]) * 20)
    assert world.goes_on()
    assert caplog.text.count(said) == 1


@pytest.mark.parametrize(
    ("dds_topic", "type_name"),
    [
        ("rt", "std_msgs.msg.dds_.String_"),
        ("rt/", "std_msgs.msg.dds_.String_"),
        ("rt//in", "std_msgs.msg.dds_.String_"),
        ("rt/1/uav-1", "std_msgs.msg.dds_.String_"),
        ("rt/" + "x" * 3000, "std_msgs.msg.dds_.String_"),
        ("rq/Request", "std_srvs.srv.dds_.Trigger_Request_"),
        ("rr/x", "std_srvs.srv.dds_.Trigger_Response_"),
        ("ros_discovery_info", "rmw_dds_common.msg.dds_.ParticipantEntitiesInfo_"),
        ("rt/in", "HelloWorld"),
        ("rt/in", "a.b.c.d.e"),
    ],
)
def test_names_that_ros2_has_not_are_passed_over(world, peer, dds_topic, type_name):
    peer.do("advertise_oddly", dds_topic=dds_topic, type_name=type_name, user_data="typehash=;\0")
    publish(peer, dds_topic, b"\0\1\0\0" + bytes(20))
    assert world.goes_on()


def test_noise_on_its_ports_does_no_harm(world):
    noise = random.Random(9)
    first = 7400 + 250 * DOMAIN
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for _ in range(300):
            body = noise.randbytes(noise.randrange(200))
            begin = noise.choice([b"", b"RTPS", b"RTPS\2\5\1\x10" + noise.randbytes(12)])
            sock.sendto(begin + body, ("127.0.0.1", first + 10 + noise.randrange(8)))
    assert world.goes_on()


def test_a_subscriber_that_vanishes_amid_large_messages_delays_no_other(world):
    peer = take_peer()
    world.subscribe(peer, "/pictures", IMAGE)
    for number in range(5):
        world.do(lambda n=number: world.images.publish(image(n)))
    peer.kill()
    for number in range(5):
        world.do(lambda n=number: world.images.publish(image(n)))
    assert world.goes_on()
    until(lambda: not world.has_subscribers("/pictures"))
    assert world.goes_on()
