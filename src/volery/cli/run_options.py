"""Options of `volery run`, in the order of its help; shared ones are in `cli.options`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.options import bridge_option, division_option, file_option, flight_option

# Flight.
Scenario = Annotated[str, typer.Argument(help="Scenario name (volery list) or TOML file.")]
Uavs = Annotated[int | None, flight_option(help="Set the number of UAVs.")]
Seconds = Annotated[float | None, flight_option(help="Set the duration, simulated s.")]
Seed = Annotated[int | None, flight_option(help="Set the seed of all random streams.")]
NoNodes = Annotated[bool, flight_option("--no-nodes", help="Do not start the scenario's nodes.")]
Speed = Annotated[
    str | None,
    flight_option(
        help="Set the real-time factor, such as 1 or 2.5, or max; default: 1 with bridges or a "
        "page, else max."
    ),
]
StartPaused = Annotated[bool, flight_option("--start-paused", help="Pause before the first step.")]
WaitFor = Annotated[
    list[str] | None,
    flight_option(
        metavar="NAME[,..]",
        help="Wait for these nodes or clients before the first step, repeatable.",
    ),
]
WaitTimeout = Annotated[
    float, flight_option(min=0.1, help="Set the timeout of --wait-for, wall s.")
]
FailOn = Annotated[
    list[str] | None,
    flight_option(
        metavar="crash|contact|expectation|node-error[,..]",
        help="Exit with 1 if a UAV has crashed at the end, if one hit anything, if the scenario "
        "expected something else, or if a node failed, repeatable.",
    ),
]
ReplayCommands = Annotated[
    Path | None, flight_option(help="Replay the client commands of this log.")
]

# Several machines.
Workers = Annotated[
    int | None,
    division_option(
        min=1, max=64, help="Divide the run among this number of workers and this process."
    ),
]
Listen = Annotated[
    str | None,
    division_option(
        metavar="HOST[:PORT]",
        help="Wait there for workers of other machines (volery worker); default: start them here.",
    ),
]
DropLost = Annotated[
    bool,
    division_option(
        "--drop-lost", help="Continue without a lost worker's nodes; default: take them over."
    ),
]

# Output files.
Record = Annotated[Path | None, file_option(help="Write a log: .mcap (ROS 2) or .bag (ROS 1).")]
Topics = Annotated[
    list[str] | None,
    file_option(
        help="Record only these topics, such as '/uav*/laser/**', repeatable; default: all, "
        "each image once."
    ),
]
Exclude = Annotated[list[str] | None, file_option(help="Do not record these topics, repeatable.")]
Report = Annotated[Path | None, file_option(help="Write an illustrated report into this folder.")]
RecordingsDir = Annotated[
    Path | None, file_option(help="Let clients record into this folder (/volery/start_recording).")
]
Overwrite = Annotated[bool, file_option("--overwrite", help="Replace an existing log or report.")]
Digest = Annotated[
    bool,
    file_option(
        "--digest", help="Print the SHA-256 of all states and messages, in order and by topic."
    ),
]

# Page.
Page = Annotated[
    str | None,
    bridge_option(
        metavar="[=HOST:PORT]",
        help="Serve a page of the flight, at 127.0.0.1:8080 by default; it stays open until "
        "Ctrl-C.",
    ),
]
ExitAtEnd = Annotated[
    bool, bridge_option("--exit-at-end", help="Exit at the end of the scenario, even with a page.")
]
