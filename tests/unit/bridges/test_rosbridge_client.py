"""A client of rosbridge: its thread, its queues, its end."""

import queue
import threading

import pytest
from ros_tcp_client import Loop, until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import GraphError
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Request = message_type(f"{TRIGGER}_Request")
PATIENT = {"connect_timeout_s": 60.0}
"""With a busy machine."""


@pytest.fixture
def loop():
    loop = Loop()
    with BridgeHost(loop.gateway) as loop.bridges:
        yield loop
    loop.close()


@pytest.fixture
def client(loop):
    server = RosbridgeServer(port=0)
    loop.bridges.open(server)
    client = RosbridgeClient(f"ws://127.0.0.1:{server.port}", name="planner", **PATIENT)
    yield client
    client.close()


def topics(loop):
    return {t.name: t for t in loop.graph.topics()}


def test_its_thread_bears_its_name_and_ends_with_it(client):
    name = "planner-rosbridge"
    assert name in [thread.name for thread in threading.enumerate()]
    assert (client.connected, client.connections) == (True, 1)
    client.close()
    client.close()
    assert name not in [thread.name for thread in threading.enumerate()]
    assert not client.connected


def test_its_own_thread_cannot_wait_for_an_answer(loop, client):
    said = queue.Queue()

    def wake():
        try:
            client.subscribe("/other", wake=wake)
        except GraphError as error:
            said.put(str(error))

    client.subscribe("/out", STRING, wake=wake)
    until(lambda: "/out" in topics(loop))
    loop.publish(loop.graph.advertise("/out", STRING), String("come"))
    assert "give a type: the client's own thread cannot wait" in said.get(timeout=60.0)


def test_closing_it_in_its_own_thread_does_not_wait_for_itself(loop, client):
    left = threading.Event()

    def wake():
        client.close()
        left.set()

    client.subscribe("/out", STRING, wake=wake)
    until(lambda: "/out" in topics(loop))
    loop.publish(loop.graph.advertise("/out", STRING), String("go"))
    assert left.wait(60.0)
    until(lambda: "planner-rosbridge" not in [thread.name for thread in threading.enumerate()])
    with pytest.raises(GraphError, match="planner is closed"):
        client.advertise("/in", STRING)


def test_several_queues_are_one_subscription_of_the_server(loop, client):
    publisher = loop.graph.advertise("/out", STRING)
    boxes = [client.subscribe("/out", STRING, depth=d, wake=lambda: None) for d in (1, 5)]
    until(lambda: topics(loop)["/out"].subscribers)
    with pytest.raises(GraphError, match="carries std_msgs/msg/String, not std_msgs/msg/Int32"):
        client.subscribe("/out", "std_msgs/msg/Int32", wake=lambda: None)
    assert topics(loop)["/out"].subscribers == 1
    client.unsubscribe(boxes[0])
    loop.publish(publisher, String("one is left"))
    assert until(boxes[1].take)[0].message == String("one is left")
    assert not boxes[0].take()
    client.unsubscribe(boxes[1])
    until(lambda: not topics(loop)["/out"].subscribers)
    assert client.info.queues == ()


def test_calls_that_are_open_when_it_leaves_fail(loop, client):
    asked, outcome = threading.Event(), queue.Queue()
    loop.graph.create_async_service("/waits", TRIGGER, lambda _request, _reply: asked.set())
    client.call("/waits", Request(), ServiceReply(outcome.put, outcome.put))
    assert asked.wait(60.0)
    client.close()
    assert isinstance(outcome.get(timeout=60.0), GraphError)
    with pytest.raises(GraphError, match="planner is closed"):
        client.call("/waits", Request(), ServiceReply(outcome.put, outcome.put))


def test_ctrl_c_while_it_connects_leaves_no_thread(monkeypatch):
    def interrupted(_client, _timeout_s):
        raise KeyboardInterrupt

    monkeypatch.setattr(RosbridgeClient, "wait_until_connected", interrupted)
    with pytest.raises(KeyboardInterrupt):
        RosbridgeClient("ws://127.0.0.1:9", name="stopped early")
    assert not [t for t in threading.enumerate() if t.name.startswith("stopped early")]
