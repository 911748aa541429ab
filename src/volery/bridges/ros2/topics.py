"""Shares topics between a simulation and a ROS 2 graph, in both directions."""

from __future__ import annotations

import fnmatch
from typing import Any

from volery.bridges.ros2.middleware import Handle, Participant, Profile, RemotePublisher, TopicSpec
from volery.bridges.ros2.names import NodeName, check_name
from volery.bridges.ros2.outgoing_topic import Ros2OutgoingTopic
from volery.bridges.ros2.profiles import common_profile, profile_of
from volery.bridges.ros2.type_hashes import message_hash
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.bridges.shared_names import SharedNames
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.session import Session
from volery.graph.topics import TopicInfo


class Ros2Topics:
    """Holds the shared topics; `survey` updates them, in one thread at a time."""

    def __init__(
        self,
        participant: Participant,
        session: Session,
        sharing: SharedNames,
        reliable: tuple[str, ...],
        node: NodeName,
        worker: Ros2WriterThread,
    ) -> None:
        self._participant = participant
        self._session = session
        self._sharing = sharing
        self._reliable = reliable
        self._node = node
        self._worker = worker
        self._outlets: dict[str, Ros2OutgoingTopic] = {}
        self._inlets: dict[str, tuple[Profile, Handle]] = {}
        self._warnings = WarningFilter()

    @property
    def dropped(self) -> dict[str, int]:
        """Number of messages that were not sent in time, by topic, without zeros."""
        counts = {name: outlet.dropped for name, outlet in tuple(self._outlets.items())}
        return {name: count for name, count in counts.items() if count}

    def survey(self) -> None:
        """Shares new topics and removes old ones."""
        remote: dict[str, list[RemotePublisher]] = {}
        for publisher in self._participant.publishers():
            remote.setdefault(publisher.topic, []).append(publisher)
        for topic in self._session.graph.topics():
            if self._sharing.has(topic.name):
                known = remote.get(topic.name, [])
                self._warnings.tried(topic.name, lambda t=topic, k=known: self._update(t, k))  # type: ignore[misc]

    def _update(self, topic: TopicInfo, remote: list[RemotePublisher]) -> None:
        check_name(topic.name)
        others = self._publishers(topic)
        self._update_outlet(topic, others)
        self._update_inlet(topic, others, remote)

    def close(self) -> None:
        """Removes all topics; after the writer's end."""
        for _, inlet in self._inlets.values():
            inlet.close()
        for outlet in self._outlets.values():
            outlet.close()

    def _publishers(self, topic: TopicInfo) -> int:
        """Returns the number of other publishers of a topic in the graph."""
        return topic.publishers - (self._session.published_type(topic.name) is not None)

    def _update_outlet(self, topic: TopicInfo, publishers: int) -> None:
        outlet = self._outlets.get(topic.name)
        if not publishers:
            if outlet is not None:
                del self._outlets[topic.name]
                self._worker.post(outlet.close)
            return
        profile = profile_of(topic.name, topic.msgtype, latched=topic.latched)
        if any(fnmatch.fnmatch(topic.name, pattern) for pattern in self._reliable):
            profile = profile._replace(reliable=True)
        spec = TopicSpec(self._node, topic.name, topic.msgtype, profile)
        if outlet is not None and outlet.spec != spec:
            self._worker.post(outlet.close)
            outlet = None
        if outlet is None:
            outlet = Ros2OutgoingTopic(self._participant, self._session, self._worker, spec)
            self._outlets[topic.name] = outlet
        outlet.adapt()

    def _update_inlet(
        self, topic: TopicInfo, publishers: int, remote: list[RemotePublisher]
    ) -> None:
        name, outlet = topic.name, self._outlets.get(topic.name)
        subscribers = topic.subscribers - (outlet is not None and outlet.is_subscribed)
        known = self._inlets.get(name)
        if not self._sharing.takes(name, publishers, subscribers):
            if known is not None:
                del self._inlets[name]
                known[1].close()
                if self._session.published_type(name) is not None:
                    self._session.unadvertise(name)
            return
        profile = common_profile([p.profile for p in remote if p.msgtype == topic.msgtype])
        self._look_at(topic, remote)
        if known is not None and known[0] == profile:
            return
        if known is not None:
            known[1].close()
        spec = TopicSpec(self._node, name, topic.msgtype, profile)
        self._inlets[name] = profile, self._participant.reader(spec, self._receive(topic, profile))

    def _look_at(self, topic: TopicInfo, remote: list[RemotePublisher]) -> None:
        """Warns of publishers with incompatible types."""
        for publisher in remote:
            if publisher.msgtype != topic.msgtype:
                text = f"carries {topic.msgtype}; a publisher of {publisher.msgtype} is ignored"
                self._warnings.warn(topic.name, text)
            elif publisher.type_hash not in (None, message_hash(topic.msgtype)):
                text = f"a publisher has another definition of {topic.msgtype}"
                self._warnings.warn(topic.name, f"{text} ({publisher.type_hash})")

    def _receive(self, topic: TopicInfo, profile: Profile) -> Any:
        name, msgtype = topic.name, topic.msgtype

        def receive(data: bytes) -> None:
            try:
                message = decode_cdr(data, msgtype)
                outlet = self._outlets.get(name)
                if outlet is not None:
                    outlet.leave_out(message)
                self._session.advertise(name, msgtype, latched=profile.latched)
                self._session.publish(name, message)
            except GraphError as error:
                self._warnings.warn(name, str(error))

        return receive
