"""`volery run`: what was asked for, checked; then build and fly."""

from __future__ import annotations

import math

import typer

from volery.cli.doors import open_doors
from volery.cli.flight import Flight, RunOptions
from volery.cli.guard import INTERRUPTED
from volery.cli.interrupt import Interrupts
from volery.cli.progress import FlightProgress
from volery.cli.targets import check_record, check_report
from volery.core.errors import ScenarioError

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
    """Fly a scenario as the options say and return the exit code."""
    with Interrupts() as interrupts:
        try:
            return _build_and_fly(options, interrupts)
        except KeyboardInterrupt:
            if interrupts.gentle:
                raise
            typer.echo("Stopped with Ctrl-C before the flight began", err=True)
            return INTERRUPTED


def _build_and_fly(options: RunOptions, interrupts: Interrupts) -> int:
    from volery import Simulation, load_scenario
    from volery.scenario import overrides

    scenario = overrides.apply(
        load_scenario(options.scenario),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
    )
    if options.record is not None:
        check_record(options.record, overwrite=options.overwrite)
    if options.report is not None:
        check_report(options.report)
    threads = _THREADS if options.threads is None else options.threads
    with FlightProgress(scenario.name, scenario.duration_s) as progress:
        simulation = Simulation(scenario, threads=threads, recordings=options.recordings)
        try:
            interrupts.be_gentle()
            with open_doors(simulation, options):
                return Flight(simulation, options, progress, interrupts).fly()
        finally:
            simulation.close()
