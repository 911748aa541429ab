"""Native ROS 2: our bridge, and plain DDS programs in processes of their own."""

from __future__ import annotations

import base64
import socket
import struct
from collections import Counter
from types import MappingProxyType

from bridge_bench import IMAGE, STRING, TRIGGER, Bench, Client, Refused
from bridge_ros_tcp import Form
from plain_peers import take_peer
from ros2_bench import DOMAIN
from ros_tcp_client import until

from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.dds import library
from volery.bridges.ros2.environment import Ros2Environment

LATCHED = ("/map", "/plan")
_BASE_PORT, _PORTS_A_DOMAIN, _UNICAST = 7400, 250, 10  # RTPS 2.5, 9.6.2.3
_HALF = b"RTPS\2\5\1\x10" + bytes(12) + b"\x15\5\xff\xff\0\0"
_SUCCESS_AT = 4  # of a Trigger's response, behind the four bytes that name the encoding


class PeerClient(Client):
    """A plain ROS 2 node in another process."""

    def __init__(self, bench, reading):
        super().__init__()
        self._bench = bench
        self._reading = reading
        self._form = Form("ros2")
        self._kinds = {}
        self._peer = take_peer(self._receive)

    def _receive(self, report):
        self._take(report["topic"], base64.b64decode(report["data"]), report["size"])

    def _do(self, op, **fields):
        return self._peer.do(op, **fields)

    def _take(self, topic, data, total):
        if self._kinds[topic] == IMAGE:
            head = len(self._form.image_head(0))
            (size,) = struct.unpack_from("<I", data, head - 4)
            self.messages.put(size if head + size <= total < head + size + 4 else None)
        else:
            (length,) = struct.unpack_from("<I", data, 4)
            self.messages.put(data[8 : 8 + length - 1].decode())

    def advertise(self, topic, msgtype=STRING, *, latched=False):
        assert self._do("advertise", topic=topic, type=msgtype, latched=latched, wait=True)

    def publish(self, topic, text):
        self.publish_bytes(topic, text.encode())

    def publish_bytes(self, topic, data):
        self._publish(topic, self._form.string(data))

    def publish_image(self, topic, size):
        self._publish(topic, self._form.image(size))

    def _publish(self, topic, cdr):
        self._do("publish", topic=topic, data=base64.b64encode(cdr).decode())

    def subscribe(self, topic, msgtype=STRING):
        self._kinds[topic] = msgtype
        latched = topic in LATCHED
        assert self._do("subscribe", topic=topic, type=msgtype, reliable=True, latched=latched)
        self._bench.readers[topic] += 1
        until(lambda: self._bench.is_subscribed(topic))
        if not self._reading:
            self._peer.stop()

    def call(self, service):
        response = self._do("call", service=service)
        if response is None:
            raise Refused("no answer")
        data = base64.b64decode(response)
        (length,) = struct.unpack_from("<I", data, 8)
        text = data[12 : 12 + length - 1].decode()
        if not data[_SUCCESS_AT]:  # ROS 2 has no word for a failure but the response's own
            raise Refused(text)
        return text

    def call_in_vain(self, service):
        assert self._do("outlive", service=service)
        raise Refused("no server")

    def create_service(self, service):
        response = (
            None if self.their_response is None else self._form.triggered(self.their_response)
        )
        data = None if response is None else base64.b64encode(response).decode()
        assert self._do("create_service", service=service, answer=data)
        until(lambda: self._bench.is_offered(service))

    def settle(self):
        """Nothing is answered; matches are waited for when they are made."""

    def send_half_a_frame(self):
        """The beginning of an RTPS message, to all participants of the domain."""
        base = _BASE_PORT + _PORTS_A_DOMAIN * DOMAIN + _UNICAST
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            for port in range(base, base + 20):
                sock.sendto(_HALF, ("127.0.0.1", port))

    def reset(self):
        self._peer.kill()
        topics = tuple(self._kinds)
        self._end()
        # Until its lease is over the bridge counts it among the readers.
        until(lambda: not any(map(self._bench.has_stale_readers, topics)))

    def close(self):
        if self._peer is not None:
            self._peer.give_back()
            self._peer = None  # another test may use it from now on
            self._end()

    def _end(self):
        while self._kinds:
            self._bench.readers[self._kinds.popitem()[0]] -= 1


class Ros2Bench(Bench):
    """Our bridge in a domain of the test run's own."""

    cannot = MappingProxyType(
        {
            "own types": "DDS readers match the types themselves; publishers receive no error",
            "reliability": "publishers keep the last messages, so that no reader can hold them up",
            "limits": "DDS knows none",
            "listening": "participants take free ports",
            "leaving": "the bridge stands for all nodes, those that are gone too",
            "errors": "DDS carries no errors to a publisher",
        }
    )
    topics = 25  # each is discovered with four endpoints

    def __init__(self):
        super().__init__()
        self.readers = Counter()
        self.bridge = Ros2Bridge(
            Ros2Environment(domain_id=DOMAIN),
            remote_services={self.remote_service: TRIGGER},
            reliable=("/image_out",),
        )
        self.ours.bridges.open(self.bridge)

    def subscriptions(self, clients):
        """The bridge subscribes once for all."""
        return 1

    def is_subscribed(self, topic):
        """Whether a subscription has reached the graph, and the bridge's writer each reader."""
        known = any(t.name == topic and t.subscribers for t in self.ours.live.graph.topics())
        return known and self._subscribers(topic) >= self.readers[topic]

    def has_stale_readers(self, topic):
        """Whether the bridge's writer has readers that are none."""
        return self._subscribers(topic) > self.readers[topic]

    def is_offered(self, service):
        """Whether the bridge has found a server."""
        return self.bridge._shared.services._callers[service].ready

    def _subscribers(self, topic):
        outlet = self.bridge._shared.topics._outlets.get(topic)
        return 0 if outlet is None else library.subscriptions(outlet._writer._writer)

    def _connect(self, reading):
        return PeerClient(self, reading)
