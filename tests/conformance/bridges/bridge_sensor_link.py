"""The sensor link: a plain client that builds and reads frames by their table."""

from __future__ import annotations

import binascii
import contextlib
import socket
import struct
import threading
from types import MappingProxyType

from bridge_bench import IMAGE, TIMEOUT_S, Bench, Client, reset
from ros_tcp_client import until

from volery.bridges.sensor_link.server import SensorLink
from volery.graph import messages as m

SYNC = b"\xaaVLY"
_HEAD = struct.Struct("<BBHIIq")
_SONAR, _IMAGE_KIND, _NOTICE, _POSE_COMMAND = 4, 5, 127, 128


def crc(data):
    return struct.pack("<H", binascii.crc_hqx(data, 0xFFFF))


def frame(kind, uav, payload):
    head = _HEAD.pack(1, kind, uav, len(payload), 0, 5)
    body = head + crc(head) + payload
    return SYNC + body + crc(body)


def pose_command(x, frame_id=b"map"):
    text = bytes((len(frame_id),)) + frame_id
    return frame(_POSE_COMMAND, 1, struct.pack("<7d", x, 2, 3, 0, 0, 0, 1) + text)


class LinkClient(Client):
    """A connection to one of the link's two ports, or to both."""

    def __init__(self, port, image_port, reading):
        super().__init__()
        self._readers = {}
        self.sock = self._open(port, reading)
        self.images = self._open(image_port, reading)

    def _open(self, port, reading):
        sock = socket.socket()
        if not reading:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.settimeout(2 * TIMEOUT_S)
        sock.connect(("127.0.0.1", port))
        if reading:
            self._readers[sock] = threading.Thread(target=self._read, args=(sock,), daemon=True)
            self._readers[sock].start()
        return sock

    def advertise(self, topic, msgtype="", *, latched=False):
        """Nothing is announced."""

    def subscribe(self, topic, msgtype=""):
        """Everything comes."""

    def publish(self, topic, text):
        self.sock.sendall(pose_command(float(text)))

    def publish_bytes(self, topic, data):
        self.sock.sendall(pose_command(1.0, data))

    def settle(self):
        """Frames of no known type are reported, in the order of arrival."""
        self.sock.sendall(frame(200, 1, b""))
        while "type 200" not in self.error():
            pass

    def send_unknown_type(self):
        self.sock.sendall(frame(99, 1, b""))

    def send_half_a_frame(self):
        self.sock.sendall(pose_command(1.0)[:-9])

    def send_too_much(self):
        head = _HEAD.pack(1, _POSE_COMMAND, 1, 1 << 19, 0, 5)
        self.sock.sendall(SYNC + head + crc(head))

    def sockets(self):
        return [self.sock, self.images]

    def reset(self):
        for sock in (self.images, self.sock):
            reset(sock, self._readers.get(sock))

    def close(self):
        for sock in (self.sock, self.images):
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _read(self, sock):
        with contextlib.suppress(OSError, EOFError), sock.makefile("rb") as file:
            while True:
                head = self._exactly(file, 26)
                assert head[:4] == SYNC
                _, kind, _, length, _, _ = _HEAD.unpack(head[4:24])
                payload = self._exactly(file, length)
                assert self._exactly(file, 2) == crc(head[4:] + payload)
                if kind == _NOTICE:
                    self.errors.put(payload.decode())
                elif kind == _SONAR:
                    self.messages.put(f"{struct.unpack_from('<B5f', payload)[4]:.0f}")
                elif kind == _IMAGE_KIND:
                    self.messages.put(struct.unpack_from("<3IBI", payload)[4])

    @staticmethod
    def _exactly(file, count):
        data = file.read(count)
        if len(data) < count:
            raise EOFError
        return data


class SensorLinkBench(Bench):
    """Our end of the link; numbers stand for texts."""

    topic_in, topic_out = "/uav1/pose_command", "/uav1/range"
    type_in, type_out = m.PoseStamped, m.Range
    image_out = "/uav1/camera/image_raw"
    over_limit = "4096"
    cannot = MappingProxyType(
        {
            "texts": "its frames have a fixed form, with numbers",
            "services": "it has none",
            "services of clients": "it has none",
            "late joiners": "nothing is latched",
            "large messages in": "only poses go in",
            "topics": "its frames name UAVs, not topics",
            "reliability": "its streams keep the newest",
            "advertising": "clients announce nothing",
        }
    )

    def __init__(self):
        super().__init__()
        self.bridge = SensorLink(port=0, image_port=0)
        self.ours.bridges.open(self.bridge)
        self._ranges = self.ours.live.graph.advertise(self.topic_out, m.Range)
        self._images = self.ours.live.graph.advertise(self.image_out, IMAGE)

    def subscriptions(self, clients):
        """The bridge subscribes once for all."""
        return 1

    def _connect(self, reading):
        client = LinkClient(self.bridge.port, self.bridge.image_port, reading)
        addresses = {f"127.0.0.1:{s.getsockname()[1]}" for s in (client.sock, client.images)}
        until(lambda: addresses <= {info.name.split()[-1] for info in self.bridge.clients})
        until(lambda: self._ranges.has_subscribers and self._images.has_subscribers)
        return client

    def open_where_taken(self, port):
        self.ours.bridges.open(SensorLink(port=port, image_port=0))

    def message(self, text):
        return m.Range(m.header(5, "uav1/range"), 0, 0.5, 0.125, 8.0, float(text), 0.0)

    def text(self, message):
        return f"{message.pose.position.x:.0f}"
