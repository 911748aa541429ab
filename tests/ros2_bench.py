"""ROS 2 for tests: a domain of the test run's own, and a second participant to look from."""

from __future__ import annotations

import contextlib
import os
import queue
import socket

from ros_tcp_client import until

from volery.bridges.ros2.environment import Ros2Environment, join_ros2
from volery.bridges.ros2.middleware import Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.zero import zero_message

_RUNS, _DOMAINS_EACH = 16, 6
"""All their ports lie below those that the system gives away by itself."""
_BASE_PORT, _PORTS_A_DOMAIN = 7400, 250  # RTPS 2.5, 9.6.2.3


def _own_domains():
    """First of the domains that no other test process has, and what keeps them until this ends.

    That is a TCP socket at the first one's first port: DDS uses ports of UDP alone.
    """
    for run in range(_RUNS):
        first, lock = 1 + _DOMAINS_EACH * run, socket.socket()
        try:
            lock.bind(("127.0.0.1", _BASE_PORT + _PORTS_A_DOMAIN * first))
        except OSError:
            lock.close()
        else:
            return first, lock
    return 1 + _DOMAINS_EACH * (os.getpid() % _RUNS), None  # shared with others, at worst


DOMAIN, _DOMAIN_LOCK = _own_domains()
"""This and the five after it are the test process's own: those beside it do not see into them."""


class Other:
    """Somebody else's node `/other` in the graph."""

    def __init__(self, terms=None):
        self.participant = join_ros2(terms or Ros2Environment(domain_id=DOMAIN))
        self.node = NodeName("/", "other")
        self.participant.add_node(self.node)
        self.participant.announce()

    def subscribe(self, topic, msgtype, profile=None):
        """A queue that fills with messages."""
        received = queue.Queue()
        spec = TopicSpec(self.node, topic, msgtype, profile or Profile(depth=100))
        self.participant.reader(spec, lambda data: received.put(decode_cdr(data, msgtype)))
        return received

    def speak(self, topic, msgtype, profile=None):
        """A function that publishes; the writer is matched."""
        writer = self.participant.writer(TopicSpec(self.node, topic, msgtype, profile or Profile()))
        return writer, lambda message: writer.write(encode_cdr(message, msgtype))

    def call(self, service, srvtype, **fields):
        """Response of a service that is there, or will be soon; None where it has left."""
        caller = self.participant.caller(ServiceSpec(self.node, service, srvtype))
        request = zero_message(f"{srvtype}_Request")
        for name, value in fields.items():
            setattr(request, name, value)
        come = queue.Queue()
        with contextlib.closing(caller):
            until(lambda: caller.ready)
            caller.call(encode_cdr(request, f"{srvtype}_Request"), come.put, lambda: come.put(None))
            data = come.get(timeout=60.0)
        return None if data is None else decode_cdr(data, f"{srvtype}_Response")

    def close(self):
        self.participant.close()
