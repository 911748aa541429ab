"""`volery run`: what was asked for, checked; then build and fly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from volery.cli.doors import open_doors
from volery.cli.flight import Flight, RunOptions
from volery.cli.guard import INTERRUPTED
from volery.cli.interrupt import Interrupts
from volery.cli.progress import FlightProgress
from volery.cli.targets import check_record, check_report
from volery.core.errors import CommandError, ScenarioError

if TYPE_CHECKING:
    from volery.scenario.schema import Scenario

__all__ = ["RunOptions", "fly", "parse_speed"]

_THREADS = 2


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
    """Fly a scenario as the options say, then those that clients load; return the exit code."""
    with Interrupts() as interrupts:
        try:
            code, wanted = _build_and_fly(options, interrupts)
            while wanted is not None:
                options = replace(options, scenario=wanted)
                code, wanted = _build_and_fly(options, interrupts)
        except KeyboardInterrupt:
            if interrupts.gentle:
                raise
            typer.echo("Stopped with Ctrl-C before the flight began", err=True)
            return INTERRUPTED
        return code


def _build_and_fly(options: RunOptions, interrupts: Interrupts) -> tuple[int, str | None]:
    """Exit code, and the scenario that a client wants instead."""
    from volery import Simulation

    scenario = _scenario_of(options)
    if options.record is not None:
        check_record(options.record, overwrite=options.overwrite)
    if options.report is not None:
        check_report(options.report)
    threads = _THREADS if options.threads is None else options.threads
    change = _Change(options)
    with FlightProgress(scenario.name, scenario.duration_s) as progress:
        simulation = Simulation(
            scenario, threads=threads, recordings=options.recordings, on_load=change.ask
        )
        change.quit = simulation.quit
        try:
            interrupts.be_gentle()
            with open_doors(simulation, options):
                code = Flight(simulation, options, progress, interrupts).fly()
        finally:
            simulation.close()
    return code, None if code else change.wanted


def _scenario_of(options: RunOptions) -> Scenario:
    from volery import load_scenario
    from volery.scenario import overrides

    return overrides.apply(
        load_scenario(options.scenario),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
    )


class _Change:
    """Another scenario that a client of the graph wants to see flown, with the same options."""

    def __init__(self, options: RunOptions) -> None:
        self._options = options
        self.wanted: str | None = None
        self.quit: Callable[[], None] = _nothing

    def ask(self, name: str) -> None:
        """End the present flight for another one; `CommandError` where it must not end."""
        options = self._options
        for flag, given in (("--record", options.record), ("--report", options.report)):
            if given is not None:
                raise CommandError(f"this run writes a file of one flight ({flag})")
        if options.digest:
            raise CommandError("this run prints the digest of one flight (--digest)")
        _scenario_of(replace(options, scenario=name))
        self.wanted = name
        self.quit()


def _nothing() -> None:
    """Nothing can be asked for before the simulation is there."""
