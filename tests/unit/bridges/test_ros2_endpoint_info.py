"""What DDS endpoints announce of themselves is read whole by any number of threads at once."""

from __future__ import annotations

import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import pytest
from cyclonedds.builtin import BuiltinTopicDcpsSubscription
from cyclonedds.pub import DataWriter
from cyclonedds.qos import _CQos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from ros2_bench import DOMAIN
from ros_tcp_client import until

from volery.bridges.ros2.dds import library
from volery.bridges.ros2.dds.domain import join_domain, leave_domain
from volery.bridges.ros2.dds.endpoint_info import (
    EndpointQos,
    announcements,
    matched_reader,
    matched_writer,
    terms_at,
)
from volery.bridges.ros2.dds.idl_types import message_struct
from volery.bridges.ros2.dds.qos import qos_of
from volery.bridges.ros2.middleware import Profile

STRING = "std_msgs/msg/String"
ENOUGH = 10_000
"""Readings in the midst of others: the package's own was wrong after 3,000, 12 times of 12."""


class Pair(NamedTuple):
    """A writer and a reader of two participants that have met."""

    writer: DataWriter
    reader: DataReader
    terms: EndpointQos


@pytest.fixture(scope="module")
def pairs():
    """Four, each of terms of its own."""
    here, there = join_domain(DOMAIN, ()), join_domain(DOMAIN, ())
    struct, made = message_struct(STRING), []
    for number in range(4):
        terms = EndpointQos(
            Profile(reliable=number % 2 == 0, latched=number >= 2),
            b"" if number == 3 else f"clientid={number};".encode() * (number + 1),
        )
        qos = qos_of(terms.profile, terms.user_data)
        writer = DataWriter(here, Topic(here, f"pair{number}", struct), qos=qos)
        reader = DataReader(there, Topic(there, f"pair{number}", struct), qos=qos)
        until(writer.get_matched_subscriptions)
        until(reader.get_matched_publications)
        made.append(Pair(writer, reader, terms))
    yield made
    made.clear()
    for participant in (here, there):
        leave_domain(DOMAIN, participant)


@pytest.fixture
def hasty():
    """Threads that take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_either_end_announces_its_own(pairs):
    for writer, reader, terms in pairs:
        (reader_handle,) = writer.get_matched_subscriptions()
        (writer_handle,) = reader.get_matched_publications()
        for found, entity in (
            (matched_reader(writer, reader_handle), reader),
            (matched_writer(reader, writer_handle), writer),
        ):
            assert found.terms == terms
            assert found.key == entity.guid.bytes
            assert found.dds_topic == entity.topic.name
            assert found.type_name == "std_msgs::msg::dds_::String_"
    assert matched_reader(pairs[0].writer, 12345) is None
    assert matched_writer(pairs[0].reader, 12345) is None


def test_threads_that_read_at_once_get_each_their_own(pairs, hasty):
    """A client took a server for a stranger's, for good, when another thread read beside it."""
    gate, reading, beside = threading.Barrier(len(pairs)), [], []
    end_s = time.monotonic() + 600.0

    def wrong(pair):
        (handle,) = pair.writer.get_matched_subscriptions()
        gate.wait()
        found = []
        while len(beside) < ENOUGH and not found and time.monotonic() < end_s:
            reading.append(None)
            terms = matched_reader(pair.writer, handle).terms
            if len(reading) > 1:
                beside.append(None)
            reading.pop()
            found += [terms] if terms != pair.terms else []
        return found

    with ThreadPoolExecutor(len(pairs)) as pool:
        assert list(pool.map(wrong, pairs)) == [[]] * len(pairs)
    assert len(beside) >= ENOUGH


@pytest.mark.parametrize("function", ["_user_data", "_reliability", "_durability"])
def test_a_reading_in_the_midst_of_another_changes_nothing(monkeypatch, function):
    ours, others = (
        EndpointQos(Profile(latched=True), b"typehash=RIHS01_1;"),
        EndpointQos(Profile(False), b""),
    )
    here, there = (_CQos.qos_to_cqos(qos_of(*terms)) for terms in (ours, others))
    original, seen = getattr(library, function), []

    def interrupted(*arguments):
        result = original(*arguments)
        if not seen:
            seen.append(None)
            seen[0] = terms_at(there)
        return result

    monkeypatch.setattr(library, function, interrupted)
    assert terms_at(here) == ours
    assert seen == [others]
    for qos in (here, there):
        _CQos.cqos_destroy(qos)


def test_an_endpoint_that_leaves_is_announced_without_terms(pairs):
    writer = pairs[0].writer
    source = announcements(writer.topic.participant, BuiltinTopicDcpsSubscription)
    there = pairs[0].reader.topic.participant
    reader = DataReader(there, Topic(there, "brief", message_struct(STRING)))
    key = reader.guid.bytes
    received = {}

    def newest():
        received.update((sample.key, sample) for sample in source.take(100))
        return received.get(key)

    assert until(newest).terms is not None
    received.clear()
    library.delete(reader)
    gone = until(newest)
    assert not gone.sample_info.valid_data
    assert (gone.terms, gone.dds_topic) == (None, None)


def test_types_are_handed_out_with_their_description():
    """Else two threads that make the first topics of a type disturb each other."""
    described = message_struct("sensor_msgs/msg/Joy").__idl__
    assert all(described._xt_bytedata)
