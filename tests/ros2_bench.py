"""ROS 2 for tests: a domain of the test run's own, and a second participant to look from."""

from __future__ import annotations

import os
import queue

from ros_tcp_client import until

from volery.bridges.ros2.environment import Ros2Terms, join_ros2
from volery.bridges.ros2.middleware import Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.graph.cdr import decode_cdr, encode_cdr
from volery.graph.zero import zero_message

DOMAIN = 1 + 10 * (os.getpid() % 10)
"""Test runs beside each other have ten domains each of their own, below the ports that the system
gives away by itself."""


class Other:
    """Somebody else's node `/other` in the graph."""

    def __init__(self, terms=None):
        self.participant = join_ros2(terms or Ros2Terms(domain_id=DOMAIN))
        self.node = NodeName("/", "other")
        self.participant.add_node(self.node)
        self.participant.announce()

    def hear(self, topic, msgtype, profile=None):
        """A queue that fills with messages."""
        heard = queue.Queue()
        spec = TopicSpec(self.node, topic, msgtype, profile or Profile(depth=100))
        self.participant.reader(spec, lambda data: heard.put(decode_cdr(data, msgtype)))
        return heard

    def speak(self, topic, msgtype, profile=None):
        """A function that publishes; the writer is matched."""
        writer = self.participant.writer(TopicSpec(self.node, topic, msgtype, profile or Profile()))
        return writer, lambda message: writer.write(encode_cdr(message, msgtype))

    def call(self, service, srvtype, **fields):
        """Response of a service that is there, or will be soon; None where it has left."""
        caller = self.participant.caller(ServiceSpec(self.node, service, srvtype))
        until(lambda: caller.ready)
        request = zero_message(f"{srvtype}_Request")
        for name, value in fields.items():
            setattr(request, name, value)
        come = queue.Queue()
        caller.call(encode_cdr(request, f"{srvtype}_Request"), come.put, lambda: come.put(None))
        data = come.get(timeout=10.0)
        caller.close()
        return None if data is None else decode_cdr(data, f"{srvtype}_Response")

    def close(self):
        self.participant.close()
