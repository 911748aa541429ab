"""Endpoints over DDS when other threads close them, or what is due beside them fails."""

from __future__ import annotations

import queue

import pytest
from ros2_bench import DOMAIN, Other
from ros_tcp_client import until

from volery.bridges.ros2.environment import Ros2Environment
from volery.bridges.ros2.middleware import ServiceSpec
from volery.graph.messages import String

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"


@pytest.fixture
def two():
    """Two participants."""
    made = [Other(Ros2Environment(domain_id=DOMAIN)) for _ in range(2)]
    yield made
    for one in made:
        one.close()


def test_a_client_that_is_closed_is_not_ready_and_in_no_problem(two):
    """The participant's thread looks at it at any time."""
    here, there = two
    there.participant.server(ServiceSpec(there.node, "/do", TRIGGER), lambda _data, _answer: None)
    caller = here.participant.caller(ServiceSpec(here.node, "/do", TRIGGER))
    until(lambda: caller.ready)
    caller.close()
    assert not caller.ready
    assert caller.problem == ""


def test_a_failing_periodic_task_does_not_end_receiving(two, caplog):
    here, there = two
    failed = queue.Queue()

    def fail():
        failed.put(None)
        raise RuntimeError("no such luck")

    received = here.subscribe("/in", STRING)
    here.participant._reader_thread._now_and_then = fail
    for _ in range(2):
        failed.get(timeout=60.0)
    assert "no such luck" in caplog.text
    writer, publish = there.speak("/in", STRING)
    until(lambda: writer.matched)
    publish(String("still there"))
    assert received.get(timeout=60.0).data == "still there"
