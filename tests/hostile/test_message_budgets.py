"""Messages that would take seconds or gigabytes to decode are refused before they are decoded."""

from __future__ import annotations

import contextlib
import json
import struct
import tracemalloc

import cbor2
import numpy as np
import pytest
from filling import filled
from live_graph import HandGraph
from patient_websockets import connect
from ros_tcp_client import frame
from rosbridge_bench import Bench, FakeSimulation
from websockets.exceptions import ConnectionClosed

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.session import EndpointSession
from volery.bridges.ros_tcp.wire import RosTcpFrameParser
from volery.bridges.rosbridge import first_message
from volery.bridges.rosbridge import message_budget as budget
from volery.bridges.rosbridge.cbor_codec import encode_cbor
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.bridges.rosbridge.wire import decode_frame, encode_png
from volery.core.errors import BridgeError, GraphError
from volery.graph import object_count
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.object_count import CDR, MAX_OBJECTS, ROS1, check_objects
from volery.graph.typestore import typestore

MEGABYTE = 2**20
TYPES = ("tf2_msgs/msg/TFMessage", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/JointState")
COUNT = 4_000_000

BOMBS = {
    "cbor numbers": b"\xa1\x62op\x9a" + struct.pack(">I", COUNT) + bytes(COUNT),
    "cbor long numbers": b"\xa1\x62op\x9a" + struct.pack(">I", COUNT // 9) + b"\xfb" * COUNT,
    "cbor without a length": b"\xa1\x62op\x9f" + bytes(COUNT) + b"\xff",
    "cbor lists in lists": b"\xa1\x62op" + b"\x81" * COUNT,
    "cbor empty lists": b"\xa1\x62op\x9a" + struct.pack(">I", 150_000) + b"\x80" * 150_000,
    "cbor empty maps": b"\xa1\x62op\x9f" + b"\xa0" * COUNT + b"\xff",
    "cbor map": b"\xa1\x62op\xba" + struct.pack(">I", 100_000) + b"\x61a\x01" * 100_000,
    "cbor texts": b"\xa1\x62op\x9f" + b"\x60" * COUNT + b"\xff",
    "cbor tags": b"\xa1\x62op\x9f" + b"\xd8\x40\x40" * (COUNT // 3) + b"\xff",
    "json numbers": '{"op":[' + "1," * (COUNT // 2) + "1]}",
    "json lists in lists": '{"op":' + "[" * COUNT,
    "json empty objects": '{"op":[' + "{}," * (COUNT // 3) + "{}]}",
    "json members": '{"op":{' + '"a":1,' * (COUNT // 6) + '"b":1}}',
    "json text": '{"op":"' + "A" * (17 * MEGABYTE) + '"}',
}


def peak_bytes(action):
    """Memory that Python and numpy allocate meanwhile."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("bomb", BOMBS.values(), ids=BOMBS)
def test_bombs_are_refused_before_they_are_decoded(bomb):
    def refuse():
        with pytest.raises(BridgeError, match=r"a message holds more than .*docs/bridges\.md"):
            decode_frame(bomb, limited=True)

    assert peak_bytes(refuse) < len(bomb) + 4 * MEGABYTE


@pytest.mark.parametrize("bomb", ["cbor numbers", "json empty objects"])
def test_a_client_is_warned_and_others_are_served(bomb):
    bench = Bench()
    client = bench.peer()
    client.send_raw(BOMBS[bomb])
    (status,) = client.read()
    assert status["level"] == "error"
    assert "a message holds more than" in status["msg"]


def test_what_is_large_and_cheap_passes():
    pixels = np.zeros(25_000_000, np.uint8)
    image = encode_cbor({"op": "publish", "msg": {"data": pixels}})
    assert len(decode_frame(image, limited=True)["msg"]["data"]) == len(pixels)
    points = encode_cbor({"op": "publish", "msg": {"data": np.zeros(1_000_000)}})
    assert len(decode_frame(points, limited=True)["msg"]["data"]) == 1_000_000
    text = json.dumps({"op": "publish", "msg": {"data": "A" * (12 * MEGABYTE)}})
    assert len(decode_frame(text, limited=True)["msg"]["data"]) == 12 * MEGABYTE
    scan = {"op": "publish", "msg": {"ranges": [0.5] * 100_000, "intensities": [1] * 50_000}}
    for large in (json.dumps(scan), cbor2.dumps(scan)):
        assert decode_frame(large, limited=True) == scan


def test_images_and_fragments_hold_no_more_than_other_messages():
    client = Bench().peer()
    client.send_raw(encode_png(json.dumps({"op": "x", "pad": "A" * budget.MAX_IMAGE_BYTES})))
    (status,) = client.read()
    assert "bytes of pixels" in status["msg"]
    client.send_raw(encode_png('{"op":[' + "[]," * budget.MAX_CONTAINERS + "[]]}"))
    (status,) = client.read()
    assert "objects and lists" in status["msg"]
    bomb = '{"op":[' + "{}," * budget.MAX_CONTAINERS + "{}]}"
    for number, part in enumerate((bomb[:1000], bomb[1000:])):
        client.send("fragment", id="f", data=part, num=number, total=2)
    (status,) = client.read()
    assert "objects and lists" in status["msg"]


# ------------------------------------------------------------------------------ before the token


def test_an_unauthorized_client_may_send_little():
    bench = Bench(token="secret")
    client = bench.peer()
    client.send_raw(json.dumps({"op": "auth", "token": "secret", "pad": "A" * 5000}))
    assert not client.peer.authorized
    assert "more than 4096 bytes" in client.peer.refused


@pytest.fixture
def guarded():
    simulation = FakeSimulation()
    with BridgeHost(simulation.gateway) as bridges:
        server = RosbridgeServer(port=0, token="secret")
        bridges.open(server)
        yield f"ws://127.0.0.1:{server.port}"
    simulation.close()


def test_a_long_message_of_an_unauthorized_client_is_not_received(guarded):
    with connect(guarded) as socket:
        with contextlib.suppress(ConnectionClosed):
            socket.send("A" * 20_000_000)
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv(60.0)
        assert closed.value.rcvd.code == 1009  # too big, known from the head alone
    with connect(guarded) as socket:
        socket.send(json.dumps({"op": "bogus"}))
        assert "not authorized" in socket.recv(60.0)


def test_small_frames_are_cut_in_small_numbers(guarded, monkeypatch):
    sizes = []
    receive = first_message.GuardedConnection.data_received

    def note(connection, data):
        sizes.append(len(data))
        receive(connection, data)

    monkeypatch.setattr(first_message.GuardedConnection, "data_received", note)
    with connect(f"{guarded}/?token=secret") as socket:
        socket.send(json.dumps({"op": "bogus", "pad": "A" * 1_000_000}))
        assert "unknown operation" in socket.recv(60.0)
    assert max(sizes) <= 32 << 10


@pytest.mark.parametrize("how", ["auth", "auth in two frames", "url", "header"])
def test_large_messages_may_come_right_behind_the_token(guarded, how):
    headers = {"Authorization": "Bearer secret"} if how == "header" else {}
    url = f"{guarded}/?token=secret" if how == "url" else guarded
    with connect(url, additional_headers=headers) as socket:
        shown = json.dumps({"op": "auth", "token": "secret"})
        if how == "auth":
            socket.send(shown)
        elif how == "auth in two frames":
            socket.send((shown[:9], shown[9:]))
            socket.send('{"op": "bogus"}')
            assert "unknown operation" in socket.recv(60.0)
        socket.send(json.dumps({"op": "bogus", "pad": "A" * 500_000}))
        assert "unknown operation" in socket.recv(60.0)


# ------------------------------------------------------------------------------------ ROS-TCP


def test_the_count_ends_where_messages_end():
    rng = np.random.default_rng(3)
    store = typestore()
    looked_at = 0
    for msgtype in sorted({*store.names()[::9], *TYPES}):
        message = filled(msgtype, rng)
        coded = [
            (CDR, bytes(store.serialize_cdr(message, msgtype, little_endian=little)))
            for little in (True, False)
        ]
        with contextlib.suppress(GraphError):  # a type of ROS 2 alone
            coded.append((ROS1, ros1_codec().encode(message, msgtype)))
        for form, data in coded:
            check_objects(data, msgtype, form)
            count = object_count._Count(data, form)
            count._walk(object_count._plan_of(msgtype, form))
            end = count._position + (4 if form == CDR else 0)
            assert end <= len(data) <= end + (3 if form == CDR else 0), (msgtype, form)
            looked_at += 1
    assert looked_at > 100


NESTED = "trajectory_msgs/msg/MultiDOFJointTrajectory"
ROS1_BOMBS = {
    "transforms": ("tf2_msgs/msg/TFMessage", struct.pack("<I", 50_000) + bytes(76 * 50_000)),
    "texts": (
        "trajectory_msgs/msg/JointTrajectory",
        bytes(16) + struct.pack("<I", 500_000) + bytes(4 * 500_000),
    ),
    "points": ("geometry_msgs/msg/PolygonStamped", bytes(16) + struct.pack("<I", 99_999)),
    "nothing": ("diagnostic_msgs/msg/DiagnosticArray", bytes(16) + b"\xff" * 4),
    "in parts": (
        NESTED,
        bytes(20) + struct.pack("<I", 500) + (struct.pack("<I", 100) + bytes(5616)) * 500,
    ),
}


@pytest.mark.parametrize("name", ROS1_BOMBS)
def test_arrays_of_messages_are_counted_before_any_is_made(name):
    msgtype, data = ROS1_BOMBS[name]
    with pytest.raises(GraphError, match=rf"a {msgtype} has more than {MAX_OBJECTS:,} messages"):
        check_objects(data, msgtype, ROS1)
    with pytest.raises(GraphError, match="send several messages"):
        check_objects(b"\0\1\0\0" + struct.pack("<I", 50_000), "tf2_msgs/msg/TFMessage", CDR)
    with pytest.raises(GraphError, match="send several messages"):
        check_objects(b"\0\0\0\0" + struct.pack(">I", 50_000), "tf2_msgs/msg/TFMessage", CDR)


def test_a_client_of_ros_tcp_is_warned(monkeypatch):
    graph = HandGraph()
    session = EndpointSession(graph.gateway, "hostile", "ros1", 10, lambda: None)
    parser = RosTcpFrameParser()

    def take(destination, payload):
        for found in parser.feed(frame(destination, payload)):
            session.take(found)

    fields = {"topic": "/tf", "message_name": "tf2_msgs/TFMessage"}
    take("__publish", json.dumps(fields).encode())
    made = peak_bytes(lambda: take("/tf", ROS1_BOMBS["transforms"][1]))
    assert made < 3 * len(ROS1_BOMBS["transforms"][1])  # the parser's copies, and no messages
    sent = b"".join(bytes(part) for part in session.outbox.gather())
    assert b"send several messages" in sent
    take("/tf", struct.pack("<I", 3000) + bytes(76 * 3000))
    assert session.reading is not None
    graph.work_off()
    assert b"more than" not in b"".join(bytes(part) for part in session.outbox.gather())
