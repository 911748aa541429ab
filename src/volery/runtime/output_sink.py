"""Passes the engine's steps, samples and events to digest, graph and event list."""

from __future__ import annotations

from collections.abc import Callable

from volery.control.fleet import Fleet
from volery.engine.events import Event
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.monitoring.digest import Digest
from volery.runtime.vehicles.latest_samples import LatestSamples
from volery.sensors.samples import Samples

NOT_OF_THE_WORLD = ("/volery/", "/ground_truth/tf", "/rosout")
"""Topics outside the digest: of the simulation and its clients, of poses that enter with the
states, and of nodes' logs."""


class OutputSink:
    """Implements the engine's `Sink` in a simulation."""

    def __init__(self, fleet: Fleet, graph: Graph, publisher: GraphPublisher) -> None:
        self.fleet = fleet
        self._graph = graph
        self._publisher = publisher
        self.events: list[Event] = []
        """All events so far, oldest first."""
        self.latest = LatestSamples()
        """The last sample of every sensor."""
        self.on_event: Callable[[Event], None] | None = None
        """Called with each event, before its message is published."""
        self.digest: Digest | None = None
        self.watch: Callable[[], None] | None = None
        """Callback after each call of the fused step, for measurements; it must change nothing."""

    def enable_digest(self) -> None:
        """Hashes all states and messages from now on."""
        if self.digest is None:
            self.digest = Digest()
            self._graph.subscribe_all(self._fingerprint)

    def _fingerprint(self, published: Published) -> None:
        if self.digest is not None and not published.topic.startswith(NOT_OF_THE_WORLD):
            self.digest.add_message(published)

    def take_fingerprint(self) -> None:
        """Adds the present states to the digest, if there is one."""
        if self.digest is not None:
            self.digest.add_states(self.fleet)

    def advanced(self, first_step: int, last_step: int) -> None:
        """Adds computed steps to the digest."""
        if self.digest is not None:
            self.digest.add_steps(self.fleet.history, first_step, last_step)
        if self.watch is not None:
            self.watch()

    def sampled(self, samples: Samples) -> None:
        """Holds and publishes samples."""
        self.latest.sampled(samples)
        self._publisher.publish(samples)

    def happened(self, event: Event) -> None:
        """Stores and publishes an event."""
        self.events.append(event)
        if self.on_event is not None:
            self.on_event(event)
        self._publisher.publish_event(event)

    def deliver(self) -> None:
        """Delivers queued messages."""
        self._graph.deliver()
