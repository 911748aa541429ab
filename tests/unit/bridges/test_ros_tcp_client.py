"""The ROS-TCP client against our own endpoint, and against plain sockets that play others."""

from __future__ import annotations

import json
import queue
import socket
import struct
import threading
from concurrent.futures import Future

import numpy as np
import pytest
from ros_tcp_client import Loop, frame, ros1_string, until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp import wire
from volery.bridges.ros_tcp.client import RosTcpClient
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.bridges.rosbridge.rosapi_bridge import RosApiBridge
from volery.core.errors import BridgeError, GraphError
from volery.graph.connection import ListsTopics, call_and_wait
from volery.graph.messages import Header, String, Time, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
EMPTY = "std_srvs/srv/Empty"
Request = message_type(f"{TRIGGER}_Request")
Response = message_type(f"{TRIGGER}_Response")
EmptyRequest = message_type(f"{EMPTY}_Request")

PATIENT = {"connect_timeout_s": 60.0, "handshake_s": 60.0}
"""With a busy machine."""


@pytest.fixture
def loop():
    loop = Loop()
    with BridgeHost(loop.gateway) as loop.bridges:
        yield loop
    loop.close()


@pytest.fixture(params=["ros1", "ros2"])
def endpoint(loop, request):
    endpoint = RosTcpEndpoint(port=0, generation=request.param)
    loop.bridges.open(endpoint)
    return endpoint


@pytest.fixture
def connect():
    clients = []

    def connect(port, **options):
        clients.append(RosTcpClient(port=port, **(PATIENT | options)))
        return clients[-1]

    yield connect
    for client in clients:
        client.close()


@pytest.fixture
def client(endpoint, connect):
    return connect(endpoint.port)


def topics(loop):
    return {t.name: t for t in loop.graph.topics()}


def collect(loop, topic, msgtype=STRING):
    seen = []
    loop.do(lambda: loop.graph.subscribe(topic, seen.append, msgtype))
    return seen


def call(client, service, request=None):
    return call_and_wait(client, service, request, 60.0)


# ------------------------------------------------------------------------------------------ topics


def test_messages_go_both_ways(loop, client):
    seen = collect(loop, "/in")
    client.advertise("/in", STRING)
    client.publish("/in", String("grüße ✓"))
    until(lambda: seen)
    assert seen[0].message == String("grüße ✓")
    woken = threading.Event()
    messages = client.subscribe("/out", STRING, wake=woken.set)
    until(lambda: "/out" in topics(loop))
    loop.publish(loop.graph.advertise("/out", STRING), String("zurück ✓"))
    assert woken.wait(60.0)
    (published,) = messages.take()
    assert (published.topic, published.msgtype) == ("/out", STRING)
    assert published.message == String("zurück ✓")


def test_large_messages_and_stamps(loop, client):
    image = message_type("sensor_msgs/msg/Image")
    pixels = np.arange(3_000_000, dtype=np.uint8)
    boxes = [client.subscribe("/image", image.__msgtype__, wake=lambda: None) for _ in range(2)]
    client.advertise("/image", image.__msgtype__)
    client.publish("/image", image(Header(Time(3, 5), "c"), 1, 9, "mono8", 0, 9, pixels))
    for box in boxes:
        (published,) = until(box.take)
        assert published.time_ns == 3_000_000_005
        assert np.array_equal(published.message.data, pixels)


def test_what_is_latched_comes_to_who_is_late(loop, client, connect, endpoint):
    client.advertise("/map", STRING, latched=True)
    client.publish("/map", String("here"))
    until(lambda: "/map" in topics(loop) and topics(loop)["/map"].messages)
    messages = connect(endpoint.port).subscribe("/map", wake=lambda: None)
    assert until(messages.take)[0].message == String("here")


def test_publications_of_several_topics_keep_their_order(loop, client):
    order = []
    for topic in ("/a", "/b"):
        loop.do(
            lambda topic=topic: loop.graph.subscribe(topic, lambda p: order.append(p.topic), STRING)
        )
        client.advertise(topic, STRING)
    sent = ["/a", "/b", "/b", "/a", "/a", "/b"] * 5
    loop.held.set()
    for topic in sent:
        client.publish(topic, String(topic))
    client.topic_types()  # all is there
    loop.held.clear()
    until(lambda: len(order) == len(sent))
    assert order == sent


def test_topics_are_told_with_the_graphs_own_types(loop, client):
    loop.graph.advertise("/out", STRING)
    loop.graph.advertise("/clock", "rosgraph_msgs/msg/Clock")
    assert isinstance(client, ListsTopics)
    assert client.topic_types() == {"/clock": "rosgraph_msgs/msg/Clock", "/out": STRING}
    with pytest.raises(GraphError, match="no topic '/none'"):
        client.subscribe("/none", wake=lambda: None)


def test_what_ended_is_taken_back(loop, client):
    client.advertise("/in", STRING)
    messages = client.subscribe("/out", STRING, wake=lambda: None)
    client.create_service("/do", TRIGGER, lambda _q, reply: reply.answer(Response(True, "")))
    until(lambda: topics(loop).get("/out") and "/do" in loop.graph.services())
    assert client.info.publishes == ("/in",)
    assert client.info.offers == ("/do",)
    client.unadvertise("/in")
    client.unsubscribe(messages)
    client.destroy_service("/do")
    until(lambda: "/do" not in loop.graph.services())
    assert topics(loop)["/in"].publishers == topics(loop)["/out"].subscribers == 0
    assert client.info.publishes == client.info.queues == client.info.offers == ()


def test_slips_are_told_to_who_makes_them(client):
    with pytest.raises(GraphError, match="no_msgs"):
        client.advertise("/a", "no_msgs/msg/Such")
    with pytest.raises(GraphError, match="not advertised"):
        client.publish("/a", String(""))
    client.advertise("/a", STRING)
    with pytest.raises(GraphError, match="carries"):
        client.publish("/a", Time(0, 0))
    with pytest.raises(GraphError, match="depth"):
        client.subscribe("/a", STRING, depth=0, wake=lambda: None)
    client.close()
    with pytest.raises(GraphError, match="is closed"):
        client.publish("/a", String(""))


def test_the_endpoints_complaints_are_kept(loop, client):
    loop.graph.advertise("/number", "std_msgs/msg/Int32")
    client.subscribe("/number", STRING, wake=lambda: None)
    until(lambda: client.problems)
    assert "std_msgs/msg/Int32" in client.problems[0]


# ---------------------------------------------------------------------------------------- services


def test_services_are_called(loop, client):
    loop.graph.create_service("/do", TRIGGER, lambda _q: Response(True, "done"))
    loop.graph.create_service("/nothing", EMPTY, lambda _q: message_type(f"{EMPTY}_Response")())
    for _ in range(2):
        assert call(client, "/do", Request()) == Response(True, "done")
    assert call(client, "/nothing", EmptyRequest()) is not None


@pytest.mark.parametrize(("srvtype", "service"), [(TRIGGER, "/fails"), (EMPTY, "/fails/too")])
def test_who_calls_is_told_why_it_failed(loop, client, srvtype, service):
    request = message_type(f"{srvtype}_Request")

    def ask(_request, reply):
        reply.fail(GraphError("the rotor is lost"))

    loop.graph.create_async_service(service, srvtype, ask)
    with pytest.raises(GraphError, match=f"'{service}'.*the rotor is lost"):
        call(client, service, request())
    with pytest.raises(GraphError, match="it has no server"):
        call(client, "/no_such", request())
    with pytest.raises(GraphError, match="its type is"):
        call(client, service, message_type("std_srvs/srv/SetBool_Request")(True))


def test_without_a_request_rosapi_tells_the_type(loop, connect):
    bridge = RosApiBridge(RosTcpEndpoint(port=0))
    loop.bridges.open(bridge)
    client = connect(bridge.bridge.port)
    loop.graph.create_service("/do", TRIGGER, lambda _q: Response(True, "done"))
    assert call(client, "/do") == Response(True, "done")
    with pytest.raises(GraphError, match="service '/none' has no server"):
        call(client, "/none")


def ask_graph(loop, service, request):
    come = Future()
    reply = ServiceReply(come.set_result, come.set_exception)
    loop.do(lambda: loop.graph.call_async(service, request, reply))
    return come.result(10.0)


def test_services_are_offered(loop, client):
    def handle(request, reply):
        if request.data:
            raise ValueError("not now")
        reply.answer(message_type("std_srvs/srv/SetBool_Response")(True, "off"))

    set_bool = message_type("std_srvs/srv/SetBool_Request")
    client.create_service("/switch", "std_srvs/srv/SetBool", handle)
    until(lambda: "/switch" in loop.graph.services())
    assert ask_graph(loop, "/switch", set_bool(False)).message == "off"
    with pytest.raises(GraphError, match="ValueError: not now"):
        ask_graph(loop, "/switch", set_bool(True))
    with pytest.raises(GraphError, match="already"):
        client.create_service("/switch", "std_srvs/srv/SetBool", handle)


# ------------------------------------------------------------------------------------- connections


def test_it_comes_back_and_asks_for_everything_again(loop, connect, hold_port):
    port = hold_port()
    first = RosTcpEndpoint(port=port)
    loop.bridges.open(first)
    client = connect(port)
    client.advertise("/in", STRING)
    messages = client.subscribe("/out", STRING, wake=lambda: None)
    client.create_service("/do", TRIGGER, lambda _q, reply: reply.answer(Response(True, "again")))
    loop.graph.create_async_service("/waits", TRIGGER, lambda _q, _reply: None)
    outcome = queue.Queue()
    client.call("/waits", Request(), ServiceReply(outcome.put, outcome.put))
    until(lambda: "/do" in loop.graph.services())
    loop.bridges.call(first.stop())
    assert "is broken" in str(outcome.get(timeout=60.0))
    until(lambda: not client.connected)
    client.publish("/in", String("lost"))
    assert client.dropped == 1
    with pytest.raises(GraphError, match="no connection"):
        call(client, "/do", Request())
    loop.bridges.open(RosTcpEndpoint(port=port))
    client.wait_until_connected(60.0)
    assert client.connections == 2
    seen = collect(loop, "/in")
    client.publish("/in", String("again"))
    until(lambda: seen)
    until(lambda: topics(loop)["/out"].subscribers == 1 and "/do" in loop.graph.services())
    loop.publish(loop.graph.advertise("/out", STRING), String("again"))
    assert until(messages.take)[0].message == String("again")
    assert ask_graph(loop, "/do", Request()).message == "again"


def test_what_waits_is_sent_before_it_leaves(loop, endpoint):
    """More than the network takes at once."""
    seen = collect(loop, "/in")
    client = RosTcpClient(port=endpoint.port, **PATIENT)
    client.advertise("/in", STRING)
    client.publish("/in", String("x" * 20_000_000))
    client.close()
    until(lambda: seen)
    assert len(seen[0].message.data) == 20_000_000


def test_nobody_there_and_somebody_else(loop):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
        with pytest.raises(BridgeError, match=f"no ROS-TCP server at 127.0.0.1:{port}: .*"):
            RosTcpClient(port=port, connect_timeout_s=0.3)
    with pytest.raises(BridgeError, match="1 to 65535"):
        RosTcpClient(port=0)


class Other:
    """A server of plain sockets: somebody else's endpoint."""

    def __init__(self, greeting):
        self._greeting = greeting
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.frames = queue.Queue()
        self.sockets = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        try:
            while True:
                sock, _ = self._listener.accept()
                self.sockets.append(sock)
                sock.sendall(self._greeting)
                self._read(sock.makefile("rb"))
        except OSError:
            return

    def _read(self, file):
        while length := file.read(4):
            name = file.read(struct.unpack("<I", length)[0]).decode()
            (size,) = struct.unpack("<I", file.read(4))
            self.frames.put((name, file.read(size)))

    def next(self):
        """The next frame that is no keepalive; JSON is parsed."""
        while not (found := self.frames.get(timeout=60.0))[0]:
            pass
        name, payload = found
        return (name, json.loads(payload.rstrip(b"\0"))) if name.startswith("__") else found

    def send(self, name, payload):
        self.sockets[-1].sendall(frame(name, payload))

    def command(self, name, **fields):
        self.send(f"__{name}", json.dumps(fields).encode())

    def close(self):
        self._listener.close()
        for sock in self.sockets:
            sock.close()


def unity_handshake(protocol):
    """As ROS-TCP-Endpoint 0.7.0 sends it."""
    metadata = json.dumps({"protocol": protocol})
    return frame("__handshake", json.dumps({"version": "v0.7.0", "metadata": metadata}).encode())


@pytest.fixture
def unity(connect):
    """Somebody who plays ROS-TCP-Endpoint 0.7.0 for ROS 1, and a client of his."""
    other = Other(unity_handshake("ROS1"))
    client = connect(other.port)
    yield other, client
    other.close()


def test_unitys_endpoint_hears_only_what_it_knows(unity):
    """An unknown command, or key of a command, makes it close the connection."""
    other, client = unity
    client.advertise("/in", STRING, latched=True)
    messages = client.subscribe("/out", STRING, depth=50, wake=lambda: None)
    client.unsubscribe(messages)
    client.unadvertise("/in")
    client.create_service("/do", TRIGGER, lambda _q, reply: reply.fail(GraphError("no")))
    client.destroy_service("/do")
    client.create_service("/do2", TRIGGER, lambda _q, reply: reply.fail(GraphError("no")))
    assert other.next() == (
        "__publish",
        {"topic": "/in", "message_name": "std_msgs/String", "queue_size": 100, "latch": True},
    )
    names = {"topic": "/out", "message_name": "std_msgs/String"}
    assert other.next() == ("__subscribe", names)
    for name in ("/do", "/do2"):
        names = {"topic": name, "message_name": "std_srvs/Trigger"}
        assert other.next() == ("__unity_service", names)
    other.send("/out", ros1_string("nobody wants this"))
    other.command("request", srv_id=1001)
    other.send("/do2", b"")
    assert other.next() == ("__response", {"srv_id": 1001})
    assert other.next() == ("/do2", b"")


def test_ours_hears_more(connect):
    other = Other(wire.handshake("ros1", ("queue_size", "remove", "response_error")))
    client = connect(other.port)
    messages = client.subscribe("/out", STRING, depth=500, wake=lambda: None)
    client.unsubscribe(messages)
    fields = {"topic": "/out", "message_name": "std_msgs/String", "queue_size": 500}
    assert other.next() == ("__subscribe", fields)
    assert other.next() == ("__remove_subscriber", {"topic": "/out"})
    other.command("request", srv_id=1001)
    other.send("/do", b"")
    why = "'/do' does not exist here"
    assert other.next() == ("__response", {"srv_id": 1001, "error": why})
    other.close()


def test_unitys_endpoint_answers_calls(unity):
    other, client = unity
    outcome = queue.Queue()
    for _ in range(2):
        client.call("/do", Request(), ServiceReply(outcome.put, outcome.put))
    names = {"topic": "/do", "message_name": "std_srvs/Trigger"}
    assert other.next() == ("__ros_service", names)
    for number in (101, 102):
        assert other.next() == ("__request", {"srv_id": number})
        assert other.next() == ("/do", b"")
    other.command("response", srv_id=102)
    other.send("/do", b"\1" + ros1_string("second"))
    assert outcome.get(timeout=60.0).message == "second"
    other.command("response", srv_id=77)
    other.send("/do", b"\1" + ros1_string("of nobody"))
    other.command("response", srv_id=101)
    other.send("/do", b"\1\2")
    assert "Trigger_Response" in str(outcome.get(timeout=60.0))
    assert "77" in client.problems[0]


@pytest.mark.parametrize(
    "text",
    [
        "Service destination '/do' is not registered! Known services are: dict_keys([]) ",
        "No response data from service '/do'!",
    ],
)
def test_unitys_endpoint_gives_no_response_to_a_call_that_fails(unity, text):
    other, client = unity
    outcome = queue.Queue()
    client.call("/do", Request(), ServiceReply(outcome.put, outcome.put))
    client.call("/other", Request(), ServiceReply(outcome.put, outcome.put))
    other.next()
    other.command("error", text=text)
    assert str(outcome.get(timeout=60.0)) == text
    other.command("error", text="Service destination '/other' is not registered!")
    assert "/other" in str(outcome.get(timeout=60.0))


def test_an_idle_client_shows_that_it_lives(unity):
    other, _ = unity
    keepalives = [other.frames.get(timeout=60.0) for _ in range(2)]
    assert keepalives == [("", b"")] * 2


@pytest.mark.parametrize(("generation", "ending"), [("ros1", b""), ("ros2", b"\0")])
def test_an_old_endpoint_sends_no_handshake(connect, generation, ending):
    other = Other(b"")
    client = connect(other.port, generation=generation, handshake_s=0.1)
    client.advertise("/in", STRING)
    frames = iter(lambda: other.frames.get(timeout=60.0), None)
    name, payload = next(found for found in frames if found[0])
    assert name == "__publish"
    assert payload.endswith(b"}" + ending)
    other.close()


@pytest.mark.parametrize(
    ("greeting", "why"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "claims a destination of 1347703880 bytes"),
        (frame("__handshake", b'{"version": "v9"}'), "neither ROS1 nor ROS2"),
    ],
)
def test_who_speaks_something_else_is_named(connect, greeting, why):
    other = Other(greeting)
    client = connect(other.port, connect_timeout_s=0)
    until(lambda: why in client._why)
    with pytest.raises(BridgeError, match=why):
        client.wait_until_connected(0.0)
    other.close()
