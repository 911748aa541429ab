"""`volery run`: build, fly, and write what was asked for, also after Ctrl-C."""

from __future__ import annotations

import contextlib
import math
import signal
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import typer

from volery.cli.guard import INTERRUPTED, USER_ERROR, complain
from volery.cli.progress import FlightProgress
from volery.core.errors import RecordingError, ScenarioError, VoleryError

if TYPE_CHECKING:
    from volery.bridges.bag import Log
    from volery.report.collect import FlightCollector

_CONTACTS_SHOWN = 10


@dataclass(frozen=True)
class RunOptions:
    """What the command line asked for."""

    scenario: str
    uavs: int | None = None
    seconds: float | None = None
    seed: int | None = None
    speed: float | None = None
    threads: int | None = None
    record: Path | None = None
    report: Path | None = None
    digest: bool = False
    overwrite: bool = False


class _StoppedError(Exception):
    """Ctrl-C was pressed; raised between two steps."""


def parse_speed(text: str) -> float | None:
    """Factor of real time; None for `max`. ScenarioError for anything else."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0.0):
        raise ScenarioError(f"--speed: a positive number or max, not '{text}'")
    return speed


def fly(options: RunOptions) -> int:
    """Fly a scenario as the options say and return the exit code."""
    from volery import Simulation, load_scenario
    from volery.scenario import overrides

    scenario = overrides.apply(
        load_scenario(options.scenario),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
    )
    _check_targets(options)
    threads = {} if options.threads is None else {"threads": options.threads}
    with FlightProgress(scenario.name, scenario.duration_s) as progress:
        simulation = Simulation(scenario, **threads)
        try:
            return _Flight(simulation, options, progress).fly()
        finally:
            simulation.close()


def _check_targets(options: RunOptions) -> None:
    """Refuse what cannot be written before the flight, not after it."""
    if options.record is not None:
        from volery.bridges.bag import check_target

        check_target(options.record, overwrite=options.overwrite)
    if options.report is not None:
        from volery.report.page import check_folder

        check_folder(options.report)


class _Flight:
    """One flight with its log, report and digest."""

    def __init__(self, simulation: Any, options: RunOptions, progress: FlightProgress) -> None:
        self._simulation = simulation
        self._options = options
        self._progress = progress
        self._stopped = False
        self._wall_s = 0.0
        self._log: Log | None = None
        self._collector: FlightCollector | None = None
        if options.digest:
            simulation.enable_digest()
        if options.report is not None:
            from volery.report.collect import FlightCollector

            self._collector = FlightCollector(simulation)
        if options.record is not None:
            from volery.bridges.bag import open_log

            self._log = open_log(options.record, overwrite=options.overwrite)
            simulation.graph.subscribe_all(self._log.write)

    def fly(self) -> int:
        """Run to the end, to Ctrl-C or to an error; then write what is left to write."""
        code = 0
        trouble = ""
        start = time.perf_counter()
        with self._stop_on_interrupt():
            try:
                self._simulation.run(speed=self._options.speed, on_progress=self._on_progress)
            except _StoppedError:
                code, trouble = INTERRUPTED, "Stopped with Ctrl-C"
            except RecordingError as error:
                code, trouble = USER_ERROR, "The log could not be written"
                complain(str(error))
            except VoleryError as error:
                code, trouble = USER_ERROR, "The flight ended with an error"
                complain(str(error))
            finally:
                self._wall_s = time.perf_counter() - start
                closed = self._close_log()
            self._progress.finish(self._simulation.time_s)
            self._tell_flight(trouble)
            if not closed and not code:
                code, trouble = USER_ERROR, "The log could not be written"
            report_written = self._write_report(trouble)
        return code if report_written else code or USER_ERROR

    @contextlib.contextmanager
    def _stop_on_interrupt(self) -> Iterator[None]:
        """Let Ctrl-C end the run between two steps; a second one ends it at once."""

        def stop(_signal: int, _frame: FrameType | None) -> None:
            if self._stopped:
                raise KeyboardInterrupt
            self._stopped = True

        before = signal.signal(signal.SIGINT, stop)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _on_progress(self, progress: Any) -> None:
        self._progress.update(progress.time_s, progress.real_time_factor)
        if self._stopped:
            raise _StoppedError

    def _close_log(self) -> bool:
        if self._log is None:
            return True
        try:
            self._log.close()
        except RecordingError as error:
            complain(str(error))
            return False
        return True

    def _write_report(self, interrupted: str) -> bool:
        if self._collector is None or self._options.report is None:
            self._tell_files(None)
            return True
        from volery.bench.machine import describe_machine, describe_versions
        from volery.report.page import write_report

        self._progress.note("drawing the report")
        path: Path | None = None
        try:
            flight = self._collector.finish(
                self._wall_s,
                digest=self._simulation.digest() if self._options.digest else "",
                interrupted=interrupted,
                log_path=self._options.record,
                log_messages=self._log.messages if self._log else 0,
                machine=describe_machine(),
                versions=describe_versions(),
            )
            path = write_report(flight, self._options.report)
        except VoleryError as error:
            complain(str(error))
        self._progress.note("")
        self._tell_files(path)
        return path is not None

    def _tell_flight(self, trouble: str) -> None:
        simulated = self._simulation.time_s
        factor = simulated / self._wall_s if self._wall_s > 0.0 else 0.0
        count = len(self._simulation.uav_names)
        head = f"{trouble}: flew" if trouble else "Flew"
        typer.echo(
            f"{head} {simulated:.1f} s with {count} UAV{'s' if count != 1 else ''} "
            f"in {self._wall_s:.1f} s ({factor:.1f} x real time)"
        )
        events = [e for e in self._simulation.events if str(e.kind) in {"impact", "collision"}]
        for event in events[:_CONTACTS_SHOWN]:
            typer.echo(f"  {event.describe()}")
        if len(events) > _CONTACTS_SHOWN:
            counts = Counter(event.uav for event in events)
            typer.echo(f"  and more: {len(events)} contacts of {len(counts)} UAVs in all")

    def _tell_files(self, report: Path | None) -> None:
        if self._log is not None:
            size = self._log.path.stat().st_size / 1e6
            messages = f"{self._log.messages:,} messages"
            typer.echo(f"log     {self._log.path} ({size:.1f} MB, {messages})")
        if report is not None:
            typer.echo(f"report  {report}")
        if self._options.digest:
            typer.echo(f"digest  {self._simulation.digest()}")
