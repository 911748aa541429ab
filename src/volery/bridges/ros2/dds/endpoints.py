"""Publishers, subscriptions, and the two halves of services, compatible with rmw_cyclonedds."""

from __future__ import annotations

import itertools
import os
import random
import struct
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from volery.bridges.ros2.dds import library
from volery.bridges.ros2.dds.discovery_info import DiscoveryInfo
from volery.bridges.ros2.dds.endpoint_info import matched_reader, matched_writer
from volery.bridges.ros2.dds.idl_types import message_struct, request_struct
from volery.bridges.ros2.dds.qos import qos_of
from volery.bridges.ros2.dds.reader_thread import ReaderThread
from volery.bridges.ros2.dds.service_peers import CLIENT, SERVER, ServicePeers
from volery.bridges.ros2.middleware import (
    ServiceSpec,
    TakeMessage,
    TakeRequest,
    TopicSpec,
)
from volery.bridges.ros2.names import NodeName, dds_reply_topic, dds_request_topic, dds_topic
from volery.bridges.ros2.profiles import SERVICES
from volery.bridges.ros2.type_hashes import message_hash
from volery.bridges.ros2.warning_filter import WarningFilter

_HEADER = struct.Struct("<Qq")
"""rmw_cyclonedds' cdds_request_header_t: the client and the number of its request."""
_CDR_HEADER = 4
_LONGEST_WAIT_S = 0.1
_PAUSE_S = 0.001
_MAX_WAITING = 1000
"""Open requests of one client; beyond, the oldest fails."""


class DdsContext(NamedTuple):
    """Context of endpoints: the participant, its reader thread and its record."""

    participant: DomainParticipant
    reader_thread: ReaderThread
    record: DiscoveryInfo


class _Endpoint:
    """An endpoint, whose entities are created and deleted together."""

    def __init__(self, context: DdsContext, node: NodeName) -> None:
        self._context = context
        self._node = node
        self._entities: list[tuple[Any, bool]] = []
        self._topics: list[Any] = []
        self._listened: list[int] = []

    def _add_writer(self, topic: Topic, qos: Any) -> Any:
        """Adds a writer of the node."""
        return self._add(topic, DataWriter(self._context.participant, topic, qos=qos), writes=True)

    def _add_reader(self, topic: Topic, qos: Any, take: Callable[[bytes, int], None]) -> Any:
        """Adds a reader of the node.

        `take` receives the bytes of each sample and its writer's handle.
        """
        reader = DataReader(self._context.participant, topic, qos=qos)

        def take_all(samples: list[Any]) -> None:
            for sample in samples:
                if sample.sample_info.valid_data:  # else it only reports that a writer has left
                    take(sample.cdr, sample.sample_info.publication_handle)

        self._listened.append(self._context.reader_thread.listen(reader, take_all))
        return self._add(topic, reader, writes=False)

    def _add(self, topic: Topic, entity: Any, *, writes: bool) -> Any:
        self._topics.append(topic)
        self._entities.append((entity, writes))
        self._context.record.add(self._node, entity, writes=writes)
        return entity

    def close(self) -> None:
        """Deletes the entities; further calls do nothing."""
        while self._listened:
            self._context.reader_thread.forget(self._listened.pop())
        while self._entities:
            entity, writes = self._entities.pop()
            self._context.record.remove(self._node, entity, writes=writes)
            library.delete(entity)
        while self._topics:
            library.delete(self._topics.pop())


class DdsWriter(_Endpoint):
    """A publisher."""

    def __init__(self, context: DdsContext, spec: TopicSpec) -> None:
        super().__init__(context, spec.node)
        user_data = f"typehash={message_hash(spec.msgtype)};".encode()
        topic = Topic(context.participant, dds_topic(spec.topic), message_struct(spec.msgtype))
        self._writer = self._add_writer(topic, qos_of(spec.profile, user_data))

    @property
    def matched(self) -> bool:
        """Whether the topic has subscribers."""
        return library.subscriptions(self._writer) > 0

    def write(self, cdr: bytes) -> None:
        """Sends one message."""
        library.write(self._writer, cdr)


class DdsReader(_Endpoint):
    """A subscription."""

    def __init__(self, context: DdsContext, spec: TopicSpec, take: TakeMessage) -> None:
        super().__init__(context, spec.node)
        user_data = f"typehash={message_hash(spec.msgtype)};".encode()
        topic = Topic(context.participant, dds_topic(spec.topic), message_struct(spec.msgtype))
        self._add_reader(topic, qos_of(spec.profile, user_data), lambda data, _writer: take(data))


class DdsServer(_Endpoint):
    """A service server."""

    def __init__(self, context: DdsContext, spec: ServiceSpec, take: TakeRequest) -> None:
        super().__init__(context, spec.node)
        requests, replies = _topics(context, spec)
        qos = qos_of(SERVICES, _identity(SERVER))
        self._writer = self._add_writer(replies, qos)
        self._name, self._srvtype = spec.service, spec.srvtype
        self._take = take
        self._missed = (0, 0)
        self._warnings = WarningFilter()
        self._reader = self._add_reader(requests, qos, self._on_request)
        self._clients = ServicePeers(CLIENT, partial(matched_writer, self._reader))

    def look_at(self, foreign: Mapping[str, str]) -> None:
        """Warns if clients that cannot be answered call the service; foreign: reasons, by service.

        Their requests may be too short for Cyclone DDS to deliver them.
        """
        why = foreign.get(self._name)
        if why:
            self._warnings.warn(self._name, f"a client is not answered: it {why}")

    def look_at_types(self, asked: set[tuple[str, str]]) -> None:
        """Warns of clients that expect a service of another type and will not be answered."""
        for name, srvtype in asked:
            if name == self._name and srvtype != self._srvtype:
                text = f"is a {self._srvtype}; a client of {srvtype} is not answered"
                self._warnings.warn(name, text)

    def _on_request(self, data: bytes, client: int) -> None:
        problem = self._clients.problem(client)
        if problem:
            self.look_at({self._name: problem})
            return
        header = data[_CDR_HEADER : _CDR_HEADER + _HEADER.size]

        def answer(cdr: bytes) -> None:
            self._wait_for_listeners()
            library.write(self._writer, cdr[:_CDR_HEADER] + header + cdr[_CDR_HEADER:])

        self._take(_without_header(data), answer)

    def _wait_for_listeners(self) -> None:
        """Waits until the client can receive: its two halves are not discovered at once.

        rmw_cyclonedds waits too, and as long. A client that stays incomplete is waited for only
        once.
        """
        end_s = time.monotonic() + _LONGEST_WAIT_S
        while (halves := self._halves()) != self._missed and halves[0] < halves[1]:
            if time.monotonic() > end_s:
                self._missed = halves
            time.sleep(_PAUSE_S)

    def _halves(self) -> tuple[int, int]:
        """Returns how many endpoints can receive answers, and how many can send requests."""
        return library.subscriptions(self._writer), library.publications(self._reader)


class DdsCaller(_Endpoint):
    """A client of a service."""

    def __init__(self, context: DdsContext, spec: ServiceSpec) -> None:
        super().__init__(context, spec.node)
        requests, replies = _topics(context, spec)
        qos = qos_of(SERVICES, _identity(CLIENT))
        self._writer = self._add_writer(requests, qos)
        self._guid = random.SystemRandom().getrandbits(64)
        self._numbers = itertools.count(1)
        self._waiting: dict[int, tuple[TakeMessage, Callable[[], None]]] = {}
        self._lock = threading.Lock()
        self._reader = self._add_reader(replies, qos, self._on_reply)
        self._servers = ServicePeers(SERVER, partial(matched_reader, self._writer))

    @property
    def ready(self) -> bool:
        """Whether both halves of a server are connected."""
        return library.publications(self._reader) > 0 and "" in self._problems()

    @property
    def problem(self) -> str:
        """Why a connected server does not answer."""
        found = self._problems()
        return f"its server {found[0]}" if found and all(found) else ""

    def _problems(self) -> list[str]:
        return [self._servers.problem(h) for h in library.readers_of(self._writer)]

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Sends a request."""
        number = next(self._numbers)
        with self._lock:
            self._waiting[number] = (on_response, on_loss)
            lost = len(self._waiting) > _MAX_WAITING and self._waiting.pop(min(self._waiting))
        if lost:
            lost[1]()
        header = _HEADER.pack(self._guid, number)
        library.write(self._writer, request[:_CDR_HEADER] + header + request[_CDR_HEADER:])

    def give_up(self) -> None:
        """Fails all open requests if there is no server any more."""
        if self._waiting and not self.ready:
            with self._lock:
                waiting, self._waiting = tuple(self._waiting.values()), {}
            for _, on_loss in waiting:
                on_loss()

    def close(self) -> None:
        """Destroys the client."""
        super().close()
        with self._lock:
            waiting, self._waiting = tuple(self._waiting.values()), {}
        for _, on_loss in waiting:
            on_loss()

    def _on_reply(self, data: bytes, _server: int) -> None:
        guid, number = _HEADER.unpack_from(data, _CDR_HEADER)
        if guid != self._guid:
            return  # another client's
        with self._lock:
            waiting = self._waiting.pop(number, None)
        if waiting is not None:
            waiting[0](_without_header(data))


def _topics(context: DdsContext, spec: ServiceSpec) -> tuple[Topic, Topic]:
    """Returns the topics of a service's requests and replies."""
    requests = request_struct(f"{spec.srvtype}_Request")
    responses = request_struct(f"{spec.srvtype}_Response")
    return (
        Topic(context.participant, dds_request_topic(spec.service), requests),
        Topic(context.participant, dds_reply_topic(spec.service), responses),
    )


def _identity(word: str) -> bytes:
    """Returns the mark by which rmw_cyclonedds matches two halves: `clientid=1.2f. ... ;`."""
    return f"{word}={'.'.join(f'{byte:x}' for byte in os.urandom(16))};".encode()


def _without_header(data: bytes) -> bytes:
    return data[:_CDR_HEADER] + data[_CDR_HEADER + _HEADER.size :]
