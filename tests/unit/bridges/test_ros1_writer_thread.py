"""Writing to ROS 1 subscribers, with sockets alone: no ROS 1 is needed."""

from __future__ import annotations

import selectors
import socket
import struct
import threading

import pytest

from volery.bridges.ros1.writer_thread import Reader, Ros1WriterThread


class Connection:
    """What rospy has for a subscriber."""

    def __init__(self, ours):
        self._ours = ours
        self.closed = False

    def fileno(self):
        return self._ours.fileno()

    def close(self):
        self.closed = True


@pytest.fixture
def pair():
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    theirs.settimeout(60.0)
    yield ours, theirs
    ours.close()
    theirs.close()


@pytest.fixture
def selector():
    with selectors.DefaultSelector() as selector:
        yield selector


def read_message(theirs):
    def exactly(count):
        data = b""
        while len(data) < count:
            data += theirs.recv(count - len(data)) or pytest.fail("the stream has ended")
        return data

    (length,) = struct.unpack("<I", exactly(4))
    return exactly(length)


def work_off(selector, seconds=0.05):
    while events := selector.select(seconds):
        for key, _ in events:
            key.data.flush()


def test_messages_arrive_whole_and_in_order(pair, selector):
    ours, theirs = pair
    reader = Reader(Connection(ours), selector)
    sent = [bytes([k]) * size for k, size in enumerate([0, 1, 300_000, 5, 70_000, 2])]
    for data in sent:
        reader.send(data)
    got = []
    reading = threading.Thread(target=lambda: got.extend(read_message(theirs) for _ in sent))
    reading.start()
    while reading.is_alive():
        work_off(selector)
    assert got == sent
    assert not selector.get_map()
    reader.close()


def test_a_stalled_reader_loses_the_middle_but_no_frame_is_torn(pair, selector):
    ours, theirs = pair
    reader = Reader(Connection(ours), selector)
    for k in range(100):
        reader.send(struct.pack("<I", k) * 250_000)
    assert reader.dropped > 50
    got = []

    def read():
        while not got or got[-1] != 99:
            data = read_message(theirs)
            assert data == data[:4] * 250_000
            got.append(struct.unpack("<I", data[:4])[0])

    reading = threading.Thread(target=read)
    reading.start()
    while reading.is_alive():
        work_off(selector)
    assert got[0] == 0
    assert got == sorted(got)
    assert len(got) == 100 - reader.dropped
    reader.close()


def test_a_reader_that_has_gone_is_given_up(pair, selector):
    ours, theirs = pair
    connection = Connection(ours)
    reader = Reader(connection, selector)
    reader.send(b"x" * 1_000_000)
    theirs.close()
    work_off(selector)
    assert connection.closed
    assert not selector.get_map()
    reader.send(b"more")
    reader.close()


def test_what_still_waits_goes_with_the_pump(pair):
    ours, theirs = pair
    pump = Ros1WriterThread()
    reader = pump.reader(Connection(ours))
    reader.send(b"x" * 1_000_000)
    pump.close()
    assert not pump._thread.is_alive()  # it waits for no reader
    reader.close()
    ours.close()
    received = 0
    while part := theirs.recv(1 << 16):
        received += len(part)
    assert received < 1_000_000


def test_one_that_breaks_leaves_the_others_alone():
    class Topic:
        def __init__(self, topic):
            self.topic = topic
            self.served = threading.Event()

        def serve(self):
            if self.topic == "/broken":
                raise ValueError("oh")
            self.served.set()

    pump, whole = Ros1WriterThread(), Topic("/whole")
    pump.waker(Topic("/broken"))()
    pump.waker(whole)()
    assert whole.served.wait(60.0)
    wake = pump.waker(whole)
    pump.close()
    wake()  # a wake that comes late
