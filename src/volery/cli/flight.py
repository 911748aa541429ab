"""Runs a flight of the command line; then writes log, report and digest, even if it was stopped."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cli.error_reporting import USER_ERROR, complain, complain_of
from volery.cli.flight_checks import FAILED, FlightChecks
from volery.cli.interrupt import Interrupts, stopped_code, stopped_how
from volery.cli.keyboard_control import steer
from volery.cli.keys import Keys
from volery.cli.progress import FlightProgress
from volery.cli.record_size import warn_of_size
from volery.cli.start_conditions import DEFAULT_TIMEOUT_S, start_paused, wait_for_clients
from volery.cli.terminal import echo_line
from volery.core.errors import RecordingError, VoleryError
from volery.core.plurals import counted

if TYPE_CHECKING:
    from volery.bridges.logs.log_writer import LogWriter
    from volery.graph.topics import Subscription
    from volery.report.collect import FlightCollector
    from volery.runtime.simulation import Simulation
    from volery.scenario.changes import Changes
    from volery.verdicts.verdict import Verdict

_CONTACTS_SHOWN = 10


@dataclass(frozen=True)
class RunOptions:
    """Holds the command line's options of a run."""

    scenario: str
    uavs: int | None = None
    seconds: float | None = None
    seed: int | None = None
    nodes: bool = True
    """Whether the scenario's nodes run in this process; else elsewhere, or not at all."""
    trust: bool = False
    """Whether nodes from the scenario's folder may run."""
    speed: float | None = None
    threads: int | None = None
    record: Path | None = None
    topics: tuple[str, ...] = ()
    """Patterns of recorded topics; empty: all topics, each image once."""
    exclude: tuple[str, ...] = ()
    """Patterns of topics that are not recorded."""
    report: Path | None = None
    digest: bool = False
    overwrite: bool = False
    bridges: tuple[str, ...] = ()
    recordings: Path | None = None
    allow_remote: bool = False
    token: str | None = None
    origins: tuple[str, ...] = ()
    """Web origins whose pages may connect."""
    domain_id: int | None = None
    """ROS 2 domain; None: ROS_DOMAIN_ID."""
    interfaces: tuple[str, ...] = ()
    """Network interfaces of ROS 2 over DDS; empty: loopback."""
    changes: Changes | None = None
    """Changes to the scenario by the client that loaded it."""
    page: str | None = None
    """Page address, `HOST:PORT` or `PORT`; empty: the default address; None: no page."""
    exit_at_end: bool = False
    """Whether a run with a page ends with its scenario."""
    replay_commands: Path | None = None
    px4_dir: Path | None = None
    """Folder of PX4's sources, whose instances run with the flight; None: PX4 runs elsewhere or not
    at all."""
    autopilot_timeout_s: float = 10.0
    """Wall time after which a silent autopilot in lock step times out."""
    drop_on_timeout: bool = False
    """Whether the run continues after an autopilot's timeout; else the run ends."""
    start_paused: bool = False
    wait_for: tuple[str, ...] = ()
    """Names of external nodes and clients that must connect before the first step."""
    wait_timeout_s: float = DEFAULT_TIMEOUT_S
    """Wall time within which they must connect."""
    fail_on: frozenset[str] = frozenset()
    """Kinds of failures that the exit code reports; see `cli.flight_checks`."""
    workers: int | None = None
    """Workers among which the run is divided, besides the leader; None: it is not."""
    listen: str | None = None
    """Address at which workers of other machines join, `HOST[:PORT]`; None: they start here."""
    drop_lost: bool = False
    """Whether the run continues without a lost worker's part; else this machine takes it over."""
    mavlink_key: Path | None = None
    """File with the text from which the key that signs MAVLink is made."""


class _StoppedError(Exception):
    """Signals between two steps that the process received a stop signal."""


class CommandLineFlight:
    """Runs one flight with its log, report and digest."""

    def __init__(
        self,
        simulation: Simulation,
        options: RunOptions,
        progress: FlightProgress,
        interrupts: Interrupts,
    ) -> None:
        self._simulation = simulation
        self._options = options
        self._progress = progress
        self._interrupts = interrupts
        self._keys = Keys()
        self._wall_s = self._before_s = 0.0
        self._log: LogWriter | None = None
        self._recorded: Subscription | None = None
        self._is_recorded: Callable[[str], bool] = lambda _topic: False
        self._collector: FlightCollector | None = None
        self._checks = FlightChecks(simulation, options.fail_on)
        if options.digest:
            simulation.diagnostics.enable_digest()
        if options.report is not None:
            from volery.report.collect import FlightCollector

            self._collector = FlightCollector(simulation)
        if options.record is not None:
            from volery.bridges.logs.log_writer import create_log
            from volery.bridges.logs.recorded_topics import recorded_topics

            matches = recorded_topics(simulation.graph, options.topics, options.exclude)
            self._is_recorded = matches
            warn_of_size(simulation.diagnostics.image_rates, matches)
            self._log = create_log(options.record, overwrite=options.overwrite)
            self._recorded = simulation.graph.subscribe_all(self._log.write, matches)

    def fly(self) -> int:
        """Runs to the end, a signal or an error; returns the exit code.

        Then writes the remaining files.
        """
        code = 0
        problem = ""
        verdicts: Sequence[Verdict] = ()
        start = time.perf_counter()
        try:
            with self._keys:
                self._await_clients()
                self._simulation.run(speed=self._options.speed, on_progress=self._on_progress)
            self._wall_s = self._wall_since(start)
            is_whole = self._options.seconds is None or "expectation" in self._options.fail_on
            verdicts = self._checks.judge(self._wall_s, is_over=is_whole)
            self._log_verdicts()
        except _StoppedError:
            code, problem = stopped_code(), f"Stopped {stopped_how()}"
        except RecordingError as error:
            code, problem = USER_ERROR, "The log could not be written"
            complain(str(error))
        except VoleryError as error:
            code, problem = self._checks.code_of(error), "The flight ended with an error"
            complain_of(error)
        finally:
            self._wall_s = self._wall_s or self._wall_since(start)
            closed = self._close_log()
        self._progress.finish(self._simulation.time_s)
        self._print_flight(problem)
        for verdict in verdicts:
            echo_line(f"  {verdict.outcome!s:7} {verdict.describe()}")
        if not closed and not code:
            code, problem = USER_ERROR, "The log could not be written"
        report_written = self._write_report(problem, verdicts)
        code = code if report_written else code or USER_ERROR
        failures = [] if code else self._checks.failures()
        for line in failures:
            echo_line(line, err=True)
        if not code and self._options.page is not None and not self._options.exit_at_end:
            self._stay()
        return FAILED if failures else code

    def _wall_since(self, start: float) -> float:
        """Returns the wall time since `start` without pauses, s."""
        return time.perf_counter() - start - self._simulation.clock.paused_s

    def _log_verdicts(self) -> None:
        """Adds the verdicts to the log, for playback."""
        message = self._checks.message
        if self._log is not None and message is not None and self._is_recorded(message.topic):
            self._log.write(message)

    def _await_clients(self) -> None:
        """Waits for clients and applies `--start-paused` before the first step."""
        options, simulation = self._options, self._simulation
        names, timeout_s = options.wait_for, options.wait_timeout_s
        if not wait_for_clients(simulation, names, timeout_s, lambda: self._interrupts.pressed):
            raise _StoppedError
        if options.start_paused:
            start_paused(
                simulation.clock, can_be_resumed=bool(options.bridges) or options.page is not None
            )

    def _stay(self) -> None:
        """Keeps the page open until Ctrl-C; steps after the scenario's end are not recorded."""
        simulation = self._simulation
        if simulation.clock.quitting:
            return
        echo_line("the page stays open; Ctrl-C ends it", err=True)
        try:
            with self._keys:
                while not simulation.clock.quitting:
                    simulation.wait_at_end(self._look_at_end)
                    simulation.run(speed=simulation.clock.speed, on_progress=self._on_progress)
                    if not simulation.clock.quitting:
                        self._checks.judge()
        except _StoppedError:
            return

    def _look_at_end(self) -> None:
        self._stop_if_pressed()
        self._checks.look()

    def _stop_if_pressed(self) -> None:
        if self._interrupts.pressed:
            raise _StoppedError

    def _on_progress(self, progress: Any) -> None:
        self._stop_if_pressed()
        self._checks.look()
        for key in self._keys.pressed():
            steer(self._simulation.clock, key, progress.real_time_factor)
        self._before_s = progress.before_s
        self._progress.update(
            progress.time_s, progress.real_time_factor, paused=self._simulation.clock.paused
        )

    def _close_log(self) -> bool:
        if self._log is None or self._recorded is None:
            return True
        try:
            self._simulation.commands.end()
            self._recorded.cancel()
            self._log.close()
        except RecordingError as error:
            complain(str(error))
            return False
        return True

    def _write_report(self, interrupted: str, verdicts: Sequence[Verdict]) -> bool:
        if self._collector is None or self._options.report is None:
            self._print_files(None)
            return True
        from volery.core.machine import describe_machine, describe_versions
        from volery.report.page import write_report

        self._progress.note("drawing the report")
        path: Path | None = None
        try:
            flight = self._collector.finish(
                self._wall_s,
                digest=self._simulation.diagnostics.digest() if self._options.digest else "",
                interrupted=interrupted,
                log_path=self._options.record,
                log_messages=self._log.messages if self._log else 0,
                machine=describe_machine(),
                versions=describe_versions(),
            )
            folder, overwrite = self._options.report, self._options.overwrite
            path = write_report(flight, folder, verdicts=verdicts, overwrite=overwrite)
        except VoleryError as error:
            complain(str(error))
        self._progress.note("")
        self._print_files(path)
        return path is not None

    def _print_flight(self, problem: str) -> None:
        simulated = self._simulation.time_s
        factor = (self._before_s + simulated) / self._wall_s if self._wall_s > 0.0 else 0.0
        count = len(self._simulation.uavs)
        head = f"{problem}: flew" if problem else "Flew"
        since = " since the last reset" if self._before_s else ""
        echo_line(
            f"{head} {simulated:.1f} s{since} with {counted(count, 'UAV')} "
            f"in {self._wall_s:.1f} s ({factor:.1f} x real time){self._reason(problem)}"
        )
        city = self._simulation.world.city
        if city is not None:
            echo_line(f"  {city.report.summary()}")
        events = [
            e
            for e in self._simulation.diagnostics.events
            if str(e.kind) in {"impact", "collision"} or e.detail == "battery empty"
        ]
        for event in events[:_CONTACTS_SHOWN]:
            echo_line(f"  {event.describe()}")
        if len(events) > _CONTACTS_SHOWN:
            counts = Counter(event.uav for event in events)
            echo_line(f"  and more: {len(events)} problems of {counted(len(counts), 'UAV')} in all")

    def _reason(self, problem: str) -> str:
        """Returns why a flight ended early without a signal or an error."""
        scenario = self._simulation.scenario
        early = self._simulation.time_s < scenario.duration_s
        return "; all are down" if early and not problem and self._all_down() else ""

    def _all_down(self) -> bool:
        simulation = self._simulation
        return simulation.scenario.ends_when == "all_landed" and not simulation.clock.quitting

    def _print_files(self, report: Path | None) -> None:
        if self._log is not None:
            size = self._log.path.stat().st_size / 1e6
            messages = counted(self._log.messages, "message")
            echo_line(f"log     {self._log.path} ({size:.1f} MB, {messages})")
        if report is not None:
            echo_line(f"report  {report}")
        if self._options.digest:
            echo_line(f"digest  {self._simulation.diagnostics.digest()}")
            echo_line(f"topics  {self._simulation.diagnostics.digest(by_topic=True)}")
