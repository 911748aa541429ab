"""The ROS-TCP endpoint over real sockets, with a client that shares no code with it."""

from __future__ import annotations

import gc
import json
import select
import socket
import struct
import threading
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from ros_tcp_client import Client, Loop, cdr_string, frame, ros1_string, until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")
string_of = {"ros1": ros1_string, "ros2": cdr_string}


@pytest.fixture
def loop():
    loop = Loop()
    yield loop
    loop.close()


@pytest.fixture
def bridges(loop):
    with BridgeHost(loop.gateway) as bridges:
        yield bridges


@pytest.fixture
def serve(bridges):
    def serve(**options):
        bridge = RosTcpEndpoint(**{"port": 0, **options})
        bridges.open(bridge)
        return bridge

    return serve


@pytest.fixture
def connect():
    clients = []

    def connect(port, **options):
        client = Client(port, **options)
        clients.append(client)
        if options.get("reading", True):
            assert client.next()[0] == "__handshake"
        return client

    yield connect
    for client in clients:
        client.close()


@pytest.fixture
def client(serve, connect):
    return connect(serve().port)


def collect(loop, topic, msgtype=STRING):
    seen = []
    loop.do(lambda: loop.graph.subscribe(topic, seen.append, msgtype))
    return seen


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
def test_the_handshake_says_which_ros(serve, generation):
    client = Client(serve(generation=generation).port)
    name, fields = client.next()
    assert name == "__handshake"
    assert fields["version"] == "v0.7.0"
    metadata = json.loads(fields["metadata"])
    assert metadata["protocol"] == generation.upper()
    assert metadata["features"] == ["queue_size", "remove", "response_error"]
    client.close()


@pytest.mark.parametrize(("generation", "ending"), [("ros1", b""), ("ros2", b"\0")])
def test_messages_go_in_both_directions(loop, serve, connect, generation, ending):
    client, of = connect(serve(generation=generation).port), string_of[generation]
    seen = collect(loop, "/in")
    client.command("publish", ending, topic="/in", message_name="std_msgs/String", queue_size=10)
    client.send("/in", of("ünïcode ✓"))
    until(lambda: seen)
    assert seen[0].message.data == "ünïcode ✓"
    publisher = loop.graph.advertise("/out", STRING)
    client.command("subscribe", ending, topic="/out", message_name="std_msgs/String")
    client.synchronize()
    loop.publish(publisher, String("hoppla ✓"))
    assert client.next() == ("/out", of("hoppla ✓"))


def test_names_without_a_slash_are_meant_absolute(loop, client):
    """Unity's tutorials publish `pos_rot`; frames back carry the client's own spelling."""
    seen = collect(loop, "/pos_rot")
    client.command("publish", topic="pos_rot", message_name="std_msgs/String")
    client.command("subscribe", topic="pos_rot", message_name="std_msgs/String")
    client.send("pos_rot", ros1_string("x"))
    assert client.next() == ("pos_rot", ros1_string("x"))
    assert len(seen) == 1


def test_a_destination_may_end_in_nul(loop, client):
    seen = collect(loop, "/in")
    client.send("__publish\0", b'{"topic":"/in","message_name":"std_msgs/String","x":1}\0')
    client.send("/in\0", ros1_string("x"))
    until(lambda: seen)


def test_several_clients_all_receive(loop, serve, connect):
    port = serve().port
    clients = [connect(port) for _ in range(3)]
    for one in clients:
        one.command("subscribe", topic="/out", message_name="std_msgs/String")
        one.synchronize()
    loop.publish(loop.graph.advertise("/out", STRING), String("all"))
    assert [one.next() for one in clients] == [("/out", ros1_string("all"))] * 3
    assert len(loop.gateway.sessions()) == 3
    clients[0].close()
    until(lambda: len(loop.gateway.sessions()) == 2)


def test_the_late_find_what_was_latched(loop, client):
    loop.publish(loop.graph.advertise("/map", STRING, latched=True), String("kept"))
    client.command("subscribe", topic="/map", message_name="std_msgs/String")
    assert client.next() == ("/map", ros1_string("kept"))


def test_what_a_client_latches_awaits_others(loop, serve, connect):
    port = serve().port
    one, two = connect(port), connect(port)
    one.command("publish", topic="/map", message_name="std_msgs/String", latch=True)
    one.send("/map", ros1_string("kept"))
    one.synchronize()
    loop.do(lambda: None)
    two.command("subscribe", topic="/map", message_name="std_msgs/String")
    assert two.next() == ("/map", ros1_string("kept"))


def test_topic_list_in_unitys_spelling(loop, client):
    loop.graph.advertise("/out", STRING)
    client.command("topic_list")
    assert client.next() == ("__topic_list", {"topics": ["/out"], "types": ["std_msgs/String"]})


def test_what_was_registered_can_be_removed(loop, client):
    client.command("subscribe", topic="/a", message_name="std_msgs/String")
    client.command("publish", topic="/b", message_name="std_msgs/String")
    client.command("unity_service", topic="/c", message_name="std_srvs/Trigger")
    client.command("ros_service", topic="/d", message_name="std_srvs/Trigger")
    client.synchronize()
    (info,) = loop.gateway.sessions()
    assert (info.publishes, [m.topic for m in info.queues], info.offers) == (
        ("/b",),
        ["/a"],
        ("/c",),
    )
    pairs = (
        ("subscriber", "/a"),
        ("publisher", "/b"),
        ("unity_service", "/c"),
        ("ros_service", "/d"),
    )
    for what, topic in pairs:
        client.command(f"remove_{what}", topic=topic)
    client.synchronize()
    (info,) = loop.gateway.sessions()
    assert (info.publishes, info.queues, info.offers) == ((), (), ())
    for what, topic in pairs:
        client.command(f"remove_{what}", topic=topic)
        assert topic in client.next_error()


# ---------------------------------------------------------------------------------- services


def call(client, service, number=101, body=b""):
    request = json.dumps({"srv_id": number}).encode()
    client.sock.sendall(frame("__request", request) + frame(service, body))


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
def test_a_service_of_the_simulation(loop, serve, connect, generation):
    client = connect(serve(generation=generation).port)
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "done"))
    client.command("ros_service", topic="/do", message_name="std_srvs/Trigger")
    empty = b"" if generation == "ros1" else b"\0\1\0\0"  # as Unity writes a type without fields
    call(client, "/do", body=empty)
    assert client.next() == ("__response", {"srv_id": 101})
    body = b"\1" + ros1_string("done")
    if generation == "ros2":
        body = b"\0\1\0\0\1\0\0\0" + cdr_string("done")[4:]
    assert client.next() == ("/do", body)


def test_a_keepalive_between_request_and_body_is_none(loop, client):
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, ""))
    client.command("request", srv_id=7)
    client.sock.sendall(bytes(8))
    client.send("/do", b"")
    assert client.next() == ("__response", {"srv_id": 7})


def broken(_request):
    raise ZeroDivisionError("oh")


@pytest.mark.parametrize(
    ("service", "body", "words"),
    [
        ("/nobody", b"", "has no server"),
        ("/broken", b"", "'/broken' failed"),
        ("/do", b"x", "Trigger"),
    ],
)
def test_a_call_that_fails_ends_too(loop, client, service, body, words):
    loop.graph.create_service("/broken", TRIGGER, broken)
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "done"))
    call(client, service, body=body)
    assert words in client.next_error()
    assert client.next() == ("__response", {"srv_id": 101})
    assert client.next() == (service, b"")


def test_a_request_without_body_ends_and_the_next_works(loop, client):
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, ""))
    client.command("request", srv_id=1)
    call(client, "/do", 2)
    assert "without its body" in client.next_error()
    assert client.next() == ("__response", {"srv_id": 1})
    assert client.next()[1] == b""
    assert client.next() == ("__response", {"srv_id": 2})
    assert client.next()[0] == "/do"


class Caller:
    """Calls a service from inside the graph."""

    def __init__(self, loop, service):
        self.answers, self.failures = [], []
        reply = ServiceReply(self.answers.append, self.failures.append)
        loop.do(lambda: loop.graph.call_async(service, None, reply))


def test_a_service_of_the_client(loop, client):
    client.command("unity_service", topic="/unity", message_name="std_srvs/Trigger")
    client.synchronize()
    caller = Caller(loop, "/unity")
    assert client.next() == ("__request", {"srv_id": 1001})
    assert client.next() == ("/unity", b"")
    response = json.dumps({"srv_id": 1001}).encode()
    body = frame("/unity", b"\1" + ros1_string("yes"))
    client.sock.sendall(frame("__response", response) + body)
    until(lambda: caller.answers)
    assert caller.answers[0].message == "yes"
    client.sock.sendall(frame("__response", response) + body)
    assert "no request 1001" in client.next_error()


def test_a_broken_answer_fails_the_caller(loop, client):
    client.command("unity_service", topic="/unity", message_name="std_srvs/Trigger")
    client.synchronize()
    caller = Caller(loop, "/unity")
    client.command("response", srv_id=1001)
    client.send("/unity", b"")
    until(lambda: caller.failures)
    assert "invalid" in str(caller.failures[0])


def test_callers_of_a_client_that_leaves_do_not_wait(loop, client):
    client.command("unity_service", topic="/unity", message_name="std_srvs/Trigger")
    client.synchronize()
    caller = Caller(loop, "/unity")
    client.close()
    until(lambda: caller.failures, 2.0)
    assert "has left" in str(caller.failures[0])
    assert not loop.graph.has_service("/unity")


def test_one_clients_service_for_another(loop, serve, connect):
    port = serve().port
    server, caller = connect(port), connect(port)
    server.command("unity_service", topic="/unity", message_name="std_srvs/Trigger")
    server.synchronize()
    call(caller, "/unity")
    number = server.next()[1]["srv_id"]
    server.next()
    server.command("response", srv_id=number)
    server.send("/unity", b"\1" + ros1_string("hi"))
    assert caller.next() == ("__response", {"srv_id": 101})
    assert caller.next() == ("/unity", b"\1" + ros1_string("hi"))


# ---------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("destination", "payload", "words"),
    [
        ("/unknown", b"abc", "Not registered"),
        ("__no_such", b"{}", "no such command"),
        ("__subscribe", b"{bad", "JSON"),
        ("__subscribe", b"[1]", "JSON object"),
        ("__subscribe", b"[" * 100_000, "JSON"),
        ("__subscribe", b"\xff\xfe", "JSON"),
        ("__subscribe", b"{}", "'topic' is missing"),
        ("__subscribe", b'{"topic": 3, "message_name": "std_msgs/String"}', "'topic'"),
        ("__subscribe", b'{"topic": "/a", "message_name": "nope/Nope"}', "unknown type"),
        ("__subscribe", b'{"topic": "/a", "message_name": "String"}', "name of a ROS type"),
        ("__subscribe", b'{"topic": "/a b", "message_name": "std_msgs/String"}', "valid name"),
        ("__subscribe", b'{"topic": "__error", "message_name": "std_msgs/String"}', "for commands"),
        (
            "__unity_service",
            b'{"topic": "__do", "message_name": "std_srvs/Trigger"}',
            "for commands",
        ),
        ("__publish", b'{"topic": "/taken", "message_name": "std_msgs/Empty"}', "carries"),
        ("__publish", b'{"topic":"/a","message_name":"std_msgs/String","queue_size":"x"}', "queue"),
        ("__unity_service", b'{"topic": "/do", "message_name": "std_srvs/Trigger"}', "already"),
        ("__ros_service", b'{"topic": "/do", "message_name": "std_srvs/No"}', "unknown type"),
        ("__response", b'{"srv_id": "x"}', "srv_id"),
        ("/in", b"\xff\0", "String"),
        ("/in", b"", "String"),
        ("/in", ros1_string("x") + b"more", "String"),
        ("\ud7ff" * 1300, b"", "Not registered"),
    ],
)
def test_mistakes_are_reported_and_forgiven(loop, client, destination, payload, words):
    loop.graph.advertise("/taken", STRING)
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, ""))
    client.command("publish", topic="/in", message_name="std_msgs/String")
    client.send(destination, payload)
    assert words in client.next_error()
    client.command("topic_list")
    assert client.next()[0] == "__topic_list"


def test_an_unknown_response_does_no_harm(serve, connect):
    port = serve().port
    one, two = connect(port), connect(port)
    one.command("response", srv_id=5)
    one.send("/x", b"")
    assert "no request 5" in one.next_error()
    two.synchronize()


def test_a_frame_over_the_limit_ends_the_connection_with_a_reason(loop, serve, connect):
    port = serve(max_payload_bytes=1 << 20).port
    client, other = connect(port), connect(port)
    client.sock.sendall(struct.pack("<I", 3) + b"/in" + struct.pack("<I", 1 << 30))
    assert "1073741824 bytes" in client.next_error()
    assert client.ended.wait(60.0)
    until(lambda: len(loop.gateway.sessions()) == 1)
    other.synchronize()


def test_http_is_not_ros_tcp(serve, connect):
    client = connect(serve().port)
    client.sock.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert "destination" in client.next_error()
    assert client.ended.wait(60.0)


# ----------------------------------------------------------------------------- large and slow


def image(size):
    cls = message_type("sensor_msgs/msg/Image")
    from volery.graph.messages import header

    return cls(header(5, "c"), 1, size, "mono8", 0, size, np.arange(size, dtype=np.uint8))


@pytest.mark.parametrize("generation", ["ros1", "ros2"])
def test_eight_megabytes_go_in_both_directions(loop, serve, connect, generation):
    client = connect(serve(generation=generation).port)
    seen = collect(loop, "/in", "sensor_msgs/msg/Image")
    client.command("subscribe", topic="/out", message_name="sensor_msgs/Image")
    client.command("publish", topic="/in", message_name="sensor_msgs/Image")
    client.synchronize()
    sent = image(8 << 20)
    loop.publish(loop.graph.advertise("/out", "sensor_msgs/msg/Image"), sent)
    name, payload = client.next()
    assert (name, payload[-8:]) == ("/out", bytes(range(248, 256)))
    client.send("/in", payload)
    until(lambda: seen)
    assert np.array_equal(seen[0].message.data, sent.data)


def test_a_client_that_does_not_read_loses_and_others_do_not(loop, serve, connect):
    port = serve(depth=3).port
    slow = connect(port, reading=False, receive_buffer=4096)
    quick = connect(port)
    for one in (slow, quick):
        one.command("subscribe", topic="/out", message_name="sensor_msgs/Image")
    quick.synchronize()
    until(lambda: len(loop.gateway.sessions()[0].queues) == 1)
    publisher = loop.graph.advertise("/out", "sensor_msgs/msg/Image")
    for k in range(40):
        message = image(1 << 20)
        message.width = k
        loop.publish(publisher, message)
        quick.next()
    (info,) = loop.gateway.sessions()[0].queues
    assert (info.received, info.waiting) == (40, 3)
    assert info.dropped > 20
    slow.read()
    while True:
        name, payload = slow.next()
        if name == "/out" and struct.unpack_from("<I", payload, 21)[0] == 39:
            break


def test_answers_overtake_a_flood(loop, serve, connect):
    """A client gets its answer after the frame in transit, however much waits."""
    client = connect(serve(depth=1000).port)
    client.command("subscribe", topic="/out", message_name="std_msgs/String")
    client.synchronize()
    publisher = loop.graph.advertise("/out", STRING)
    stop = threading.Event()

    def flood():
        while not stop.is_set():
            loop.publish(publisher, String("x" * 10_000))

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        for _ in range(20):
            client.synchronize()
    finally:
        stop.set()
        thread.join()


def test_errors_that_no_client_reads_do_not_pile_up(loop, serve, connect):
    port = serve().port
    client, other = connect(port, reading=False, receive_buffer=4096), connect(port)
    client.sock.setblocking(False)
    wrong = frame("/unknown", b"") * 1000

    def takes_more():
        """Returns whether the socket takes more while the other client is served often."""
        for _ in range(50):
            if select.select([], [client.sock], [], 0.0)[1]:
                return True
            other.synchronize()
        return False

    sent, rest = 0, b""
    while sent < 64 << 20 and takes_more():
        rest = rest or wrong
        count = client.sock.send(rest)
        sent, rest = sent + count, rest[count:]
    assert sent < 64 << 20


def test_commands_do_not_pile_up_while_the_simulation_is_busy(loop, client):
    seen = collect(loop, "/in")
    client.command("publish", topic="/in", message_name="std_msgs/String", queue_size=2)
    client.synchronize()
    loop.held.set()
    for k in range(500):
        client.send("/in", ros1_string(str(k)))
    client.synchronize()
    assert loop.waiting() <= 6
    loop.held.clear()
    until(lambda: seen and seen[-1].message.data == "499")
    assert len(seen) <= 5


def test_the_half_open_are_noticed_by_their_silence(loop, serve, connect):
    port = serve(silence_s=4.0).port
    silent, mute = connect(port), connect(port, keepalive=False)
    lively = connect(port)
    for _ in range(600):
        lively.sock.sendall(bytes(8))
        if silent.ended.wait(0.1):
            break
    assert silent.ended.is_set()
    assert not mute.ended.is_set()  # it never promised to send any
    assert not lively.ended.is_set()
    until(lambda: len(loop.gateway.sessions()) == 1)  # of the one that has spoken


@pytest.mark.parametrize("length", [3_000_000, 20_000_000])
def test_a_client_that_leaves_within_a_message_leaves_no_memory(serve, connect, length):
    """At once: the garbage collector comes by rarely."""
    head = struct.pack("<I", 6) + b"/large" + struct.pack("<I", length)
    port = serve().port
    gc.disable()
    tracemalloc.start()
    try:
        before = payload_bytes()
        for _ in range(3):
            client = connect(port)
            client.sock.sendall(head + bytes(100_000))
            until(lambda: payload_bytes() - before > 0.9 * length)
            client.close()
            until(lambda: payload_bytes() - before < 0.5 * length)
    finally:
        tracemalloc.stop()
        gc.enable()


def payload_bytes():
    """Returns the memory of Python's allocators and of shared mappings, which hold payloads."""
    maps = Path("/proc/self/maps").read_text().splitlines()
    ends = [line.split()[0].split("-") for line in maps if "/dev/zero" in line]
    mapped = sum(int(end, 16) - int(start, 16) for start, end in ends)
    return mapped + tracemalloc.get_traced_memory()[0]


def test_a_client_comes_back(loop, serve, connect):
    port = serve().port
    publisher = loop.graph.advertise("/out", STRING)
    for k in range(5):
        client = connect(port)
        client.command("subscribe", topic="/out", message_name="std_msgs/String")
        client.synchronize()
        loop.publish(publisher, String(str(k)))
        assert client.next() == ("/out", ros1_string(str(k)))
        client.close()
    until(lambda: not loop.gateway.sessions())


def test_thousands_of_topics(loop, client):
    for k in range(3000):
        client.command("subscribe", topic=f"/t{k}", message_name="std_msgs/String")
    client.synchronize()
    (info,) = loop.gateway.sessions()
    assert len(info.queues) == 3000


def test_too_many_clients_are_refused(serve, connect):
    port = serve(max_clients=1).port
    connect(port)
    late = connect(port)
    assert "too many" in late.next_error()


# ------------------------------------------------------------------------------- open and close


def test_a_port_in_use_is_named(serve):
    port = serve().port
    with pytest.raises(BridgeError, match=f"port {port} .* in use.*another port"):
        serve(port=port)


def test_beyond_loopback_only_with_consent():
    with pytest.raises(BridgeError, match="--allow-remote"):
        RosTcpEndpoint("0.0.0.0")
    assert "0.0.0.0" in RosTcpEndpoint("0.0.0.0", anywhere=True).name


def test_only_known_generations():
    with pytest.raises(BridgeError, match="ros3"):
        RosTcpEndpoint(generation="ros3")


def test_closing_disconnects_all_clients(loop):
    bridge = RosTcpEndpoint(port=0)
    with BridgeHost(loop.gateway) as bridges:
        bridges.open(bridge)
        client = Client(bridge.port)
        client.next()
    assert client.ended.wait(60.0)
    assert not loop.gateway.sessions()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", bridge.port), 1.0)
    client.close()


def test_offers_elsewhere_stay_unharmed(loop, client):
    loop.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "inside"))
    client.command("unity_service", topic="/do", message_name="std_srvs/Trigger")
    assert "already" in client.next_error()
    client.close()
    until(lambda: not loop.gateway.sessions())
    assert loop.do(lambda: loop.graph.call("/do")).message == "inside"
    with pytest.raises(GraphError):
        loop.do(lambda: loop.graph.call("/other"))


def test_a_flood_of_one_client_delays_no_other(loop, serve, connect):
    port = serve().port
    flooding, other = connect(port), connect(port)
    flooding.command("publish", topic="/in", message_name="std_msgs/String")
    other.synchronize()
    many, stop = frame("/in", ros1_string("x")) * 5000, threading.Event()

    def flood():
        while not stop.is_set():
            flooding.sock.sendall(many)

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        for _ in range(30):  # the flood never ends: a client that waited for its end would fail
            other.synchronize()
    finally:
        stop.set()
        thread.join()
