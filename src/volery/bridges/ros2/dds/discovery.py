"""Discovers publishers, subscriptions and services of other participants."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from typing import NamedTuple

from cyclonedds.builtin import BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.domain import DomainParticipant

from volery.bridges.ros2.dds.endpoint_info import EndpointInfo, announcements
from volery.bridges.ros2.dds.reader_thread import ReaderThread
from volery.bridges.ros2.dds.service_peers import CLIENT, why_foreign
from volery.bridges.ros2.middleware import Profile, RemotePublisher
from volery.bridges.ros2.names import ros_type, service_of, topic_of

_ALIVE = 16
"""Value DDS_ALIVE_INSTANCE_STATE."""
_REQUEST = "_Request"


_HASH = re.compile(rb"typehash=(RIHS\d+_\w+);")


class DdsEndpoint(NamedTuple):
    """A reader or writer of another participant."""

    dds_topic: str
    msgtype: str
    profile: Profile
    user_data: bytes


class Discovery:
    """Tracks the endpoints of others."""

    def __init__(self, participant: DomainParticipant, reader_thread: ReaderThread) -> None:
        self._own = participant.guid.bytes
        self._lock = threading.Lock()
        self._writers: dict[bytes, DdsEndpoint] = {}
        self._readers: dict[bytes, DdsEndpoint] = {}
        self._listeners: list[Callable[[], None]] = []
        self._sources = []
        for topic, known in (
            (BuiltinTopicDcpsPublication, self._writers),
            (BuiltinTopicDcpsSubscription, self._readers),
        ):
            source = announcements(participant, topic)
            self._sources.append(source)
            reader_thread.listen(source, self._taker(known))

    def when_changed(self, callback: Callable[[], None]) -> None:
        """Calls `callback` when others appear or leave."""
        self._listeners.append(callback)

    def publishers(self) -> list[RemotePublisher]:
        """Returns publishers of others on topics of ROS 2."""
        with self._lock:
            writers = tuple(self._writers.values())
        named = ((topic_of(w.dds_topic), w) for w in writers)
        return [
            RemotePublisher(topic, w.msgtype, w.profile, _hash_in(w.user_data))
            for topic, w in named
            if topic
        ]

    def topic_types(self) -> dict[str, str]:
        """Returns topics that others publish or subscribe to; publishers' types count first."""
        with self._lock:
            endpoints = (*self._readers.values(), *self._writers.values())
        named = ((topic_of(e.dds_topic), e.msgtype) for e in endpoints)
        return {topic: msgtype for topic, msgtype in named if topic}

    def asked_types(self) -> set[tuple[str, str]]:
        """Returns services that others call, and the types that they expect."""
        with self._lock:
            writers = tuple(self._writers.values())
        named = ((service_of(w.dds_topic), w.msgtype) for w in writers)
        return {
            (service, msgtype[: -len(_REQUEST)])
            for service, msgtype in named
            if service and msgtype.endswith(_REQUEST)
        }

    def service_types(self) -> dict[str, str]:
        """Returns services of others."""
        with self._lock:
            readers = tuple(self._readers.values())
        found = {}
        for reader in readers:
            service = service_of(reader.dds_topic)
            if service and reader.msgtype.endswith(_REQUEST):
                found[service] = reader.msgtype[: -len(_REQUEST)]
        return found

    def foreign_clients(self) -> dict[str, str]:
        """Returns services with clients that are not rmw_cyclonedds, and the reasons."""
        with self._lock:
            writers = tuple(self._writers.items())
        mark = f"{CLIENT}=".encode()
        named = ((service_of(w.dds_topic), k) for k, w in writers if mark not in w.user_data)
        return {service: why_foreign(CLIENT, key) for service, key in named if service}

    def _taker(self, known: dict[bytes, DdsEndpoint]) -> Callable[[list[EndpointInfo]], None]:
        def take(samples: list[EndpointInfo]) -> None:
            changed = False
            for sample in samples:
                alive = sample.sample_info.instance_state == _ALIVE
                if alive and sample.sample_info.valid_data:
                    changed |= self._meet(known, sample)
                elif not alive:
                    with self._lock:
                        changed |= known.pop(sample.key, None) is not None
            if changed:
                for callback in tuple(self._listeners):
                    callback()

        return take

    def _meet(self, known: dict[bytes, DdsEndpoint], met: EndpointInfo) -> bool:
        msgtype = ros_type(met.type_name or "")
        if met.participant_key == self._own or msgtype is None or met.terms is None:
            return False
        endpoint = DdsEndpoint(met.dds_topic or "", msgtype, *met.terms)
        with self._lock:
            known[met.key] = endpoint
        return True


def _hash_in(user_data: bytes) -> str | None:
    found = _HASH.search(user_data)
    return None if found is None else found[1].decode()
