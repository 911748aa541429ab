"""Verdicts on a flight of `volery run`, and what makes it fail for `--fail-on`."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from volery.cli.error_reporting import USER_ERROR
from volery.core.errors import NodeError, ScenarioError, VoleryError

if TYPE_CHECKING:
    from volery.graph.messages import Published
    from volery.runtime.simulation import Simulation
    from volery.verdicts.live_verdicts import LiveVerdicts
    from volery.verdicts.verdict import Verdict

FAILED = 1
"""Exit code of a flight that failed."""
_KINDS = ("crash", "contact", "expectation", "node-error")
_CONTACTS = ("impact", "collision")


def parse_failures(texts: Sequence[str]) -> frozenset[str]:
    """Returns the kinds in texts such as `crash,contact`. Raises `ScenarioError` for others."""
    kinds = [kind.strip() for text in texts for kind in text.split(",")]
    for kind in kinds:
        if kind not in _KINDS:
            raise ScenarioError(f"--fail-on: {', '.join(_KINDS)}, not '{kind}'")
    return frozenset(kinds)


class FlightChecks:
    """Checks a flight from now on; kinds: kinds of failures that count.

    Raises `ScenarioError` if expectations count and the scenario has none, or if it names code that
    may not run.
    """

    def __init__(self, simulation: Simulation, kinds: Collection[str]) -> None:
        self._simulation, self._kinds = simulation, kinds
        self._live: LiveVerdicts | None = None
        self._verdicts: tuple[Verdict, ...] = ()
        if simulation.scenario.expect:
            from volery.verdicts.live_verdicts import LiveVerdicts

            self._live = LiveVerdicts(simulation)
        elif "expectation" in kinds:
            raise ScenarioError("--fail-on expectation: the scenario expects nothing: [[expect]]")

    def look(self) -> None:
        """Publishes the verdicts so far to clients that receive them; call it between ticks."""
        if self._live is not None:
            self._live.look()

    def judge(self, wall_s: float | None = None, *, is_over: bool = True) -> tuple[Verdict, ...]:
        """Ends the recording, publishes the verdicts and returns them.

        wall_s: wall time of the flight, s; None: that since its start or last reset. is_over:
        whether the flight went to its end, as in `Judge.verdicts`.
        """
        if self._live is not None:
            self._verdicts = self._live.finish(wall_s, is_over=is_over)
        return self._verdicts

    @property
    def message(self) -> Published | None:
        """The verdicts as a message for the log; None without expectations."""
        return None if self._live is None else self._live.last

    def code_of(self, error: VoleryError) -> int:
        """Returns the exit code of a flight that an error has ended."""
        fails = isinstance(error, NodeError) and "node-error" in self._kinds
        return FAILED if fails else USER_ERROR

    def failures(self) -> list[str]:
        """Returns what has failed or could not be judged, a line each."""
        counts, simulation = "expectation" in self._kinds, self._simulation
        judged = self._verdicts if counts else ()
        failures = [f"{v.outcome}: {v.describe()}" for v in judged if not v.is_passed]
        if "crash" in self._kinds:
            crashed = [name for name, uav in simulation.uavs.items() if uav.crashed]
            failures += [f"failed: {name} has crashed" for name in crashed]
        if "contact" in self._kinds:
            contacts = (e for e in simulation.diagnostics.events if str(e.kind) in _CONTACTS)
            first = next(contacts, None)
            failures += [] if first is None else [f"failed: first contact: {first.describe()}"]
        return failures
