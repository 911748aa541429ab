"""Tests clients in other threads: sessions, subscription queues, services in both directions."""

from __future__ import annotations

import threading

import pytest
from live_graph import HandGraph

from volery.core.errors import GraphError
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
Response = message_type(f"{TRIGGER}_Response")


@pytest.fixture
def bench():
    return HandGraph()


def quiet():
    """A wake that does nothing."""


def texts(queue):
    return [published.message.data for published in queue.take()]


def test_messages_go_in_both_directions(bench):
    session, wakes = bench.gateway.open("client"), []
    queue = session.subscribe("/out", STRING, wake=lambda: wakes.append(1))
    seen = []
    bench.graph.subscribe("/in", seen.append, STRING)
    session.advertise("/in", STRING)
    session.publish("/in", String("hello"))
    bench.graph.advertise("/out", STRING).publish(String("there"))
    assert not seen
    bench.work_off()
    assert seen[0].message.data == "hello"
    assert wakes == [1]
    assert texts(queue) == ["there"]


def test_a_queue_keeps_the_newest_and_counts_the_rest(bench):
    session = bench.gateway.open("slow")
    queue = session.subscribe("/out", STRING, depth=3, wake=quiet)
    publisher = bench.graph.advertise("/out", STRING)
    for k in range(10):
        publisher.publish(String(str(k)))
    bench.work_off()
    assert queue.info.received == 10
    assert queue.info.dropped == 7
    assert queue.info.waiting == 3
    assert texts(queue) == ["7", "8", "9"]


def test_a_reliable_queue_keeps_all(bench):
    session = bench.gateway.open("slow")
    queue = session.subscribe("/out", STRING, depth=3, reliable=True, wake=quiet)
    publisher = bench.graph.advertise("/out", STRING)
    for k in range(1000):
        publisher.publish(String(str(k)))
    bench.work_off()
    assert queue.info.dropped == 0
    assert texts(queue) == [str(k) for k in range(1000)]
    assert queue.failure is None


@pytest.mark.parametrize("limit", ["MAX_DEPTH", "MAX_RELIABLE_BYTES"])
def test_a_reliable_queue_that_overflows_says_so_and_ends(bench, monkeypatch, limit):
    monkeypatch.setattr(
        f"volery.graph.subscription_queue.{limit}", {"MAX_DEPTH": 20}.get(limit, 2000)
    )
    wakes = []
    session = bench.gateway.open("slow")
    queue = session.subscribe("/out", STRING, reliable=True, wake=lambda: wakes.append(1))
    publisher = bench.graph.advertise("/out", STRING)
    for _ in range(3):  # as long as the client takes them, any number may come
        for _ in range(19):
            publisher.publish(String("x" * 100))
        bench.work_off()
        assert len(queue.take()) == 19
    for _ in range(30):
        publisher.publish(String("x" * 100))
    bench.work_off()
    assert "reliable subscription of '/out' ended" in queue.failure
    assert queue.take() == []
    assert queue.info.dropped == 21
    assert len(wakes) > 3


def test_some_may_be_taken_and_the_rest_later(bench):
    queue = bench.gateway.open("c").subscribe("/out", STRING, wake=quiet)
    publisher = bench.graph.advertise("/out", STRING)
    for k in range(4):
        publisher.publish(String(str(k)))
    bench.work_off()
    assert [p.message.data for p in queue.take(3)] == ["0", "1", "2"]
    assert texts(queue) == ["3"]


def test_the_late_find_what_was_latched(bench):
    bench.graph.advertise("/map", STRING, latched=True).publish(String("kept"))
    bench.work_off()
    queue = bench.gateway.open("late").subscribe("/map", STRING, wake=quiet)
    assert texts(queue) == ["kept"]


def test_what_a_client_latched_goes_with_it(bench):
    session = bench.gateway.open("short")
    session.advertise("/map", STRING, latched=True)
    session.publish("/map", String("kept"))
    bench.work_off()
    session.close()
    assert texts(bench.gateway.open("late").subscribe("/map", STRING, wake=quiet)) == []


def test_a_service_of_the_simulation(bench):
    bench.graph.create_service("/do", TRIGGER, lambda _request: Response(True, "done"))
    answers, failures = [], []
    session = bench.gateway.open("caller")
    session.call("/do", None, ServiceReply(answers.append, failures.append))
    assert not answers
    bench.work_off()
    assert answers[0].message == "done"
    session.call("/nobody", None, ServiceReply(answers.append, failures.append))
    bench.work_off()
    assert "has no server" in str(failures[0])


def test_a_service_that_breaks_is_the_callers_business(bench, caplog):
    def broken(_request):
        raise ZeroDivisionError("oh")

    bench.graph.create_service("/do", TRIGGER, broken)
    failures = []
    bench.gateway.open("caller").call("/do", None, ServiceReply(print, failures.append))
    bench.work_off()
    assert "/do" in str(failures[0])
    assert "ZeroDivisionError" in caplog.text


def test_a_service_of_one_client_for_another(bench):
    server, caller = bench.gateway.open("server"), bench.gateway.open("caller")
    requests, answers, failures = [], [], []
    server.create_service("/do", TRIGGER, lambda request, reply: requests.append((request, reply)))
    caller.call("/do", None, ServiceReply(answers.append, failures.append))
    bench.work_off()
    requests[0][1].answer(Response(True, "from outside"))
    requests[0][1].answer(Response(False, "again"))
    assert [answer.message for answer in answers] == ["from outside"]
    with pytest.raises(GraphError, match="external server"):
        bench.graph.call("/do")


def test_a_server_that_leaves_fails_the_waiting_calls(bench):
    server, failures, requests = bench.gateway.open("server"), [], []
    server.create_service("/do", TRIGGER, lambda request, reply: requests.append(reply))
    bench.gateway.open("caller").call("/do", None, ServiceReply(print, failures.append))
    bench.work_off()
    server.close()
    assert "server has left" in str(failures[0])
    assert not bench.graph.has_service("/do")
    requests[0].answer(Response(True, "too late"))
    assert len(failures) == 1


def test_closing_takes_everything_back(bench):
    session = bench.gateway.open("visitor")
    session.advertise("/in", STRING)
    queue = session.subscribe("/out", STRING, wake=quiet)
    session.create_service("/do", TRIGGER, lambda request, reply: None)
    (info,) = bench.gateway.sessions()
    assert (info.name, info.publishes, info.offers) == ("visitor", ("/in",), ("/do",))
    session.close()
    session.close()
    assert bench.gateway.sessions() == []
    counts = {t.name: (t.publishers, t.subscribers) for t in bench.graph.topics()}
    assert counts == {"/in": (0, 0), "/out": (0, 0)}
    bench.graph.advertise("/out", STRING).publish(String("late"))
    bench.work_off()
    assert texts(queue) == []
    with pytest.raises(GraphError, match="has left"):
        session.advertise("/in", STRING)


@pytest.mark.parametrize(
    ("attempt", "words"),
    [
        (lambda s: s.subscribe("/x", "no/msg/Such", wake=quiet), "unknown message type"),
        (lambda s: s.subscribe("/x", wake=quiet), "no topic"),
        (lambda s: s.subscribe("/x", STRING, depth=0, wake=quiet), "depth"),
        (lambda s: s.advertise("bad name", STRING), "valid name"),
        (lambda s: s.publish("/y", String("")), "not advertised"),
        (lambda s: s.unadvertise("/y"), "does not publish"),
        (lambda s: s.destroy_service("/y"), "does not serve"),
    ],
)
def test_what_cannot_be_is_refused(bench, attempt, words):
    with pytest.raises(GraphError, match=words):
        attempt(bench.gateway.open("client"))


def test_nothing_is_lost_or_doubled_while_clients_come_and_go(bench):
    publisher = bench.graph.advertise("/out", STRING, latched=True)
    stop, problem, num_messages = threading.Event(), [], 3000

    def visit():
        while not stop.is_set():
            session = bench.gateway.open("visitor")
            queue = session.subscribe("/out", STRING, depth=num_messages, wake=quiet)
            numbers = [int(text) for text in texts(queue)]
            session.close()
            numbers += [int(text) for text in texts(queue)]
            if numbers != list(range(numbers[0], numbers[0] + len(numbers))) if numbers else False:
                problem.append(numbers)

    threads = [threading.Thread(target=visit) for _ in range(3)]
    for thread in threads:
        thread.start()
    for k in range(num_messages):
        publisher.publish(String(str(k)))
        bench.graph.deliver()
    stop.set()
    for thread in threads:
        thread.join()
    assert not problem


def test_the_last_messages_of_a_client_that_leaves_are_received(bench):
    """`volery topic pub --once` publishes and leaves, faster than a tick."""
    seen = []
    bench.graph.subscribe("/in", seen.append, STRING)
    session = bench.gateway.open("visitor")
    session.advertise("/in", STRING, latched=True)
    session.publish("/in", String("farewell"))
    session.close()
    bench.work_off()
    assert [p.message.data for p in seen] == ["farewell"]
    late = []
    bench.graph.subscribe("/in", late.append, STRING)
    bench.graph.deliver()
    assert not late


def test_uavs_that_external_clients_command_are_noted(bench, monkeypatch):
    monkeypatch.setattr("volery.graph.session._MAX_NAMES", 2)
    session, gateway = bench.gateway.open("client"), bench.gateway
    bench.graph.advertise("/uav1/inside", STRING).publish(message_type(STRING)("x"))
    bench.work_off()
    assert gateway.commanded_ns == {}
    for topic in ("/chat", "/uav1/word", "/uav2/word", "/uav1/word", "/uav3/word"):
        session.advertise(topic, STRING)
        session.publish(topic, message_type(STRING)("x"))
    session.call("/uav3/none", None, ServiceReply(lambda _: None, lambda _: None))
    bench.work_off()
    assert list(gateway.commanded_ns) == ["uav1", "uav3"]
    assert gateway.commanded_ns["uav3"] == bench.graph.now_ns()
    assert gateway.commands == 5


def test_losses_of_clients_that_left_count(bench):
    session = bench.gateway.open("slow")
    publisher = bench.graph.advertise("/fast", STRING)
    for _ in range(2):
        session.subscribe("/fast", depth=1, wake=lambda: None)
    for _ in range(4):
        publisher.publish(message_type(STRING)("x"))
    bench.work_off()
    assert bench.gateway.dropped == 6
    session.close()
    bench.gateway.open("another")
    assert bench.gateway.dropped == 6
