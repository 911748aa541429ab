"""`volery run --replay-commands`: the log to replay, and its scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.cli.flight import RunOptions
from volery.cli.terminal import echo_line
from volery.core.errors import ScenarioError

if TYPE_CHECKING:
    from volery.bridges.logs.recorded_flight import RecordedFlight
    from volery.scenario.schema import Scenario


def recorded_flight(options: RunOptions) -> RecordedFlight | None:
    """Returns the flight to replay; None without `--replay-commands`.

    Raises `RecordingError` if the log holds no flight, `ScenarioError` for options that would
    change the flight.
    """
    if options.replay_commands is None:
        return None
    given = {"--uavs": options.uavs, "--seconds": options.seconds, "--seed": options.seed}
    for flag, value in given.items():
        if value is not None:
            raise ScenarioError(f"{flag}: a command replay uses that of its log")
    from volery.bridges.logs.recorded_flight import read_flight

    return read_flight(options.replay_commands)


def recorded_scenario(flight: RecordedFlight, options: RunOptions) -> Scenario:
    """Returns the scenario of the recorded flight; warns if another version of Volery recorded it.

    If the command line names a scenario file, its data files and nodes are used. Otherwise only
    files in the log's folder are read and only shipped nodes start.

    Raises `ScenarioError` if the log belongs to another scenario than the named one.
    """
    from volery import __version__, load_scenario
    from volery.runtime.replay.scenario_record import scenario_of

    origin = flight.origin
    if origin.version != __version__:
        text = f"the flight was recorded with Volery {origin.version}, this is {__version__}"
        echo_line(f"{text}: it may come out differently", err=True)
    own = None
    if options.scenario != origin.name:
        own = load_scenario(options.scenario, trust=options.trust)
    return scenario_of(origin, own, folder=flight.path.parent)
