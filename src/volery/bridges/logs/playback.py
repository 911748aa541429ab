"""A log on a graph, at any of its times: forward as asked for, or somewhere else at once.

Only what somebody listens to is decoded. Who begins to listen, and everybody after a jump, gets the
last message before the present time, so that what is shown is what was the case then.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.chunks import open_chunks
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.timeline import Place, Shown, Timeline
from volery.bridges.topic_patterns import topic_filter
from volery.core.errors import GraphError, RecordingError
from volery.graph.graph import Graph, Publisher

LATCHED = ("/tf_static", "/map", "/weather", "/volery/scenario", "/robot_description")
"""Topics whose last message awaits those who subscribe later."""
LEFT_OUT = ("/clock", "/volery/player/**")
"""A graph on which a log is played has these of its own."""
HAPPENINGS = ("/events", "/volery/log", "/rosout", "/**/events")
"""Their last message is no state that still holds."""

_TF = "tf2_msgs/msg/TFMessage"
_TF_NS = 250_000_000
"""Of transforms, each message tells some: what was told for so long holds (modelling choice)."""


class PlayedTopic(NamedTuple):
    """A topic of the log."""

    name: str
    msgtype: str
    messages: int


class Playback:
    """The log at `path` on a graph; belongs to the thread of that graph.

    Raises `RecordingError` where there is no log, or no message in it.
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
        """Where on the log's line of time it is; see `timeline`."""
        self.now_ns = self.start_ns
        """What the log's own clock tells there; while a message is published, its time."""
        self.refused: dict[str, str] = {}
        """Topics that cannot be played, and why not."""
        self._place = Place(0, 0)
        self._decoder = LogDecoder()
        self._publishers: dict[int, Publisher] = {}
        self._is_latched = topic_filter(LATCHED)
        self._happens = topic_filter(HAPPENINGS)
        self._listeners: dict[str, int] = {}
        self._graph: Graph

    def open(self, graph: Graph) -> None:
        """Announce the log's topics on a graph whose time is `now_ns`."""
        self._graph = graph
        is_played = topic_filter(("/**",), LEFT_OUT)
        for channel, topic in self.log.topics.items():
            if not is_played(topic.topic):
                continue
            try:
                msgtype = self._decoder.type_of(topic)
                self._publishers[channel] = graph.advertise(
                    topic.topic, msgtype, latched=self._is_latched(topic.topic)
                )
            except GraphError as error:
                self.refused.setdefault(topic.topic, str(error))

    @cached_property
    def topics(self) -> tuple[PlayedTopic, ...]:
        """All topics of the log, by name; to count their messages takes long in a long log."""
        counts = self.log.counts()
        found = self.log.topics.items()
        return tuple(
            sorted(PlayedTopic(t.topic, t.msgtype, counts[channel]) for channel, t in found)
        )

    @property
    def problem(self) -> str:
        """What is wrong with the file; empty for a whole one."""
        return self.log.problem

    def advance(self, until_ns: int) -> bool:
        """Publish what was told up to `until_ns`, or some of it; whether that is all."""
        until_ns = min(until_ns, self.end_ns)
        shown, self._place, over = self._line.take(self._place, until_ns, self._wanted())
        self._publish(shown)
        reached_ns = until_ns if over else shown[-1].time_ns if shown else self.position_ns
        self.position_ns = max(self.position_ns, reached_ns)
        self._set_clock()
        return over

    def seek(self, time_ns: int) -> None:
        """Go to a time, to the nearest end from beyond; and show what was the case then."""
        self.position_ns = min(max(time_ns, self.start_ns), self.end_ns)
        if self.position_ns == self.start_ns:
            self._place = Place(0, 0)
        else:
            self._place = self._line.after(self.position_ns)
        self._show(self._wanted())
        self._set_clock()

    def show_to_newcomers(self) -> None:
        """Give those who have begun to listen what they would have heard last."""
        listeners = {topic.name: topic.subscribers for topic in self._graph.topics()}
        before, self._listeners = self._listeners, listeners
        fresh = {name for name, count in listeners.items() if count > before.get(name, 0)}
        if fresh:
            channels = self._publishers.items()
            self._show({c for c, p in channels if p.topic in fresh and not p.latched})
            self._set_clock()

    def close(self) -> None:
        """Close the file."""
        self.log.close()

    # ------------------------------------------------------------------------------------ inside

    def _wanted(self) -> Set[int]:
        return {c for c, publisher in self._publishers.items() if publisher.wanted}

    def _show(self, channels: Set[int]) -> None:
        """Publish what `channels` told last before the present place."""
        states = {c for c in channels if not self._happens(self._publishers[c].topic)}
        moving = {c for c in states if self._is_transform(c)}
        shown = self._line.last_before(self._place, states - moving)
        shown += self._line.since(self._place, self.position_ns - _TF_NS, moving)
        self._publish(shown)

    def _set_clock(self) -> None:
        self.now_ns = self.position_ns - self._line.shift_ns(self._place)

    def _is_transform(self, channel: int) -> bool:
        publisher = self._publishers[channel]
        return publisher.msgtype == _TF and not publisher.latched

    def _publish(self, shown: Iterable[Shown]) -> None:
        """Publish messages, each at the time that the log gives it."""
        for _, channel, record in shown:
            self.now_ns = record.time_ns
            try:
                self._publishers[channel].publish(self._decoder.decode(record).message)
            except GraphError as error:
                self.refused.setdefault(record.topic.topic, str(error))
