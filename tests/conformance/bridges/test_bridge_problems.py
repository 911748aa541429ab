"""Clients that die, stand still, flood and talk nonsense: a clear error to them, no harm to others.

`still_served` is what no harm means: another client's messages pass in both directions.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import itertools
import resource
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
from bridge_bench import IMAGE, STRING, TIMEOUT_S, Refused, taken_port, vanish
from ros_tcp_client import until

from volery.core.errors import VoleryError
from volery.graph import messages as m

_numbers = itertools.count(100)
NOT_UTF8 = b"\xff\xfe\x80"
STEP = 500_000
STEPS = 200
QUICK_PROBES = {"TCP_KEEPIDLE": 1, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 3}
MAX_GROWTH_BYTES = 60e6
"""Of a hundred megabytes published while a client does not read."""


class Served:
    """A client that takes part in both directions, and can show that it still does."""

    def __init__(self, bench, client):
        self._bench, self.client = bench, client
        self._publish = bench.ours.publisher(bench.topic_out, bench.type_out)
        self._seen = bench.ours.collect(bench.topic_in, bench.type_in)
        client.advertise(bench.topic_in)
        client.subscribe(bench.topic_out)
        client.settle()

    def check(self):
        """Send a number each way and wait for both."""
        text = f"{next(_numbers)}"
        self._publish(self._bench.message(text))
        self.client.publish(self._bench.topic_in, text)
        while self.client.next() != text:
            pass
        until(lambda: any(self._bench.text(one) == text for one in self._seen[-2000:]))


@pytest.fixture
def others(bench, client):
    """Somebody else, or the client itself where a bridge has one partner only."""
    return Served(bench, bench.another(client))


@pytest.mark.needs("leaving")
def test_a_client_that_leaves_withdraws_everything(bench):
    bench.ours.collect(bench.topic_in, bench.type_in)
    before = bench.ours.counts()
    client = bench.connect()
    client.advertise(bench.topic_in)
    client.subscribe(bench.topic_out)
    if "services of clients" not in bench.cannot:
        client.create_service("/mine")
    client.settle()
    assert bench.ours.counts() != before
    client.close()
    until(lambda: bench.ours.counts() == before)


def test_a_client_comes_back_after_its_sudden_death(bench, client):
    served = Served(bench, client)
    served.check()
    client.reset()
    served.client = again = bench.connect()
    again.advertise(bench.topic_in)
    again.subscribe(bench.topic_out)
    again.settle()
    served.check()


@pytest.mark.needs("leaving", "others")
def test_a_silent_client_counts_as_gone(bench, others):
    """A client that closes its half of the connection has left, whatever it would still read."""
    others.check()
    before = bench.ours.counts()
    client = bench.connect()
    client.advertise(bench.topic_in)
    client.subscribe(bench.topic_out)
    client.settle()
    for sock in client.sockets():
        sock.shutdown(socket.SHUT_WR)
    until(lambda: bench.ours.counts() == before)
    others.check()


@pytest.mark.needs("leaving", "others")
@pytest.mark.parametrize("talking", [True, False])
def test_a_client_that_vanished_is_detected(bench, others, monkeypatch, talking):
    """Neither FIN nor RST came: detected by what is sent to it, or by a keepalive."""
    monkeypatch.setattr("volery.core.network_access.PROBES", QUICK_PROBES)
    others.check()
    before = bench.ours.counts()
    client = bench.connect()
    client.advertise(bench.topic_in)
    client.subscribe(bench.topic_out)
    client.settle()
    for sock in client.sockets():
        vanish(sock)
    assert bench.ours.counts() != before
    if talking:
        others.check()
    until(lambda: bench.ours.counts() == before)
    others.check()


@pytest.mark.needs("others")
def test_half_a_frame_and_silence_harm_no_client(bench, client, others):
    bench.ours.collect("/in")
    if "topics" not in bench.cannot:
        client.advertise("/in")
    client.send_half_a_frame()
    others.check()
    client.reset()
    others.check()


@pytest.mark.needs("others")
def test_a_client_that_does_not_read_costs_bounded_memory(bench, others):
    publish = bench.ours.publisher(bench.image_out, IMAGE)
    sleeper = bench.connect(reading=False)
    for one in (sleeper, others.client):
        one.subscribe(bench.image_out, IMAGE)

    def send(count):
        for _ in range(count):
            number = next(_numbers)
            header, data = m.header(number * 10**6, ""), np.full(STEP, number % 256, np.uint8)
            publish(m.message_type(IMAGE)(header, 1, STEP, "mono8", 0, STEP, data))
            assert others.client.next() == STEP

    others.client.settle()
    until(lambda: subscribers(bench) == bench.subscriptions(2))
    send(30)
    before = resident_bytes()
    send(STEPS)
    until(lambda: resident_bytes() - before < MAX_GROWTH_BYTES)  # what is on its way passes
    others.check()


def subscribers(bench):
    """How many subscribe to the images in our graph."""
    topics = bench.ours.live.graph.topics()
    return sum(t.subscribers for t in topics if t.name == bench.image_out)


def resident_bytes():
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)  # what earlier tests have left would hide growth
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


@pytest.mark.needs("own types")
def test_unknown_types_are_reported(bench, client, others):
    if hasattr(client, "send_unknown_type"):
        client.send_unknown_type()
        assert "type 99" in client.error()
    else:
        client.advertise("/x", "no_pkg/msg/Nothing")
        assert "no_pkg" in client.error()
        client.subscribe("/x", "no_pkg/msg/Nothing")
        assert "no_pkg" in client.error()
    others.check()
    client.settle()


def test_text_that_is_not_utf8_is_reported(bench, client, others):
    if client is not others.client:
        client.advertise(bench.topic_in)
    client.publish_bytes(bench.topic_in, NOT_UTF8)
    if "errors" not in bench.cannot:
        error = client.error()
        assert "utf-8" in error.lower() or "invalid start byte" in error
    others.check()
    assert not any("\ufffd" in str(vars(one)) for one in others._seen)


@pytest.mark.needs("limits", "others")
def test_a_frame_over_the_limit_is_reported_with_the_limit(bench, client, others):
    client.send_too_much()
    if "errors" in bench.cannot:
        until(lambda: any(bench.over_limit in note for note in bench.error_of(client)))
    else:
        assert bench.over_limit in client.error()
    others.check()


@pytest.mark.needs("others")
def test_a_flood_of_one_client_delays_no_other(bench, client, others):
    flooded = bench.ours.collect(bench.topic_in, bench.type_in)
    client.advertise(bench.topic_in)
    stop = threading.Event()

    def flood():
        while not stop.is_set():
            client.publish(bench.topic_in, "7")

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        until(lambda: len(flooded) > 100)
        for _ in range(
            7
        ):  # the flood itself never ends: a client that waited for its end would fail
            others.check()
    finally:
        stop.set()
        thread.join()
    others.check()


def test_wrong_sums_are_reported(bench, client, others):
    wrong = getattr(bench, "wrong_sum", None)
    if wrong is None:
        pytest.skip("sums: only ROS 1 names types with them")
    publish = bench.ours.publisher("/sum")
    client.subscribe("/sum", md5=wrong)
    assert "md5" in client.error()
    bench.ours.create_service("/summed", "x")
    with pytest.raises(Refused, match="md5"):
        client.call("/summed", md5=wrong)
    client.advertise("/sum_in", STRING, md5=wrong)
    seen = bench.ours.collect("/sum_in")
    publish(m.String("x"))
    others.check()
    assert not seen


@pytest.mark.needs("listening")
def test_a_port_in_use_is_named(bench):
    listener, port = taken_port()
    with listener, pytest.raises(VoleryError, match=f"{port}"):
        bench.open_where_taken(port)


@pytest.mark.needs("listening")
def test_clients_of_another_protocol_harm_no_client(bench, others):
    socks = []
    for words in (
        b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        b"\x16\x03\x01\x02\0",
        bytes(5),
        b"\xff" * 900,
    ):
        socks.append(socket.create_connection(("127.0.0.1", bench.bridge.port)))
        socks[-1].sendall(words)
    others.check()
    for sock in socks:
        sock.close()
    others.check()


@pytest.mark.needs("listening")
@pytest.mark.parametrize("words", [b"POST / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x16\x03\x01\x02\0"])
def test_web_pages_and_tls_are_sent_away(bench, others, words):
    sock = socket.create_connection(("127.0.0.1", bench.bridge.port), TIMEOUT_S)
    with sock, contextlib.suppress(ConnectionError):
        for byte in words:
            sock.sendall(bytes((byte,)))
        if bench.speaks_http:  # which waits for the end of a line, up to a deadline
            sock.shutdown(socket.SHUT_WR)
        while sock.recv(4096):
            pass
    others.check()


@pytest.mark.needs("listening", "others")
def test_half_open_connections_keep_no_client_out(bench, others):
    """More than may be unproven at once; those that are there already notice nothing."""
    idle = [socket.create_connection(("127.0.0.1", bench.bridge.port)) for _ in range(100)]
    again = Served(bench, bench.connect())
    again.check()
    others.check()
    for sock in idle:
        sock.close()
