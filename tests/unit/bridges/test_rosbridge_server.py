"""rosbridge over real sockets: a plain WebSocket client, our own client, roslibpy, roslib."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import threading
import time
from pathlib import Path

import cbor2
import numpy as np
import pytest
from patient_websockets import connect
from rosbridge_bench import SET_BOOL, STEPS, STRING, TRIGGER, FakeSimulation, trigger_response
from websockets.exceptions import ConnectionClosed, InvalidStatus

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.origins import Origins
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import BridgeError, GraphError
from volery.graph import messages as m
from volery.graph.service_reply import ServiceReply

IMAGE = "sensor_msgs/msg/Image"


@pytest.fixture
def simulation():
    simulation = FakeSimulation()
    yield simulation
    simulation.close()


@pytest.fixture
def bridges(simulation):
    with BridgeHost(simulation.gateway) as bridges:
        yield bridges


@pytest.fixture
def server(bridges):
    server = RosbridgeServer(port=0)
    bridges.open(server)
    return server


def url_of(server):
    return f"ws://127.0.0.1:{server.port}"


class Plain:
    """A client made of nothing but a WebSocket."""

    def __init__(self, server, path="", **options):
        self._entry = connect(url_of(server) + path, max_size=None, **options)

    def __enter__(self):
        self.socket = self._entry.__enter__()
        return self

    def __exit__(self, *exception):
        self._entry.__exit__(*exception)

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def read(self, timeout=60.0):
        frame = self.socket.recv(timeout)
        return cbor2.loads(frame) if isinstance(frame, bytes) else json.loads(frame)

    def synchronize(self):
        """Wait until the server has taken in everything sent so far."""
        self.send("unadvertise_service", service="/nothing", id="sync")
        while self.read().get("id") != "sync":
            pass


def until(condition, timeout_s=60.0):
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


def image(size):
    header = m.header(1, "camera")
    return m.message_type(IMAGE)(header, 1, size, "mono8", 0, size, np.zeros(size, np.uint8))


def test_topics_in_both_directions(simulation, server):
    with Plain(server) as client:
        seen = []
        simulation.graph.subscribe("/in", seen.append, STRING)
        client.send("advertise", topic="/in", type="std_msgs/String")
        client.send("publish", topic="/in", msg={"data": "grüße 🚁"})
        until(lambda: seen)
        assert seen[0].message.data == "grüße 🚁"
        client.send("subscribe", topic="/out", type="std_msgs/String")
        client.synchronize()
        simulation.publish("/out", m.String("zurück 🛬"))
        assert client.read()["msg"] == {"data": "zurück 🛬"}


@pytest.mark.parametrize("path", ["", "/", "/rosbridge", "/some/where/else?x=1"])
def test_two_bridges_serve_one_graph_at_any_path(simulation, bridges, server, path):
    """Standard clients connect to :9090, the ancestors' to :8080/rosbridge."""
    other = RosbridgeServer(port=0)
    bridges.open(other)
    seen = []
    simulation.graph.subscribe("/in", seen.append, STRING)
    with Plain(server, path=path) as first, Plain(other, path=path) as second:
        first.send("subscribe", topic="/in", type="std_msgs/String")
        first.synchronize()
        second.send("advertise", topic="/in", type="std_msgs/String")
        second.send("publish", topic="/in", msg={"data": "across"})
        assert first.read()["msg"] == {"data": "across"}
        for client in (first, second):
            client.send("call_service", service="/rosapi/nodes", id="1")
            nodes = client.read()["values"]["nodes"]
            assert len([node for node in nodes if "rosapi" in node]) == 1
    until(lambda: len(seen) == 1)


def test_late_joiners_get_what_is_latched(simulation, server):
    simulation.publish("/map", m.String("here"), latched=True)
    with Plain(server) as client:
        client.send("subscribe", topic="/map")
        assert client.read()["msg"] == {"data": "here"}


def test_services_in_both_directions(simulation, server):
    response = m.message_type(f"{SET_BOOL}_Response")
    simulation.graph.create_service(
        "/arm", SET_BOOL, lambda request: response(request.data, "armed")
    )
    with Plain(server) as client, Plain(server) as other:
        client.send("call_service", service="/arm", args={"data": True}, id="1")
        assert client.read()["values"] == {"success": True, "message": "armed"}
        client.send("advertise_service", service="/do", type=TRIGGER)
        client.synchronize()
        other.send("call_service", service="/do", id="2")
        request = client.read()
        values = {"success": True, "message": "did"}
        client.send("service_response", service="/do", id=request["id"], values=values, result=True)
        assert other.read()["values"] == values


@pytest.mark.parametrize("compression", ["none", "cbor", "cbor-raw"])
def test_eight_megabytes_in_both_directions(simulation, server, compression):
    with Plain(server) as client:
        client.send("subscribe", topic="/image", type=IMAGE, compression=compression)
        client.synchronize()
        simulation.publish("/image", image(8_000_000))
        found = client.read(30)["msg"]
        assert len(found["bytes"] if compression == "cbor-raw" else found["data"]) >= 8_000_000
        seen = []
        simulation.graph.subscribe("/back", seen.append, IMAGE)
        client.send("advertise", topic="/back", type=IMAGE)
        operation = {"op": "publish", "topic": "/back", "msg": {"data": bytes(8_000_000)}}
        client.socket.send(cbor2.dumps(operation))
        until(lambda: seen)
        assert seen[0].message.data.shape == (8_000_000,)


def test_a_client_that_does_not_read_disturbs_no_other(simulation, server):
    with Plain(server, close_timeout=0.1) as sleeper, Plain(server) as reader:
        wanted = {"topic": "/image", "type": IMAGE, "compression": "cbor", "queue_length": 2}
        sleeper.send("subscribe", **wanted)
        sleeper.synchronize()
        reader.send("subscribe", **wanted | {"queue_length": 100})
        reader.synchronize()
        publisher = simulation.graph.advertise("/image", IMAGE)
        message = image(1_000_000)
        for _ in range(500):  # the sleeper's sockets hold some tens of megabytes
            simulation.do(lambda: publisher.publish(message))
            assert reader.read()["op"] == "publish"
            infos = {s.name: s.queues for s in simulation.gateway.sessions() if s.queues}
            dropped = sorted(queues[0].dropped for queues in infos.values())
            if dropped[1] > 20:
                break
        assert dropped[0] == 0
        assert dropped[1] > 20


def test_throttled_streams(simulation, server):
    with Plain(server) as client:
        client.send("subscribe", topic="/out", type=STRING, throttle_rate=200)
        client.synchronize()
        publisher = simulation.graph.advertise("/out", STRING)
        began = time.monotonic()
        simulation.do(lambda: publisher.publish(m.String("first")))
        assert client.read()["msg"]["data"] == "first"
        simulation.do(lambda: [publisher.publish(m.String(str(k))) for k in range(50)])
        read = [client.read()["msg"]["data"]]
        while read[-1] != "49":
            read.append(client.read()["msg"]["data"])
        assert len(read) <= (time.monotonic() - began) / 0.19
        client.send("unadvertise_service", service="/nothing", id="sync")
        assert client.read()["id"] == "sync"  # and nothing more came


def test_unknown_types_are_reported(server):
    with Plain(server) as client:
        client.send("subscribe", topic="/x", type="no_pkg/Nothing", id="s")
        status = client.read()
        assert (status["op"], status["id"]) == ("status", "s")
        assert "no_pkg/msg/Nothing" in status["msg"]


def test_a_client_that_leaves_is_forgotten(simulation, server):
    with Plain(server) as client:
        client.send("advertise_service", service="/do", type=TRIGGER)
        client.synchronize()
        assert simulation.graph.has_service("/do")
    until(lambda: not simulation.graph.has_service("/do"))
    until(lambda: [s.name for s in simulation.gateway.sessions()] == ["rosapi"])
    until(lambda: server.clients == 0)


@pytest.mark.parametrize(
    ("headers", "welcome"),
    [
        ({}, True),
        ({"Origin": "http://localhost:5173"}, True),
        ({"Origin": "http://127.0.0.1:8080"}, True),
        ({"Origin": "https://listed.example"}, True),
        ({"Origin": "https://evil.example"}, False),
        ({"Origin": "http://localhost.evil.example"}, False),
        ({"Origin": "null"}, False),
    ],
)
def test_which_origins_are_accepted(bridges, headers, welcome):
    server = RosbridgeServer(port=0, origins=["https://listed.example"])
    bridges.open(server)
    if welcome:
        with connect(url_of(server), additional_headers=headers):
            return
    with (
        pytest.raises(InvalidStatus, match="403"),
        connect(url_of(server), additional_headers=headers),
    ):
        pass


@pytest.mark.parametrize(
    ("origin", "host", "token", "welcome"),
    [
        ("http://192.168.1.5:8080", "192.168.1.5:9090", None, True),
        ("http://rebound.example", "rebound.example:9090", None, False),
        ("http://lab.example", "lab.example:9090", "secret", True),
        ("http://[::2]", "[::2]:9090", None, True),
        ("http://192.168.1.5", "192.168.1.6:9090", None, False),
    ],
)
def test_pages_from_where_they_connect_to(origin, host, token, welcome):
    assert Origins(token_needed=token is not None).let_in(origin, host) is welcome


@pytest.mark.parametrize("listed", ["null", "file://"])
def test_pages_opened_from_files(listed):
    for origin in ("null", "file://"):
        assert Origins([listed]).let_in(origin, "127.0.0.1:9090")
        assert not Origins().let_in(origin, "127.0.0.1:9090")


def test_the_token(bridges):
    server = RosbridgeServer(port=0, token="secret")
    bridges.open(server)
    with connect(f"{url_of(server)}/?token=secret") as socket:
        socket.send('{"op": "bogus"}')
        assert "unknown operation" in socket.recv(60.0)
    bearer = {"Authorization": "Bearer secret"}
    with connect(url_of(server), additional_headers=bearer) as socket:
        socket.send('{"op": "bogus"}')
        assert "unknown operation" in socket.recv(60.0)
    with connect(url_of(server)) as socket:
        socket.send('{"op": "bogus"}')
        assert "not authorized" in socket.recv(60.0)
        with pytest.raises(ConnectionClosed):
            socket.recv(60.0)
    with pytest.raises(InvalidStatus, match="401"), connect(f"{url_of(server)}/?token=no"):
        pass


def test_json_and_cbor_in_binary_frames_of_one_server(simulation, bridges):
    server = RosbridgeServer(port=0, token="secret")
    bridges.open(server)
    with connect(url_of(server)) as json_client, connect(url_of(server)) as cbor_client:
        for client, encode in ((json_client, as_binary_json), (cbor_client, cbor2.dumps)):
            client.send(encode({"op": "auth", "token": "secret"}))
            client.send(encode({"op": "subscribe", "topic": "/out", "type": STRING}))
        until(lambda: simulation.graph.subscribers("/out") == 2)
        simulation.publish("/out", m.String("seven"))
        for client in (json_client, cbor_client):
            assert json.loads(client.recv(timeout=60))["msg"] == {"data": "seven"}
    with connect(url_of(server)) as client:
        client.send(as_binary_json({"op": "subscribe", "topic": "/out"}))
        assert "not authorized" in client.recv(timeout=60)


def as_binary_json(operation) -> bytes:
    return json.dumps(operation).encode()


def test_clients_of_the_foxglove_protocol_learn_what_to_choose(server, caplog):
    for offered in (["foxglove.websocket.v1"], ["foxglove.sdk.v1", "foxglove.websocket.v1"]):
        with pytest.raises(InvalidStatus) as refused, connect(url_of(server), subprotocols=offered):
            pass
        assert refused.value.response.status_code == 400
        assert b"choose the connection 'Rosbridge'" in refused.value.response.body
    assert "choose the connection 'Rosbridge'" in caplog.text
    with connect(url_of(server), subprotocols=["rosbridge-cbor"]) as client:
        assert client.subprotocol == "rosbridge-cbor"


def test_one_path_only(bridges):
    server = RosbridgeServer(port=0, path="/rosbridge")
    bridges.open(server)
    with connect(f"{url_of(server)}/rosbridge"):
        pass
    with pytest.raises(InvalidStatus, match="404"), connect(f"{url_of(server)}/else"):
        pass


def test_bridges_that_cannot_open(bridges, server):
    with pytest.raises(BridgeError, match=f"{server.port}.*choose another"):
        bridges.open(RosbridgeServer(port=server.port))
    with pytest.raises(BridgeError, match="other machines"):
        bridges.open(RosbridgeServer("0.0.0.0", 0, token="secret"))
    with pytest.raises(BridgeError, match="token"):
        bridges.open(RosbridgeServer("0.0.0.0", 0, anywhere=True))


def test_broken_frames_end_no_connection(server):
    with Plain(server) as client, Plain(server) as other:
        for frame in ("", "[" * 50_000, b"\xff" * 100, '{"op": []}', "\ud7ff"):
            client.socket.send(frame)
            assert client.read()["level"] == "error"
        other.synchronize()


def test_half_open_sockets_and_nonsense(server):
    idle = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(20)]
    idle[0].sendall(b"\x00\xff" * 1000)
    with Plain(server) as client:
        client.synchronize()
    for half_open in idle:
        half_open.close()


# -------------------------------------------------------------------------------- our own client


@pytest.fixture
def client(server):
    client = RosbridgeClient(url_of(server), name="node", connect_timeout_s=60.0)
    yield client
    client.close()


def test_a_program_joins(simulation, client):
    seen, woken = [], threading.Event()
    simulation.graph.subscribe("/in", seen.append, "sensor_msgs/msg/LaserScan")
    client.advertise("/in", "sensor_msgs/msg/LaserScan")
    ranges = np.linspace(0, 1, 1081, dtype=np.float32)
    zero = np.zeros(0, np.float32)
    scan = m.LaserScan(m.header(5, "a"), *[0.5] * 7, ranges, zero)
    client.publish("/in", scan)
    until(lambda: seen)
    assert seen[0].message.ranges.tobytes() == ranges.tobytes()
    queue = client.subscribe("/in", wake=woken.set)
    until(lambda: simulation.graph.topics()[0].subscribers == 2)
    client.publish("/in", scan)
    assert woken.wait(60.0)
    (published,) = queue.take()
    assert published.time_ns == 5
    assert published.message.ranges.tobytes() == ranges.tobytes()
    client.unsubscribe(queue)
    until(lambda: simulation.graph.topics()[0].subscribers == 1)
    client.unadvertise("/in")
    assert client.info.publishes == ()


def ask(client, service, request=None):
    answers, done = [], threading.Event()

    def take(answer):
        answers.append(answer)
        done.set()

    client.call(service, request, ServiceReply(take, take))
    assert done.wait(60.0)
    return answers[0]


def test_its_services(simulation, client):
    simulation.graph.create_service("/do", TRIGGER, lambda _request: trigger_response(True, "sim"))
    assert ask(client, "/do").message == "sim"
    assert ask(client, "/do", m.message_type(f"{TRIGGER}_Request")()).message == "sim"
    assert isinstance(ask(client, "/none"), GraphError)
    client.create_service(
        "/mine", TRIGGER, lambda _request, reply: reply.answer(trigger_response(True, "x"))
    )
    client.create_service("/broken", TRIGGER, lambda _request, _reply: 1 / 0)
    until(lambda: simulation.graph.has_service("/broken"))
    assert ask(client, "/mine").message == "x"
    assert "ZeroDivisionError" in str(ask(client, "/broken"))
    client.destroy_service("/mine")
    until(lambda: not simulation.graph.has_service("/mine"))


def test_it_comes_back_and_announces_everything_again(simulation, bridges, hold_port):
    port = hold_port()
    first = RosbridgeServer(port=port)
    bridges.open(first)
    client = RosbridgeClient(url_of(first), name="node", connect_timeout_s=60.0)
    try:
        client.advertise("/in", STRING)
        queue = client.subscribe("/out", STRING, wake=lambda: None)
        client.create_service(
            "/mine", TRIGGER, lambda _r, reply: reply.answer(trigger_response(True, "x"))
        )
        until(lambda: simulation.graph.has_service("/mine"))
        bridges.call(first.stop())
        until(lambda: not client.connected)
        client.publish("/in", m.String("lost"))
        assert client.dropped == 1
        assert "no connection" in str(ask(client, "/mine"))
        bridges.open(RosbridgeServer(port=port))
        client.wait_until_connected(60.0)
        assert client.connections == 2
        until(lambda: simulation.graph.has_service("/mine"))
        counts = {t.name: (t.publishers, t.subscribers) for t in simulation.graph.topics()}
        assert counts == {"/in": (1, 0), "/out": (0, 1)}
        simulation.publish("/out", m.String("again"))
        until(lambda: queue.info.received)
        assert queue.take()[0].message.data == "again"
    finally:
        client.close()
    with pytest.raises(GraphError, match="is closed"):
        client.publish("/in", m.String(""))


def test_no_server_answers():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(BridgeError, match="no rosbridge server"):
            RosbridgeClient(f"ws://127.0.0.1:{port}", connect_timeout_s=0.3)
    with pytest.raises(BridgeError, match="not a rosbridge address"):
        RosbridgeClient("http://127.0.0.1")


@pytest.mark.parametrize(
    ("attempt", "words"),
    [
        (lambda c: c.subscribe("/x", "no/msg/Such", wake=print), "unknown message type"),
        (lambda c: c.subscribe("/x", wake=print), "no topic"),
        (lambda c: c.subscribe("/x", STRING, depth=0, wake=print), "depth"),
        (lambda c: c.publish("/y", m.String("")), "not advertised"),
        (lambda c: c.unadvertise("/y"), "does not publish"),
        (lambda c: c.destroy_service("/y"), "has no service"),
    ],
)
def test_what_a_program_cannot_do(client, attempt, words):
    with pytest.raises(GraphError, match=words):
        attempt(client)


# ------------------------------------------------------------------------------ clients of others


def test_roslibpy(simulation, server):
    roslibpy = pytest.importorskip("roslibpy")
    response = m.message_type(f"{SET_BOOL}_Response")
    simulation.graph.create_service(
        "/arm", SET_BOOL, lambda request: response(request.data, "armed")
    )
    seen, got = [], []
    simulation.graph.subscribe("/in", seen.append, STRING)
    ros = roslibpy.Ros("127.0.0.1", server.port)
    ros.run(timeout=60.0)
    try:
        talker = roslibpy.Topic(ros, "/in", "std_msgs/String")
        talker.publish(roslibpy.Message({"data": "from roslibpy"}))
        until(lambda: seen)
        assert seen[0].message.data == "from roslibpy"
        roslibpy.Topic(ros, "/out", "std_msgs/String").subscribe(got.append)
        until(lambda: any(t.name == "/out" and t.subscribers for t in simulation.graph.topics()))
        simulation.publish("/out", m.String("to roslibpy"))
        until(lambda: got)
        assert got[0]["data"] == "to roslibpy"
        service = roslibpy.Service(ros, "/arm", "std_srvs/SetBool")
        request = roslibpy.ServiceRequest({"data": True})
        assert service.call(request, timeout=60.0)["message"] == "armed"
        mine = roslibpy.Service(ros, "/mine", "std_srvs/Trigger")

        def answer(_request, reply):
            reply.update(success=True, message="by roslibpy")
            return True

        mine.advertise(answer)
        until(lambda: simulation.graph.has_service("/mine"))
        answers = []
        simulation.do(
            lambda: simulation.graph.call_async("/mine", None, ServiceReply(answers.append, print))
        )
        until(lambda: answers)
        assert answers[0].message == "by roslibpy"
        _ask_rosapi(roslibpy, ros)
    finally:
        ros.close()


def _ask_rosapi(roslibpy, ros):
    assert "/in" in ros.get_topics()
    assert ros.get_topic_type("/in") == STRING
    assert "/arm" in ros.get_services()
    assert ros.get_service_type("/arm") == SET_BOOL
    assert ros.get_topics_for_type("std_msgs/String") == ["/in", "/out"]
    assert "/volery" in ros.get_nodes()
    assert ros.get_message_details("geometry_msgs/Twist")["typedefs"][0]["fieldnames"] == [
        "linear",
        "angular",
    ]
    assert ros.get_service_request_details("std_srvs/SetBool")["typedefs"][0]["fieldnames"] == [
        "data"
    ]
    parameter = roslibpy.Param(ros, "/speed")
    parameter.set(3.5)
    assert parameter.get() == 3.5
    assert "/speed" in ros.get_params()
    parameter.delete()


def test_roslibpy_as_a_ros1_client(simulation, bridges):
    roslibpy = pytest.importorskip("roslibpy")
    server, got = RosbridgeServer(port=0, generation="ros1"), []
    bridges.open(server)
    simulation.publish("/stamp", m.header(3_000_000_004, "map"), latched=True)
    ros = roslibpy.Ros("127.0.0.1", server.port)
    ros.run(timeout=60.0)
    try:
        assert ros.get_time()["secs"] == 5
        assert ros.get_topic_type("/stamp") == "std_msgs/Header"
        roslibpy.Topic(ros, "/stamp", "std_msgs/Header").subscribe(got.append)
        until(lambda: got)
        assert got[0]["stamp"] == {"secs": 3, "nsecs": 4}
    finally:
        ros.close()


def _roslib_folder():
    """Returns the folder whose node_modules hold npm's roslib and ws; None where there is none."""
    named = os.environ.get("VOLERY_ROSLIB")
    folders = [Path(named)] if named else [Path("/tmp/roslibjs")]
    return next((f for f in folders if (f / "node_modules/roslib").is_dir()), None)


def test_roslib(simulation, server):
    node, folder = shutil.which("node"), _roslib_folder()
    if node is None or folder is None:
        pytest.skip("needs node, and VOLERY_ROSLIB to name a folder where `npm i roslib` was run")
    response = m.message_type(f"{SET_BOOL}_Response")
    simulation.graph.create_service(
        "/arm", SET_BOOL, lambda request: response(request.data, "armed")
    )
    goals = []
    simulation.graph.actions.create_server("/step", STEPS, goals.append)
    simulation.graph.subscribe("/echo", lambda p: echo.publish(p.message), STRING)
    echo = simulation.graph.advertise("/echoed", STRING)
    ranges = np.array([1.5, np.inf, 2.5], np.float32)
    scan = m.LaserScan(m.header(5, "a"), *[0.5] * 7, ranges, np.zeros(0, np.float32))
    simulation.publish("/scan", scan, latched=True)
    script = Path(__file__).with_name("roslib_client.mjs")
    copy = folder / "volery_roslib_client.mjs"  # imports are looked for beside the script
    shutil.copy(script, copy)
    process = subprocess.Popen(
        [node, str(copy), url_of(server)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        until(lambda: goals or process.poll() is not None, 60)
        if goals:
            goals[0].feedback(m.message_type(f"{STEPS}_Feedback")(1, 1))
            result = m.message_type(f"{STEPS}_Result")
            goals[0].succeed(result(m.message_type("simulation_interfaces/msg/Result")(1, "ok")))
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        copy.unlink()
    assert process.returncode == 0, out + err
    found = json.loads(out)
    assert found["echo"] == "grüße 🚁"
    assert found["none"] == [1.5, None, 2.5]
    assert found["cbor"] == ["Float32Array", 1.5, "Infinity", 2.5]
    assert found["png"] == [1.5, None, 2.5]
    assert found["raw"] > 40
    assert found["arm"] == {"success": True, "message": "armed"}
    assert found["mine"] == {"success": True, "message": "by roslib"}
    assert "/scan" in found["topics"]
    assert "refused" in found["failed"] or "has no server" in found["failed"]
    assert found["feedback"]["completed_steps"] == 1
    assert found["result"]["result"]["error_message"] == "ok"
    assert found["parameter"] == {"a": 1}


def transform(parent, child, x, yaw=0.0):
    turn = m.Quaternion(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    moved = m.Transform(m.Vector3(x, 0.0, 0.0), turn)
    return m.TransformStamped(m.header(5, parent), child, moved)


def test_the_tf_client_of_roslibpy(simulation, server):
    import roslibpy.tf

    fixed = [transform("uav1/base_link", "uav1/laser", 0.5)]
    simulation.publish("/tf_static", m.TFMessage(fixed), latched=True)
    moving = simulation.graph.advertise("/tf", "tf2_msgs/msg/TFMessage")
    ros = roslibpy.Ros("127.0.0.1", server.port)
    ros.run(timeout=60.0)
    seen, done = [], threading.Event()

    def fly():
        x = 0.0
        while not done.wait(0.02):
            x += 1.0
            frames = [transform("map", "uav1/base_link", x, yaw=np.pi)]
            simulation.do(lambda f=frames: moving.publish(m.TFMessage(f)))

    flying = threading.Thread(target=fly)
    flying.start()
    try:
        client = roslibpy.tf.TFClient(ros, fixed_frame="/map", angular_threshold=0.1, rate=30.0)
        client.subscribe("/uav1/laser", seen.append)
        until(lambda: len(seen) >= 3)
    finally:
        done.set()
        flying.join()
        ros.close()
    positions = [transform["translation"]["x"] for transform in seen]
    assert positions == sorted(positions)
    assert all(abs(x % 1.0 - 0.5) < 1e-9 for x in positions)  # half a metre behind, turned about
    assert abs(seen[0]["rotation"]["z"]) == pytest.approx(1.0)


def test_tf_clients_cannot_ask_for_too_much(simulation, server):
    with Plain(server) as client:
        frames = [f"f{k}" for k in range(501)]
        args = {"source_frames": frames, "target_frame": "map", "rate": 10.0}
        client.send("call_service", service="/republish_tfs", args=args)
        answer = client.read()
        assert not answer["result"]
        assert "500 at most" in str(answer["values"])


def test_a_topic_of_frames_ends_without_subscribers(simulation, server):
    with Plain(server) as client:
        args = {"source_frames": ["a"], "target_frame": "map", "rate": 10.0}
        args["timeout"] = {"sec": 0, "nanosec": 100_000_000}
        client.send("call_service", service="/republish_tfs", args=args)
        topic = client.read()["values"]["topic_name"]
        assert simulation.graph.publishers(topic) == 1
        until(lambda: simulation.graph.publishers(topic) == 0)
