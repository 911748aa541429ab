"""ROS-TCP: our endpoint and a plain connector, our connector and a plain endpoint."""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import struct
import threading
from types import MappingProxyType

from bridge_bench import (
    IMAGE,
    LIMIT_BYTES,
    TIMEOUT_S,
    Bench,
    Client,
    Refused,
    reset,
)
from ros_tcp_client import frame, until

from volery.bridges.ros_tcp.connector import RosTcpConnector
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint

CDR = b"\0\1\0\0"


class Form:
    """Payloads of one generation, written by hand."""

    def __init__(self, generation):
        self.generation = generation
        self.ros2 = generation == "ros2"

    def string(self, data):
        data += b"\0" * self.ros2
        return CDR * self.ros2 + struct.pack("<I", len(data)) + data

    def text(self, payload):
        return (payload[8:-1] if self.ros2 else payload[4:]).decode()

    def image(self, size):
        return self.image_head(size) + bytes(size)

    def image_head(self, size):
        if self.ros2:
            front = struct.pack("<iII4xIII6s", 1, 2, 1, 1, size, 6, b"mono8\0")
            return CDR + front + struct.pack("<BxII", 0, size, size)
        front = struct.pack("<IIII", 0, 1, 2, 0) + struct.pack("<II", 1, size)
        return front + struct.pack("<I5sBII", 5, b"mono8", 0, size, size)

    def image_size(self, payload):
        return len(payload) - len(self.image_head(0))

    def triggered(self, text):
        if self.ros2:
            return CDR + b"\1\0\0\0" + self.string(text.encode())[4:]
        return b"\1" + self.string(text.encode())

    def response_text(self, payload):
        return payload[12:-1].decode() if self.ros2 else payload[5:].decode()

    def request(self):
        return CDR + b"\0" if self.ros2 else b""


class RosTcpPartner(Client):
    """Either end of a ROS-TCP connection: frames sorted by a thread."""

    def __init__(self, sock, form, reading):
        super().__init__()
        self.sock = sock
        self.form = form
        self.commands = queue.Queue()
        """Commands that are neither errors nor parts of services."""
        self._kinds = {}
        self._expected = None
        self._offered = set()
        self._lock = threading.Lock()
        self._reader = threading.Thread(target=self._read, daemon=True)
        if reading:
            self._reader.start()

    def send(self, *frames):
        data = b"".join(frame(*one) for one in frames)
        with self._lock:
            self.sock.sendall(data)

    def command(self, name, **fields):
        self.send((f"__{name}", json.dumps(fields).encode() + b"\0" * self.form.ros2))

    def publish(self, topic, text):
        self.publish_bytes(topic, text.encode())

    def publish_bytes(self, topic, data):
        self.send((topic, self.form.string(data)))

    def publish_image(self, topic, size):
        self.send((topic, self.form.image(size)))

    def call(self, service):
        header = json.dumps({"srv_id": 77}).encode() + b"\0" * self.form.ros2
        self.send(("__request", header), (service, self.form.request()))
        body = self.responses.get(timeout=TIMEOUT_S)
        if not body:
            raise Refused(self.error())
        return self.form.response_text(body)

    def send_half_a_frame(self):
        self.sock.sendall(frame(*("/in", self.form.string(b"never whole")))[:-3])

    def send_too_much(self):
        self.sock.sendall(struct.pack("<I", 3) + b"/in" + struct.pack("<I", 100 << 20))

    def sockets(self):
        return [self.sock]

    def reset(self):
        reset(self.sock, self._reader)

    def close(self):
        with contextlib.suppress(OSError):
            self.sock.shutdown(socket.SHUT_RDWR)
        self.sock.close()

    def _read(self):
        with contextlib.suppress(OSError, EOFError, ValueError), self.sock.makefile("rb") as file:
            while True:
                name = _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
                payload = _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
                self._sort(name.decode().rstrip("\0"), payload)

    def _sort(self, name, payload):
        if name.startswith("__"):
            fields = json.loads(payload.rstrip(b"\0"))
            if name in ("__request", "__response"):
                self._expected = (name, fields["srv_id"])
            elif name == "__error":
                self.errors.put(fields["text"])
            else:
                self._command(name, fields)
        elif name and self._expected is not None:
            kind, number = self._expected
            self._expected = None
            if kind == "__response":
                self.responses.put(payload)
            elif name in self._offered and self.their_response is not None:
                header = json.dumps({"srv_id": number}).encode() + b"\0" * self.form.ros2
                body = self.form.triggered(self.their_response)
                self.send(("__response", header), (name, body))
        elif name:
            image = self._kinds.get(name) == IMAGE
            self.messages.put(self.form.image_size(payload) if image else self.form.text(payload))

    def _command(self, name, fields):
        self.commands.put((name, fields))


def _exactly(file, count):
    data = file.read(count)
    if len(data) < count:
        raise EOFError
    return data


def _short(msgtype):
    package, _, name = msgtype.split("/")
    return f"{package}/{name}"


class PlainConnector(RosTcpPartner):
    """Plays the part of Unity's ROS-TCP-Connector."""

    def __init__(self, port, form, reading):
        sock = socket.socket()
        if not reading:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.settimeout(2 * TIMEOUT_S)
        sock.connect(("127.0.0.1", port))
        super().__init__(sock, form, reading)
        if reading:
            assert self.commands.get(timeout=TIMEOUT_S)[0] == "__handshake"

    def advertise(self, topic, msgtype="std_msgs/msg/String", *, latched=False):
        self.command("publish", topic=topic, message_name=_short(msgtype), latch=latched)

    def subscribe(self, topic, msgtype="std_msgs/msg/String"):
        self._kinds[topic] = msgtype
        self.command("subscribe", topic=topic, message_name=_short(msgtype))

    def subscribe_reliably(self, topic):
        self._kinds[topic] = "std_msgs/msg/String"
        self.command("subscribe", topic=topic, message_name="std_msgs/String", queue_size=0)

    def create_service(self, service):
        self._offered.add(service)
        self.command("unity_service", topic=service, message_name="std_srvs/Trigger")

    def settle(self):
        self.command("topic_list")
        while self.commands.get(timeout=TIMEOUT_S)[0] != "__topic_list":
            pass


class EndpointBench(Bench):
    """Our endpoint."""

    over_limit = f"{LIMIT_BYTES}"

    def __init__(self, generation):
        super().__init__()
        self.form = Form(generation)
        self.bridge = self._make(0)
        self.ours.bridges.open(self.bridge)

    def _make(self, port):
        return RosTcpEndpoint(
            port=port, generation=self.form.generation, max_payload_bytes=LIMIT_BYTES
        )

    def _connect(self, reading):
        return PlainConnector(self.bridge.port, self.form, reading)

    def open_where_taken(self, port):
        self.ours.bridges.open(self._make(port))


class PlainEndpoint(RosTcpPartner):
    """Plays the part of Unity's ROS-TCP-Endpoint, for one connection of our connector."""

    def __init__(self, sock, form, reading, sends, services):
        self._sends = sends
        self._services = services
        self._wanted = set()
        super().__init__(sock, form, reading)
        metadata = json.dumps({"protocol": form.generation.upper()})
        self.command("handshake", version="v0.7.0", metadata=metadata)

    def advertise(self, topic, msgtype="std_msgs/msg/String", *, latched=False):
        """Nothing is announced: our side subscribes to what it takes."""
        until(lambda: topic in self._wanted)

    def subscribe(self, topic, msgtype="std_msgs/msg/String"):
        """No request is needed: our side sends all that it has."""
        self._kinds[topic] = msgtype
        until(lambda: topic in self._sends or not self._reader.ident)

    def call(self, service):
        until(lambda: service in self._services)
        return super().call(service)

    def settle(self):
        """Nothing of this protocol is answered; what was sent is in the order of the socket."""

    def _command(self, name, fields):
        if name == "__publish":
            self._sends.add(fields["topic"])
        elif name == "__subscribe":
            self._wanted.add(fields["topic"])
        elif name == "__unity_service":
            self._services.add(fields["topic"])


class ConnectorBench(Bench):
    """Our connector; each client is an endpoint of its own, to which a connector of ours goes."""

    over_limit = f"{64 << 20}"
    cannot = MappingProxyType(
        {
            "services of clients": "endpoints offer none to a connector",
            "late joiners": "endpoints keep what is latched, for their own side",
            "errors": "a connector sends no errors to an endpoint; it logs what was wrong",
            "own types": "a connector names the types",
            "advertising": "endpoints announce nothing",
            "reliability": "endpoints do not subscribe",
            "listening": "it connects",
            "leaving": "endpoints stay where they are",
        }
    )

    def __init__(self):
        super().__init__()
        self.form = Form("ros1")
        self._connectors = {}
        self._listeners = []

    def subscriptions(self, clients):
        """All endpoints are sent everything."""
        return len(self.clients)

    def _connect(self, reading):
        """Serve at the port of the last one if that has died; our connector comes by itself."""
        dead = [c for c in self.clients if c.sock.fileno() == -1]
        listener = dead[-1].listener if dead else self._listen()
        sock, _ = listener.accept()
        sock.settimeout(2 * TIMEOUT_S)
        client = PlainEndpoint(sock, self.form, reading, set(), set())
        client.listener = listener
        return client

    def _listen(self):
        listener = socket.socket()
        listener.settimeout(TIMEOUT_S)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        listener.bind(("127.0.0.1", 0))
        listener.listen(1)
        self._listeners.append(listener)
        connector = RosTcpConnector(
            port=listener.getsockname()[1],
            subscribe=["/in*", "/image_in"],
            publish=["/*out*"],
            handshake_s=TIMEOUT_S,
        )
        self._connectors[listener] = connector
        self.ours.bridges.open(connector)
        return listener

    def error_of(self, client):
        """The newest note about an endpoint."""
        return self._connectors[client.listener].notes

    def close(self):
        super().close()
        for listener in self._listeners:
            listener.close()
