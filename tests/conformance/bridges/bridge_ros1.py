"""Native ROS 1: our bridge as a node of rospy's, and plain nodes without any ROS code around it."""

from __future__ import annotations

import gc
import itertools
import shutil
from types import MappingProxyType
from xmlrpc.client import ServerProxy

import pytest
from bridge_bench import IMAGE, TRIGGER, Bench, Client, Refused
from bridge_ros_tcp import Form
from plain_tcpros import WRONG_SUM, PlainNode
from ros1_bench import shared_master
from ros_tcp_client import until

from volery.bridges.ros1.bridge import Ros1Bridge
from volery.bridges.ros1.environment import rospy_is_installed

_numbers = itertools.count(1)


class NodeClient(Client):
    """A plain node."""

    def __init__(self, master, reading, topics):
        super().__init__()
        self._form = Form("ros1")
        self._reading = reading
        self._kinds = {}
        self._known = topics
        name = f"/plain{next(_numbers)}"
        self.node = PlainNode(master.uri, name, self._take, self.errors.put)

    def advertise(self, topic, msgtype="std_msgs/msg/String", *, latched=False, md5=None):
        self.node.advertise(topic, msgtype.replace("/msg", ""), latched=latched, md5=md5)
        if md5 is None:
            until(lambda: self.node.readers(topic))

    def publish(self, topic, text):
        self.publish_bytes(topic, text.encode())

    def publish_bytes(self, topic, data):
        self.node.publish(topic, self._form.string(data))

    def publish_image(self, topic, size):
        self.node.publish(topic, self._form.image(size))

    def _is_connected(self, topic):
        """Whether our bridge has us among the readers of a topic, as it reports to every client."""
        with ServerProxy(self.node.master.lookupNode(self.node.name, "/volery")[2]) as bridge:
            found = bridge.getBusInfo(self.node.name)[2]
        return any(row[1:5] == [self.node.name, "o", "TCPROS", topic] for row in found)

    def subscribe(self, topic, msgtype="std_msgs/msg/String", *, md5=None):
        self._kinds[topic] = msgtype
        until(lambda: self._is_published(topic))
        self.node.subscribe(topic, msgtype.replace("/msg", ""), md5=md5, reading=self._reading)
        if md5 is None:
            until(lambda: self._is_connected(topic) and self._known(topic))

    def _is_published(self, topic):
        return topic in dict(self.node.master.getPublishedTopics(self.node.name, "")[2])

    def call(self, service, *, md5=None):
        until(lambda: self.node.master.lookupService(self.node.name, service)[0] == 1)
        try:
            body = self.node.call(service, TRIGGER.replace("/srv", ""), md5=md5)
        except ConnectionError as error:
            raise Refused(str(error)) from None
        return self._form.response_text(body)

    def call_in_vain(self, service):
        until(lambda: self.node.master.lookupService(self.node.name, service)[0] != 1)
        raise Refused("the master knows no server")

    def create_service(self, service):
        response = (
            None if self.their_response is None else self._form.triggered(self.their_response)
        )
        self.node.create_service(service, TRIGGER.replace("/srv", ""), response)

    def settle(self):
        """Nothing is answered; connections are waited for when they are made."""

    def send_half_a_frame(self):
        self.node.publish_raw("/in", b"\xff\0\0\0half")

    def reset(self):
        self.node.close(unregister=False)

    def close(self):
        self.node.close()

    def _take(self, topic, data):
        image = self._kinds[topic] == IMAGE
        self.messages.put(self._form.image_size(data) if image else self._form.text(data))


class Ros1Bench(Bench):
    """Our bridge to a master of the tests' own."""

    cannot = MappingProxyType(
        {
            "own types": "the master alone compares types, and only warns",
            "reliability": "in TCPROS publishers decide how messages wait",
            "limits": "TCPROS knows none",
            "listening": "nodes take free ports",
            "leaving": "the bridge stands for all nodes, those that are gone too",
            "errors": "TCPROS carries no errors to a publisher",
        }
    )
    topics = 25  # each costs both nodes several calls of the master's
    wrong_sum = WRONG_SUM

    def __init__(self):
        super().__init__()
        missing = [tool for tool in ("rosmaster",) if shutil.which(tool) is None]
        if missing or not rospy_is_installed():
            self.ours.close()
            pytest.skip("ROS 1 is not installed: see .ci/install_ros1")
        self._master = shared_master()
        self.bridge = Ros1Bridge(remote_services={self.remote_service: TRIGGER})
        self.ours.bridges.open(self.bridge)

    def subscriptions(self, clients):
        """The bridge subscribes once for all."""
        return 1

    def _connect(self, reading):
        return NodeClient(self._master, reading, self._is_subscribed)

    def close(self):
        super().close()
        gc.collect()  # rospy forgets to close sockets; the complaints belong here

    def _is_subscribed(self, topic):
        """Whether a subscription has reached the graph."""
        return any(t.name == topic and t.subscribers for t in self.ours.live.graph.topics())
