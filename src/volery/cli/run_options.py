"""Options of `volery run`, in the order of its help; shared ones are in `cli.options`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.options import BRIDGES, FILES, FLIGHT

# Flight.
Scenario = Annotated[str, typer.Argument(help="Scenario name (volery list) or TOML file.")]
Uavs = Annotated[int | None, typer.Option(help="Set the number of UAVs.", rich_help_panel=FLIGHT)]
Seconds = Annotated[
    float | None, typer.Option(help="Set the duration, simulated s.", rich_help_panel=FLIGHT)
]
Seed = Annotated[
    int | None, typer.Option(help="Set the seed of all random streams.", rich_help_panel=FLIGHT)
]
NoNodes = Annotated[
    bool,
    typer.Option(
        "--no-nodes",
        help="Do not start the scenario's nodes.",
        rich_help_panel=FLIGHT,
    ),
]
Speed = Annotated[
    str | None,
    typer.Option(
        help="Set the real-time factor, such as 1 or 2.5, or max; default: 1 with bridges or a "
        "page, else max.",
        rich_help_panel=FLIGHT,
    ),
]
StartPaused = Annotated[
    bool,
    typer.Option("--start-paused", help="Pause before the first step.", rich_help_panel=FLIGHT),
]
WaitFor = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME[,..]",
        help="Wait for these nodes or clients before the first step, repeatable.",
        rich_help_panel=FLIGHT,
    ),
]
WaitTimeout = Annotated[
    float,
    typer.Option(min=0.1, help="Set the timeout of --wait-for, wall s.", rich_help_panel=FLIGHT),
]
ReplayCommands = Annotated[
    Path | None,
    typer.Option(
        help="Replay the client commands of this log.",
        rich_help_panel=FLIGHT,
    ),
]

# Output files.
Record = Annotated[
    Path | None,
    typer.Option(help="Write a log: .mcap (ROS 2) or .bag (ROS 1).", rich_help_panel=FILES),
]
Topics = Annotated[
    list[str] | None,
    typer.Option(
        help="Record only these topics, such as '/uav*/laser/**', repeatable; default: all, "
        "each image once.",
        rich_help_panel=FILES,
    ),
]
Exclude = Annotated[
    list[str] | None,
    typer.Option(help="Do not record these topics, repeatable.", rich_help_panel=FILES),
]
Report = Annotated[
    Path | None,
    typer.Option(help="Write an illustrated report into this folder.", rich_help_panel=FILES),
]
RecordingsDir = Annotated[
    Path | None,
    typer.Option(
        help="Let clients record into this folder (/volery/start_recording).",
        rich_help_panel=FILES,
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace an existing log.", rich_help_panel=FILES)
]
Digest = Annotated[
    bool,
    typer.Option(
        "--digest",
        help="Print the SHA-256 of all states and messages, in order and by topic.",
        rich_help_panel=FILES,
    ),
]

# Page.
Page = Annotated[
    str | None,
    typer.Option(
        metavar="[=HOST:PORT]",
        help="Serve a page of the flight, at 127.0.0.1:8080 by default; it stays open until "
        "Ctrl-C.",
        rich_help_panel=BRIDGES,
    ),
]
ExitAtEnd = Annotated[
    bool,
    typer.Option(
        "--exit-at-end",
        help="Exit at the end of the scenario, even with a page.",
        rich_help_panel=BRIDGES,
    ),
]
