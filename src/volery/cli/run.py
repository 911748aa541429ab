"""`volery run`: checks the options, builds the scenario and flies it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from volery.cli.bridge_checks import check_bridges, token_gaps
from volery.cli.bridges import fit_out, open_bridges
from volery.cli.command_replay import recorded_flight, recorded_scenario
from volery.cli.division import threads_of, workers_of
from volery.cli.error_reporting import warn
from volery.cli.flight import CommandLineFlight, RunOptions
from volery.cli.interrupt import Interrupts, stopped_code, stopped_how
from volery.cli.output_paths import check_record, check_report
from volery.cli.pages import Page, page_of
from volery.cli.progress import FlightProgress
from volery.cli.terminal import echo_line
from volery.cli.trust import with_trust
from volery.core.allocator import return_large_blocks
from volery.core.collector import spared_objects
from volery.core.errors import CommandError, ScenarioError
from volery.scenario.changes import LogRequest

if TYPE_CHECKING:
    from volery.scenario.changes import WorldRequest
    from volery.scenario.schema import Scenario

__all__ = ["RunOptions", "fly", "parse_speed"]

_THREADS = 2
_GLANCE_S = 0.2
"""Wall time between two checks for Ctrl-C in a run without a world, s."""
_LAST_RESPONSE_S = 0.1
"""Wall time for the last response to arrive at its client, s."""


def parse_speed(text: str) -> float | None:
    """Returns the real-time factor; None for `max`. Raises ScenarioError for other texts."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not 1e-6 <= speed < 1e6:
        raise ScenarioError(f"--speed: a positive number or max, 1e-06 to 1e+06, not '{text}'")
    return speed


def fly(options: RunOptions) -> int:
    """Flies a scenario with the options, then those that clients load; returns the exit code."""
    check_bridges(options)
    for gap in token_gaps(options):
        warn(gap)
    options = with_trust(options)
    with page_of(options) as page, Interrupts() as interrupts:
        try:
            code, change = _build_and_fly(options, interrupts, page)
            while change.is_requested and not code:
                if change.request is None:
                    code, change = _wait_for_world(options, interrupts, page)
                else:
                    options = _loading(options, change.request)
                    code, change = _build_and_fly(options, interrupts, page)
        except KeyboardInterrupt:
            if interrupts.gentle:
                raise
            echo_line(f"Stopped {stopped_how()} before the flight began", err=True)
            return stopped_code()
        return code


def _build_and_fly(options: RunOptions, interrupts: Interrupts, page: Page) -> tuple[int, _Change]:
    """Builds and flies a scenario; returns the exit code and a client's request for another one."""
    from volery import Simulation

    flight = recorded_flight(options)
    scenario = _scenario_of(options) if flight is None else recorded_scenario(flight, options)
    if options.record is not None:
        check_record(options.record, overwrite=options.overwrite)
    if options.report is not None:
        check_report(options.report, overwrite=options.overwrite)
    threads = threads_of(options, _THREADS)
    change = _Change(options)
    page.building(scenario)
    return_large_blocks()
    with (
        workers_of(options, scenario, lambda: interrupts.pressed) as workers,
        FlightProgress(scenario.name, scenario.duration_s) as progress,
    ):
        partition: dict[str, Any] = {} if workers is None else {"partition": workers.gather()}
        simulation = Simulation(
            scenario,
            threads=threads,
            recordings=options.recordings,
            on_load=change.request_world,
            **partition,
        )
        change.quit = simulation.clock.quit
        if flight is not None:
            simulation.replay_commands(flight)
        try:
            interrupts.be_gentle()
            if workers is not None:
                simulation.divide(workers.connect)
            bridges = open_bridges(simulation.gateway, options, simulation.uavs)
            with spared_objects(), bridges, page.showing(simulation):
                code = CommandLineFlight(simulation, options, progress, interrupts).fly()
        finally:
            simulation.close()
    return code, change


def _wait_for_world(options: RunOptions, interrupts: Interrupts, page: Page) -> tuple[int, _Change]:
    """Runs the bridges without a world.

    Returns the exit code and a client's request for a scenario.
    """
    from volery.runtime.idle_server import IdleServer

    change = _Change(options)
    idle = IdleServer(change.request_world)
    echo_line("no world is loaded; load one with /load_world; Ctrl-C exits", err=True)
    with open_bridges(idle.gateway, options), page.showing(idle):
        while not (change.is_requested or idle.quitting or interrupts.pressed):
            idle.wait(_GLANCE_S)
        idle.wait(_LAST_RESPONSE_S)
    return stopped_code() if interrupts.pressed else 0, change


def _scenario_of(options: RunOptions) -> Scenario:
    from volery import load_scenario
    from volery.scenario import changes, overrides

    scenario = overrides.apply(
        load_scenario(options.scenario, trust=options.trust),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
        nodes=options.nodes,
    )
    if options.changes is not None:
        scenario = changes.apply(scenario, options.changes)
    return fit_out(scenario, options)


def _loading(options: RunOptions, request: WorldRequest) -> RunOptions:
    """Returns the options of the flight that a client requests."""
    requested = request.changes
    if requested.speed is not None:
        options = replace(options, speed=requested.speed or None)
    if requested.uavs is not None:
        options = replace(options, uavs=None)
    return replace(options, scenario=request.name, changes=requested)


class _Change:
    """Holds a client's request for another scenario, to be flown with the same options."""

    def __init__(self, options: RunOptions) -> None:
        self._options = options
        self.is_requested = False
        self.request: WorldRequest | None = None
        """None: no world."""
        self.quit: Callable[[], None] = _nothing

    def request_world(self, request: WorldRequest | LogRequest | None) -> None:
        """Ends the current flight for another one.

        Raises `CommandError` if the flight must not end.
        """
        options = self._options
        for flag, given in (("--record", options.record), ("--report", options.report)):
            if given is not None:
                raise CommandError(f"this run writes a file of one flight ({flag})")
        if options.digest:
            raise CommandError("this run prints the digest of one flight (--digest)")
        if options.workers is not None:
            raise CommandError("this run is divided among machines for one flight (--workers)")
        if options.replay_commands is not None:
            raise CommandError("this run replays one flight (--replay-commands)")
        if isinstance(request, LogRequest):
            raise CommandError("this run simulates; `volery serve` and `volery play` play logs")
        if request is not None:
            _scenario_of(_loading(options, request))
        self.is_requested, self.request = True, request
        self.quit()


def _nothing() -> None:
    """Does nothing: there is no simulation yet."""
