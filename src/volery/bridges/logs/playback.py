"""Plays a log on a graph, forward or from any of its times.

Only topics with subscribers are decoded. New subscribers, and all subscribers after a seek, receive
the last message before the current time, so that they have the state of that time.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_formats import open_chunks
from volery.bridges.logs.timeline import Shown, Timeline, TimelinePosition
from volery.bridges.topic_patterns import topic_filter
from volery.core.errors import GraphError, RecordingError
from volery.graph.graph import Graph
from volery.graph.topics import Publisher

LATCHED = ("/tf_static", "/map", "/weather", "/volery/scenario", "/robot_description")
"""Topics whose last message is sent to later subscribers."""
LEFT_OUT = ("/clock", "/volery/player/**")
"""Topics that the playing graph publishes itself."""
OF_WHOLE_FLIGHT = ("/volery/verdicts",)
"""Topics about a whole flight: their last message holds at all times."""
HAPPENINGS = ("/events", "/volery/log", "/rosout", "/**/events")
"""Topics of events, whose last message is not a state that still holds."""

_TF = "tf2_msgs/msg/TFMessage"
_TF_NS = 250_000_000
"""Each transform message has only some transforms: those of this last period hold (modelling
choice)."""


class PlayedTopic(NamedTuple):
    """A topic of the log."""

    name: str
    msgtype: str
    messages: int


class Playback:
    """Plays the log at `path` on a graph; belongs to the thread of that graph.

    Raises `RecordingError` if there is no log, or no message in it.
    """

    def __init__(self, path: Path) -> None:
        self.log = open_chunks(path)
        self._line = Timeline(self.log)
        if not self.log.chunks:
            why = f" ({self.log.problem})" if self.log.problem else ""
            self.log.close()
            raise RecordingError(f"{path}: holds no readable message{why}")
        self.start_ns, self.end_ns = self._line.start_ns, self._line.end_ns
        self.position_ns = self.start_ns
        """Position on the log's time line; see `timeline`."""
        self.now_ns = self.start_ns
        """Time of the log's own clock there; during a publication, the message's time."""
        self.refused: dict[str, str] = {}
        """Topics that cannot be played, and why not."""
        self._timeline_position = TimelinePosition(0, 0)
        self._decoder = LogDecoder()
        self._publishers: dict[int, Publisher] = {}
        self._is_latched = topic_filter(LATCHED)
        self._happens = topic_filter(HAPPENINGS)
        self._is_of_whole_flight = topic_filter(OF_WHOLE_FLIGHT)
        self._whole: set[int] = set()
        """Channels of topics about the whole flight."""
        self._listeners: dict[str, int] = {}
        self._graph: Graph

    def open(self, graph: Graph) -> None:
        """Advertises the log's topics on a graph whose time is `now_ns`.

        Publishes what holds for the whole flight.
        """
        self._graph = graph
        is_played = topic_filter(("/**",), LEFT_OUT)
        for channel, topic in self.log.topics.items():
            if not is_played(topic.topic):
                continue
            is_whole = self._is_of_whole_flight(topic.topic)
            try:
                msgtype = self._decoder.type_of(topic)
                self._publishers[channel] = graph.advertise(
                    topic.topic, msgtype, latched=is_whole or self._is_latched(topic.topic)
                )
            except GraphError as error:
                self.refused.setdefault(topic.topic, str(error))
                continue
            if is_whole:
                self._whole.add(channel)
        if self._whole:
            self._publish(self._line.last_before(self._line.end, self._whole))
            self._set_clock()

    @cached_property
    def topics(self) -> tuple[PlayedTopic, ...]:
        """Returns all topics of the log, by name; counting messages is slow for a long log."""
        counts = self.log.counts()
        found = self.log.topics.items()
        return tuple(
            sorted(PlayedTopic(t.topic, t.msgtype, counts[channel]) for channel, t in found)
        )

    @property
    def problem(self) -> str:
        """Problems of the file; empty for a whole one."""
        return self.log.problem

    def advance(self, until_ns: int) -> bool:
        """Publishes messages up to `until_ns`, or some of them.

        Returns whether all were published.
        """
        until_ns = min(until_ns, self.end_ns)
        shown, self._timeline_position, over = self._line.take(
            self._timeline_position, until_ns, self._wanted()
        )
        self._publish(shown)
        reached_ns = until_ns if over else shown[-1].time_ns if shown else self.position_ns
        self.position_ns = max(self.position_ns, reached_ns)
        self._set_clock()
        return over

    def seek(self, time_ns: int) -> None:
        """Seeks to a time within the log and publishes the state of that time."""
        self.position_ns = min(max(time_ns, self.start_ns), self.end_ns)
        if self.position_ns == self.start_ns:
            self._timeline_position = TimelinePosition(0, 0)
        else:
            self._timeline_position = self._line.after(self.position_ns)
        self._show(self._wanted())
        self._set_clock()

    def show_to_newcomers(self) -> None:
        """Sends new subscribers the last messages before the current time."""
        listeners = {topic.name: topic.subscribers for topic in self._graph.topics()}
        before, self._listeners = self._listeners, listeners
        fresh = {name for name, count in listeners.items() if count > before.get(name, 0)}
        if fresh:
            channels = self._publishers.items()
            self._show({c for c, p in channels if p.topic in fresh and not p.latched})
            self._set_clock()

    def close(self) -> None:
        """Closes the file."""
        self.log.close()

    # ------------------------------------------------------------------------------------ inside

    def _wanted(self) -> Set[int]:
        wanted = {c for c, publisher in self._publishers.items() if publisher.has_subscribers}
        return wanted - self._whole

    def _show(self, channels: Set[int]) -> None:
        """Publishes the last messages of `channels` before the current position."""
        states = {c for c in channels if not self._happens(self._publishers[c].topic)}
        moving = {c for c in states if self._is_transform(c)}
        shown = self._line.last_before(self._timeline_position, states - moving)
        shown += self._line.since(self._timeline_position, self.position_ns - _TF_NS, moving)
        self._publish(shown)

    def _set_clock(self) -> None:
        self.now_ns = self.position_ns - self._line.shift_ns(self._timeline_position)

    def _is_transform(self, channel: int) -> bool:
        publisher = self._publishers[channel]
        return publisher.msgtype == _TF and not publisher.latched

    def _publish(self, shown: Iterable[Shown]) -> None:
        """Publishes messages, each at its time in the log."""
        for _, channel, record in shown:
            self.now_ns = record.time_ns
            try:
                self._publishers[channel].publish(self._decoder.decode(record).message)
            except GraphError as error:
                self.refused.setdefault(record.topic.topic, str(error))
