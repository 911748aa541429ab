"""`volery run --replay-commands`: which flight is repeated, and with which scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from volery.cli.flight import RunOptions
from volery.core.errors import ScenarioError

if TYPE_CHECKING:
    from volery.bridges.logs.recorded_flight import RecordedFlight
    from volery.scenario.schema import Scenario


def recorded_flight(options: RunOptions) -> RecordedFlight | None:
    """The flight to be repeated; None where none was asked for.

    Raises `RecordingError` where the log holds none, `ScenarioError` for options that would make it
    another one.
    """
    if options.replay_commands is None:
        return None
    given = {"--uavs": options.uavs, "--seconds": options.seconds, "--seed": options.seed}
    for flag, value in given.items():
        if value is not None:
            raise ScenarioError(f"{flag}: a repeated flight has that of its log")
    from volery.bridges.logs.recorded_flight import read_flight

    return read_flight(options.replay_commands)


def recorded_scenario(flight: RecordedFlight, options: RunOptions) -> Scenario:
    """The scenario of the flight; says where it may not come out the same.

    Its files and nodes are those of the file that the command line names. By a mere name it reads
    only beside the log and starts shipped nodes only.

    Raises `ScenarioError` where the log is of another one than was named.
    """
    from volery import __version__, load_scenario
    from volery.runtime.replay.scenario_record import scenario_of

    origin = flight.origin
    if origin.version != __version__:
        text = f"the flight was recorded with Volery {origin.version}, this is {__version__}"
        typer.echo(f"{text}: it may come out differently", err=True)
    own = None
    if options.scenario != origin.name:
        own = load_scenario(options.scenario, trust=options.trust)
    return scenario_of(origin, own, folder=flight.path.parent)
