"""Controls the playback of a log: position, pause and speed.

`LogPlayer` adds the graph's clients and the run loop.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from volery.bridges.logs.playback import Playback
from volery.bridges.logs.recorded_flight import RecordedScenario, origin_of
from volery.core.clock import NS_PER_S, ns_from_s, s_from_ns
from volery.core.errors import CommandError, RecordingError, VoleryError
from volery.engine.command_queue import CommandQueue
from volery.graph.graph import Graph
from volery.runtime.construction.geometry import Geometry
from volery.runtime.construction.worlds import geometry_of
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.services.simulation_state import RunState
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario

_STEP_NS = 1_000_000
"""Physics step without a recorded scenario."""


class PlaybackControl:
    """Holds a log at a position, on a graph of its own, and plays it or pauses it.

    The arguments are those of `LogPlayer`.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        speed: float | None,
        loop: bool,
        paused: bool,
        catalog: ScenarioCatalog | None,
        own: Scenario | None,
    ) -> None:
        _check_speed(speed)
        self.path = Path(path)
        self._playback = Playback(self.path)
        self._inbox = CommandQueue()
        self.graph = Graph(lambda: self._playback.now_ns, self._inbox.post)
        self.loop = loop
        self.quitting = False
        """Whether `quit` has been called."""
        self.origin = self._known_origin()
        """Recorded scenario; None if the log has none."""
        self.scenario: Scenario | None = self._known_scenario(own, catalog)
        """Scenario of the flight, for its world; None: unknown."""
        self._paused = paused
        self._speed = speed
        self._base_ns, self._base_wall = 0, 0.0
        """A time of the log, and the wall time at which it is due."""
        self._is_late = False
        """Whether the playback lags behind its speed."""
        self._clock_due = self._state_due = 0.0
        """Wall times of the next messages."""

    # -------------------------------------------------------------------------------------- time

    @property
    def time_ns(self) -> int:
        """Position in the log, ns."""
        return self._playback.position_ns

    @property
    def time_s(self) -> float:
        """Position in the log, s."""
        return s_from_ns(self.time_ns)

    @property
    def name(self) -> str:
        """Name of the log's file."""
        return self.path.name

    @property
    def start_s(self) -> float:
        """Start of the log, s."""
        return s_from_ns(self._playback.start_ns)

    @property
    def end_s(self) -> float:
        """End of the log, s."""
        return s_from_ns(self._playback.end_ns)

    @property
    def finished(self) -> bool:
        """Whether the playback is at the end, or `quit` has been called."""
        return self.quitting or self.time_ns >= self._playback.end_ns

    @cached_property
    def geometry(self) -> Geometry | None:
        """Geometry of the world at the start; None if the scenario is unknown."""
        return None if self.scenario is None else geometry_of(self.scenario)

    @property
    def paused(self) -> bool:
        """Whether the playback is paused."""
        return self._paused

    @property
    def speed(self) -> float | None:
        """Factor of real time; None: as fast as possible."""
        return self._speed

    @property
    def state(self) -> RunState:
        """State as in `simulation_interfaces`; paused at the start is stopped."""
        if self.quitting:
            return RunState.QUITTING
        if not self._paused:
            return RunState.PLAYING
        return RunState.STOPPED if self.time_ns == self._playback.start_ns else RunState.PAUSED

    # ----------------------------------------------------------------------------------- control

    def pause(self) -> None:
        """Pauses the playback."""
        self._paused, self._is_late = True, False
        self._publish_soon()

    def resume(self) -> None:
        """Continues the playback; at the end, starts over."""
        if self.finished:
            self.seek(self.start_s)
        self._paused = False
        self._rebase()
        self._publish_soon()

    def set_speed(self, speed: float | None) -> None:
        """Sets the factor of real time; None: as fast as possible."""
        _check_speed(speed)
        self._speed = speed
        self._rebase()
        self._publish_soon()

    def seek(self, time_s: float) -> None:
        """Goes to a time of the log, and publishes the last message before it of each topic."""
        if not math.isfinite(time_s):
            raise CommandError(f"a time must be finite, not {time_s}")
        self._playback.seek(ns_from_s(min(max(time_s, self.start_s), self.end_s)))
        self._rebase()
        self._publish_soon()

    def single_step(self, steps: int = 1) -> None:
        """Advances by physics steps of the recorded flight. Raises `CommandError` unless paused."""
        if not self._paused:
            raise CommandError("single steps are made while paused; call pause() first")
        if steps < 1:
            raise CommandError(f"a single step is at least 1 step, not {steps}")
        scenario = self.scenario
        step_ns = _STEP_NS if scenario is None else round(NS_PER_S / scenario.physics.rate_hz)
        until_ns = self.time_ns + steps * step_ns
        while not self._playback.advance(until_ns):
            self.graph.deliver()
        self._publish_soon()

    def quit(self) -> None:
        """Ends `LogPlayer.run` at its next turn."""
        self.quitting = True
        self._inbox.wake()

    def describe(self) -> dict[str, Any]:
        """Returns the fields of `volery_interfaces/srv/PlayerInfo` that describe the log."""
        played, topics = self._playback, self._playback.topics
        return {
            "file": self.path.name,
            "format": played.log.format,
            "size": played.log.size,
            "topics": [topic.name for topic in topics],
            "types": [topic.msgtype for topic in topics],
            "counts": [topic.messages for topic in topics],
            "refused": list(played.refused),
            "reasons": list(played.refused.values()),
            "problem": played.problem,
            "scenario": "" if self.origin is None else self.origin.name,
            "seed": 0 if self.origin is None else self.origin.seed,
        }

    # ------------------------------------------------------------------------------------ inside

    def _rebase(self) -> None:
        """Counts due times from the current position and wall time."""
        self._base_ns, self._base_wall = self.time_ns, time.perf_counter()

    def _publish_soon(self) -> None:
        self._clock_due = self._state_due = 0.0

    def _known_origin(self) -> RecordedScenario | None:
        with suppress(RecordingError):
            return origin_of(self._playback.log)
        return None

    def _known_scenario(
        self, own: Scenario | None, catalog: ScenarioCatalog | None
    ) -> Scenario | None:
        origin, folder = self.origin, self.path.parent
        if own is not None and origin is not None:
            return scenario_of(origin, own, folder=folder)  # raises for another scenario
        with suppress(VoleryError):
            if origin is not None:
                return scenario_of(origin, _in_catalog(catalog, origin.name), folder=folder)
        return None


def _in_catalog(catalog: ScenarioCatalog | None, name: str) -> Scenario | None:
    """Returns a scenario of the catalog that is not shipped, and so may have files of its own."""
    if catalog is None or name in library.names() or name not in catalog.names():
        return None
    with suppress(VoleryError):
        return catalog.load(name)
    return None


def _check_speed(speed: float | None) -> None:
    if speed is not None and not (math.isfinite(speed) and speed > 0.0):
        raise CommandError(f"speed must be a positive factor of real time, not {speed}")
