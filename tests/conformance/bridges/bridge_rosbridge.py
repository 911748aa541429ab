"""rosbridge: our server and plain clients in three forms, our client and a plain server."""

from __future__ import annotations

import base64
import contextlib
import itertools
import json
import queue
import socket
import threading
from types import MappingProxyType

import cbor2
from bridge_bench import (
    IMAGE,
    LIMIT_BYTES,
    STRING,
    TIMEOUT_S,
    TRIGGER,
    Bench,
    Client,
    Refused,
    Triggered,
    reset,
)
from patient_websockets import connect
from ros_tcp_client import until
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply

_numbers = itertools.count()


class RosbridgePartner(Client):
    """Either end of a rosbridge connection, over a WebSocket of the synchronous kind."""

    def __init__(self, websocket, compression, reading):
        super().__init__()
        self.websocket = websocket
        self.operations = queue.Queue()
        self._compression = compression
        self._kinds = {}
        self._offered = set()
        self.ended = threading.Event()
        if reading:
            threading.Thread(target=self.read, daemon=True).start()

    def send(self, op, **fields):
        operation = {"op": op, **fields}
        binary = self._compression != "none" and op == "publish"
        self.websocket.send(cbor2.dumps(operation) if binary else json.dumps(operation))

    def publish(self, topic, text):
        self.send("publish", topic=topic, msg={"data": text})

    def publish_bytes(self, topic, data):
        operation = {"op": "publish", "topic": topic, "msg": {"data": "@"}}
        if self._compression == "none":
            text = json.dumps(operation).encode().replace(b"@", data)
            self.websocket.send(text, text=True)
            return
        framed = cbor2.dumps(operation)
        self.websocket.send(framed.replace(b"\x61@", bytes((0x60 | len(data),)) + data))

    def publish_image(self, topic, size):
        data = bytes(size)
        if self._compression == "none":
            data = base64.b64encode(data).decode()
        fields = {"height": 1, "width": size, "encoding": "mono8", "step": size}
        self.send("publish", topic=topic, msg={**fields, "data": data})

    def call(self, service):
        self.send("call_service", service=service, type=TRIGGER, id=f"c{next(_numbers)}")
        response = self.responses.get(timeout=TIMEOUT_S)
        if not response["result"]:
            raise Refused(response["values"])
        return response["values"]["message"]

    def send_too_much(self):
        self.websocket.send("x" * (LIMIT_BYTES + 1))

    def send_half_a_frame(self):
        self.websocket.socket.sendall(b"\x81\xfe\x40\x00half")

    def sockets(self):
        return [self.websocket.socket]

    def reset(self):
        reset(self.websocket.socket)

    def close(self):
        with contextlib.suppress(OSError, ConnectionClosed):
            self.websocket.socket.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            self.websocket.socket.close()

    def read(self):
        try:
            for received in self.websocket:
                binary = isinstance(received, bytes)
                self._sort(cbor2.loads(received) if binary else json.loads(received))
        except (ConnectionClosed, OSError) as error:
            self.errors.put(str(error))
        self.ended.set()

    def _sort(self, operation):
        op = operation["op"]
        if op == "publish":
            self.messages.put(self._value(operation["topic"], operation["msg"]))
        elif op == "status":
            self.errors.put(operation["msg"])
        elif op == "service_response" and str(operation.get("id")).startswith("c"):
            self.responses.put(operation)
        elif op == "call_service" and self.their_response is None:
            return  # it never responds
        elif op == "call_service" and operation["service"] in self._offered:
            values = {"success": True, "message": self.their_response}
            response = {"service": operation["service"], "id": operation["id"]}
            self.send("service_response", **response, values=values, result=True)
        else:
            self.operations.put(operation)

    def _value(self, topic, message):
        image = self._kinds.get(topic) == IMAGE
        if "bytes" in message:  # CDR behind its header
            data = message["bytes"]
            return len(data) - 48 if image else data[8:-1].decode()
        if not image:
            return message["data"]
        data = message["data"]
        return len(base64.b64decode(data)) if isinstance(data, str) else len(data)


class PlainClient(RosbridgePartner):
    """A client of our server."""

    def advertise(self, topic, msgtype=STRING, *, latched=False):
        self.send("advertise", topic=topic, type=msgtype, latch=latched)

    def subscribe(self, topic, msgtype=STRING):
        self._kinds[topic] = msgtype
        fields = {"topic": topic, "type": msgtype, "queue_length": 10}
        self.send("subscribe", **fields, compression=self._compression)

    def subscribe_reliably(self, topic):
        self._kinds[topic] = STRING
        qos = {"reliability": "reliable", "durability": "volatile", "history": "keep_last"}
        fields = {"topic": topic, "type": STRING, "compression": self._compression}
        self.send("subscribe", **fields, qos=qos)

    def create_service(self, service):
        self._offered.add(service)
        self.send("advertise_service", service=service, type=TRIGGER)

    def settle(self):
        key = f"s{next(_numbers)}"
        self.send("unadvertise_service", service="/nothing", id=key)
        while self.operations.get(timeout=TIMEOUT_S).get("id") != key:
            pass

    def _sort(self, operation):
        if operation["op"] == "status" and str(operation.get("id")).startswith("s"):
            self.operations.put(operation)
        else:
            super()._sort(operation)


class ServerBench(Bench):
    """Our server; compression: how clients want messages."""

    over_limit = f"{LIMIT_BYTES}"
    speaks_http = True

    def __init__(self, compression):
        super().__init__()
        self._compression = compression
        self.bridge = RosbridgeServer(port=0, max_message_bytes=LIMIT_BYTES)
        self.ours.bridges.open(self.bridge)

    def _connect(self, reading):
        url = f"ws://127.0.0.1:{self.bridge.port}"
        options = {"max_size": None, "compression": None, "close_timeout": 0.1}
        return PlainClient(connect(url, **options).__enter__(), self._compression, reading)

    def open_where_taken(self, port):
        self.ours.bridges.open(RosbridgeServer(port=port))


class Program:
    """Our side where it is a program behind a `RosbridgeClient`."""

    def __init__(self, link):
        self.link = link

    def publisher(self, topic, msgtype=STRING, *, latched=False):
        self.link.advertise(topic, msgtype, latched=latched)
        return lambda message: self.link.publish(topic, message)

    def collect(self, topic, msgtype=STRING):
        seen, holder = [], []

        def wake():
            if holder:
                seen.extend(p.message for p in holder[0].take())

        holder.append(self.link.subscribe(topic, msgtype, wake=wake))
        return seen

    def create_service(self, service, text):
        self.link.create_service(
            service, TRIGGER, lambda _, reply: reply.answer(Triggered(True, text))
        )

    def call(self, service):
        come = queue.Queue()
        request = message_type(f"{TRIGGER}_Request")()
        self.link.call(service, request, ServiceReply(come.put, come.put))
        return come

    def wait_for_service(self, service):
        """The server knows it."""

    def counts(self):
        info = self.link.info
        return info.publishes, info.offers

    def close(self):
        self.link.close()


class PlainServer(RosbridgePartner):
    """A server for one program of ours: carries between it and the test."""

    def __init__(self, websocket, reading, requests):
        self._requests = requests
        super().__init__(websocket, "cbor", reading)

    def advertise(self, topic, msgtype=STRING, *, latched=False):
        until(lambda: ("subscribe", topic) in self._requests)

    def subscribe(self, topic, msgtype=STRING):
        self._kinds[topic] = msgtype
        until(lambda: ("advertise", topic) in self._requests)

    def create_service(self, service):
        self._offered.add(service)

    def call(self, service):
        until(lambda: ("advertise_service", service) in self._requests)
        return super().call(service)

    def settle(self):
        """Nothing is answered; what was sent is in the order of the socket."""

    def _sort(self, operation):
        if "subscribe" in operation["op"] or "advertise" in operation["op"]:
            self._requests.add((operation["op"], operation.get("topic", operation.get("service"))))
        else:
            super()._sort(operation)


class ClientBench(Bench):
    """Our client and a server that stands still behind it."""

    cannot = MappingProxyType(
        {
            "others": "a program has one server",
            "late joiners": "the server keeps what is latched",
            "errors": "a program notes what is wrong with its server, and reports nothing to it",
            "own types": "the program names the types",
            "advertising": "servers announce nothing to their clients",
            "reliability": "servers do not subscribe",
            "listening": "it connects",
            "leaving": "servers stay where they are",
            "limits": "what its server sends is the program's own choice",
        }
    )

    def __init__(self):
        super().__init__()
        self.ours.close()
        self._accepted = queue.Queue()
        self._done = threading.Event()
        self._server = self._serve(0)
        self._port = self._server.socket.getsockname()[1]
        self.ours = Program(
            RosbridgeClient(f"ws://127.0.0.1:{self._port}", connect_timeout_s=TIMEOUT_S)
        )

    def _serve(self, port):
        def handle(websocket):
            self._accepted.put(websocket)
            self._done.wait()

        server = serve(
            handle, "127.0.0.1", port, max_size=None, compression=None, close_timeout=0.2
        )
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return server

    def _connect(self, reading):
        return PlainServer(self._accepted.get(timeout=TIMEOUT_S), reading, set())

    def close(self):
        self.ours.close()
        for client in self.clients:
            client.close()
        self._done.set()
        self._server.shutdown()
