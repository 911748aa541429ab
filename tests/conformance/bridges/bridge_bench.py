"""What the cases of the bridges see: our side, a bridge, and plain clients at its other end.

A case is written once, in terms of `Bench` and `Client`. What a bridge's protocol cannot carry is
in
`Bench.cannot`, and the cases that need it are skipped with that reason.
"""

from __future__ import annotations

import contextlib
import ctypes
import queue
import socket
import struct
from collections.abc import Mapping
from types import MappingProxyType

import pytest
from live_graph import LiveGraph
from ros_tcp_client import until

from volery.bridges.bridge_host import BridgeHost
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
IMAGE = "sensor_msgs/msg/Image"
TRIGGER = "std_srvs/srv/Trigger"
LIMIT_BYTES = 12 << 20
"""Of one message, where a bridge has the setting."""
TIMEOUT_S = 600.0
_TCP_REPAIR = 19

Triggered = message_type(f"{TRIGGER}_Response")


class Refused(Exception):
    """A call that failed, in the words that reached the client."""


class Client:
    """A plain program at the other end of a bridge; adapters say how each thing is done.

    What comes is sorted into `messages` and `errors` by a thread of the adapter's; `next` and
    `error` wait for it. Services that were created respond with `their_response` by themselves,
    or never if that is None.
    """

    their_response = "from the client, übrigens"

    def __init__(self):
        self.messages = queue.Queue()
        self.errors = queue.Queue()
        self.responses = queue.Queue()

    def next(self, timeout_s=TIMEOUT_S):
        """The next message: the text of a String, the number of bytes of an Image."""
        return self.messages.get(timeout=timeout_s)

    def error(self):
        """The next complaint of our side."""
        return self.errors.get(timeout=TIMEOUT_S)

    def advertise(self, topic, msgtype=STRING, *, latched=False):
        raise NotImplementedError

    def publish(self, topic, text):
        raise NotImplementedError

    def publish_bytes(self, topic, data):
        """A String whose characters are these bytes."""
        raise NotImplementedError

    def publish_image(self, topic, size):
        raise NotImplementedError

    def subscribe(self, topic, msgtype=STRING):
        raise NotImplementedError

    def subscribe_reliably(self, topic):
        """Receive every String of a topic, however long the client dawdles."""
        raise NotImplementedError

    def call(self, service):
        """Answer of a Trigger; raises `Refused`."""
        raise NotImplementedError

    def call_in_vain(self, service):
        """Call a service that has ended; raises `Refused`."""
        self.call(service)

    def create_service(self, service):
        """Offer a Trigger."""
        raise NotImplementedError

    def settle(self):
        """Return when our side has taken in all that was sent."""
        raise NotImplementedError

    def send_half_a_frame(self):
        """Begin a frame, and say no more."""
        raise NotImplementedError

    def send_too_much(self):
        """Send or announce a message beyond the limit."""
        raise NotImplementedError

    def reset(self):
        """Die: the connection is reset (RST)."""
        raise NotImplementedError

    def sockets(self):
        """Its connections."""
        raise NotImplementedError

    def close(self):
        """Leave in good order; a second time nothing happens."""
        raise NotImplementedError


class Ours:
    """Our side of a bridge: a graph with a thread, as a simulation has it."""

    def __init__(self):
        self.live = LiveGraph()
        self.bridges = BridgeHost(self.live.gateway)

    def publisher(self, topic, msgtype=STRING, *, latched=False):
        """A function that publishes."""
        made = self.live.graph.advertise(topic, msgtype, latched=latched)
        return lambda message: self.live.do(lambda: made.publish(message))

    def burst(self, topic):
        """A function that publishes many texts, without letting bridges read in between."""
        made = self.live.graph.advertise(topic, STRING)

        def publish(texts):
            def all_at_once():
                for text in texts:
                    made.publish(String(text))
                self.live.graph.deliver()

            self.live.do(all_at_once)

        return publish

    def collect(self, topic, msgtype=STRING):
        """A list that fills with messages."""
        seen = []
        self.live.do(
            lambda: self.live.graph.subscribe(topic, lambda p: seen.append(p.message), msgtype)
        )
        return seen

    def create_service(self, service, text):
        """A Trigger that responds with a text."""
        self.live.graph.create_service(service, TRIGGER, lambda _request: Triggered(True, text))

    def call(self, service):
        """Begin to call a service; a queue that gets the response or an error."""
        come = queue.Queue()
        request = message_type(f"{TRIGGER}_Request")()

        def ask():
            self.live.graph.call_async(service, request, ServiceReply(come.put, come.put))

        self.live.do(ask)
        return come

    def wait_for_service(self, service):
        until(lambda: self.live.graph.has_service(service))

    def counts(self):
        """The participants: sessions, publishers and subscribers of used topics, services."""
        topics = {
            t.name: (t.publishers, t.subscribers)
            for t in self.live.graph.topics()
            if t.publishers or t.subscribers
        }
        return len(self.live.gateway.sessions()), topics, set(self.live.graph.services())

    def close(self):
        self.bridges.close()
        self.live.close()


class Bench:
    """A bridge that is open, and how to reach its other end."""

    cannot: Mapping[str, str] = MappingProxyType({})
    topics = 2000
    """So many at once are tried."""
    topic_in = "/in"
    topic_out = "/out"
    image_in = "/image_in"
    image_out = "/image_out"
    type_in = STRING
    type_out = STRING
    over_limit = ""
    """Word of the limit in the error that oversized frames bring."""
    remote_service = "/theirs"
    speaks_http = False
    """Whether its protocol begins with a request of HTTP."""

    def __init__(self):
        self.clients = []
        self.ours = Ours()

    def connect(self, *, reading=True):
        """A client that is connected; `reading` False: one that never reads."""
        client = self._connect(reading)
        self.clients.append(client)
        return client

    def another(self, client):
        """Another client, which must not suffer from what `client` does."""
        return self.connect() if "others" not in self.cannot else client

    def _connect(self, reading):
        raise NotImplementedError

    def subscriptions(self, clients):
        """How many subscriptions our graph sees of so many clients."""
        return clients

    def open_where_taken(self, port):
        """Open the bridge at a port that is in use."""
        raise NotImplementedError

    def message(self, text):
        """What our side publishes on `topic_out` for a client to read `text`."""
        return String(text)

    def text(self, message):
        """What a client meant with a message that came on `topic_in`."""
        return message.data

    @classmethod
    def needs(cls, *abilities):
        """Skip a case that this protocol cannot do, before anything is started."""
        for ability in abilities:
            if ability in cls.cannot:
                pytest.skip(f"{ability}: {cls.cannot[ability]}")

    def close(self):
        for client in self.clients:
            client.close()
        self.ours.close()


def taken_port():
    """A socket that listens, and its port."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(1)
    return listener, listener.getsockname()[1]


def vanish(sock):
    """End a connection without FIN and without RST, as a pulled plug does.

    Skips the test where the system does not allow it.
    """
    try:
        sock.setsockopt(socket.IPPROTO_TCP, _TCP_REPAIR, 1)
    except OSError as error:
        pytest.skip(f"sockets cannot vanish here: {error}")
    nowhere = (ctypes.c_char * 16)()  # a sockaddr of AF_UNSPEC: disconnect
    assert ctypes.CDLL(None).connect(sock.fileno(), nowhere, 16) == 0


def reset(sock, reader=None):
    """End a connection with RST; reader: a thread that waits for what comes over it."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    with contextlib.suppress(OSError):
        sock.shutdown(socket.SHUT_RD)  # the reader lets go, and only now a close is one
    if reader is not None and reader.is_alive():
        reader.join(TIMEOUT_S)
    sock.close()
