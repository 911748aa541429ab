"""Records topics of the graph by patterns, started and stopped during a run.

    recorder = Recorder(graph, create_log("scans.mcap"), topics=("/uav*/laser/**",))
    gateway.post(recorder.start).result()
    ...
    gateway.post(recorder.stop).result()

Latched messages published before come first, with the time of the start. A log that cannot be
written any further ends its recording, never the simulation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from volery.bridges.logs.log_writer import LogWriter
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.core.errors import RecordingError
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.topics import Subscription


@dataclass(frozen=True)
class RecordingInfo:
    """State of a recording."""

    path: str
    running: bool
    messages: int
    """Messages received; after a failure the log has the number of readable ones."""
    failure: str
    """Why it ended by itself; empty if it did not."""


class Recorder:
    """Records a graph. Methods belong to the simulation's thread; others use `Gateway.post`.

    Parameters
    ----------
    graph
        Graph to record.
    log
        Log to write; `stop` closes it.
    topics, exclude
        See `recorded_topics`. Raises `GraphError` for an invalid pattern.
    max_bytes
        Size of the log beyond which the recording ends with a failure; None: unlimited.

    """

    def __init__(
        self,
        graph: Graph,
        log: LogWriter,
        topics: Iterable[str] = (),
        exclude: Iterable[str] = (),
        max_bytes: int | None = None,
    ) -> None:
        self._graph = graph
        self.log = log
        self._max_bytes = max_bytes
        self._matches = recorded_topics(graph, topics, exclude)
        self._subscription: Subscription | None = None
        self._ended = False
        self._messages = 0
        self._failure: RecordingError | None = None

    @property
    def info(self) -> RecordingInfo:
        """Returns the counts so far; any thread may call it."""
        failure = "" if self._failure is None else str(self._failure)
        running = self._subscription is not None
        return RecordingInfo(str(self.log.path), running, self._messages, failure)

    def start(self) -> None:
        """Starts recording. Raises `RecordingError` for a recorder that was started before."""
        if self._ended or self._subscription is not None:
            raise RecordingError(f"{self.log.path}: this recording was started before")
        self._subscription = self._graph.subscribe_all(self._take, self._matches)

    def stop(self) -> None:
        """Writes the rest and closes the log; further calls do nothing.

        Raises `RecordingError` if the log could not be written, then or earlier.
        """
        if self._ended:
            return
        self._ended = True
        self._unsubscribe()
        self.log.close()
        if self._failure is not None:
            raise self._failure

    def _take(self, published: Published) -> None:
        if not self._ended and self._failure is None:
            try:
                self.log.write(published)
                if self._max_bytes is not None and self.log.size_bytes > self._max_bytes:
                    raise RecordingError(
                        f"{self.log.path.name}: ended, as the folder for recordings is full; "
                        "remove some"
                    )
            except RecordingError as error:
                self._failure = error
                self._unsubscribe()
                return
            self._messages += 1

    def _unsubscribe(self) -> None:
        if self._subscription is not None:
            self._subscription.cancel()
            self._subscription = None
