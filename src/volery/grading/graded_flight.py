"""Flies a submission once: the simulation in this process, the node in a sandbox beside it."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import VoleryError
from volery.core.listener import UNIX
from volery.grading.assignment import Assignment
from volery.grading.grades import GradedFlight
from volery.grading.sandbox import NodeCommand, SandboxedNode
from volery.grading.submission_gate import SubmissionGate
from volery.grading.submissions import Submission, SubmissionError
from volery.runtime.simulation import Simulation
from volery.verdicts.finished_run import FinishedRun, digest_of
from volery.verdicts.flights import RunRecorder
from volery.verdicts.judging import Judge
from volery.verdicts.verdict import Verdict

_PERIOD_S = 0.01
_AFTER_END_S = 5.0
"""Wall time in which the process of a node that has left ends."""


class _EndedError(VoleryError):
    """A flight ended because of its node."""


def fly(assignment: Assignment, submission: Submission, seed: int) -> GradedFlight:
    """Flies a submission with a seed; its failures are those of the flight, not of the caller."""
    start = time.monotonic()
    try:
        flown = _Flight(assignment, submission, seed).fly()
    except (SubmissionError, _EndedError) as error:
        wall_s = time.monotonic() - start
        return GradedFlight(submission.name, seed, problem=str(error), wall_s=wall_s)
    return GradedFlight(
        submission.name,
        seed,
        flown.verdicts,
        digest_of(flown.run.flight),
        flown.problem,
        flown.run.flight.duration_s,
        time.monotonic() - start,
    )


@dataclass(frozen=True)
class _Flown:
    run: FinishedRun
    verdicts: tuple[Verdict, ...]
    problem: str


@dataclass
class _Flight:
    """One flight."""

    assignment: Assignment
    submission: Submission
    seed: int

    def fly(self) -> _Flown:
        """Raises `SubmissionError` or `_EndedError` for a submission that cannot fly."""
        terms = self.assignment.terms
        scenario = self.assignment.scenario.with_(seed=self.seed)
        judge = Judge(scenario)
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="volery-grade-")))
            work, link = folder / "work", folder / "link"
            work.mkdir()
            link.mkdir()
            self.submission.copy_to(work)
            simulation = stack.enter_context(Simulation(scenario, threads=1))
            bridges = stack.enter_context(BridgeHost(simulation.gateway))
            gate = SubmissionGate(self.assignment)
            bridges.open(RosbridgeServer(f"{UNIX}{link / 'graph'}", gate=lambda: gate))
            command = NodeCommand(
                terms.node, self.assignment.terms.uav, terms.period_s, terms.parameters
            )
            until_s = time.monotonic() + terms.timeout_s
            node = stack.enter_context(
                SandboxedNode(command, work, link, memory_mb=terms.memory_mb, cpu_s=terms.timeout_s)
            )
            self._await(simulation, node, until_s)
            with _ended_at(until_s, node, simulation.clock.quit) as is_late:
                start = time.perf_counter()
                with RunRecorder(simulation, judge.needs) as recorder:
                    simulation.run()
                wall_s = time.perf_counter() - start
            if is_late():
                raise _EndedError(self._late)
            problem = ""
            if not self._is_there(simulation):
                _wait_for_end(node)
                problem = f"the node ended before the flight: {node.last_error()}"
            run = recorder.finished(wall_s)
            return _Flown(run, judge.verdicts(run), problem)

    def _await(self, simulation: Simulation, node: SandboxedNode, until_s: float) -> None:
        """Waits until the node is in lock step. Raises `_EndedError` if it ends or is late."""
        while not self._is_there(simulation):
            if node.has_ended:
                raise _EndedError(f"the node did not start: {node.last_error()}")
            if time.monotonic() > until_s:
                raise _EndedError(self._late)
            time.sleep(_PERIOD_S)
            simulation.process_commands()

    def _is_there(self, simulation: Simulation) -> bool:
        names = simulation.diagnostics.client_names
        return any(name.startswith(f"/{self.assignment.terms.uav}/") for name in names)

    @property
    def _late(self) -> str:
        return f"the node took more than {self.assignment.terms.timeout_s:g} s"


def _wait_for_end(node: SandboxedNode) -> None:
    """Waits until the output of a node that has left is complete."""
    until_s = time.monotonic() + _AFTER_END_S
    while not node.has_ended and time.monotonic() < until_s:
        time.sleep(_PERIOD_S)


@contextmanager
def _ended_at(
    until_s: float, node: SandboxedNode, end: Callable[[], None]
) -> Iterator[Callable[[], bool]]:
    """Ends node and simulation at a wall time; yields whether that has happened."""
    is_late = threading.Event()

    def stop() -> None:
        is_late.set()
        node.close()
        end()

    timer = threading.Timer(max(0.0, until_s - time.monotonic()), stop)
    timer.start()
    try:
        yield is_late.is_set
    finally:
        timer.cancel()
