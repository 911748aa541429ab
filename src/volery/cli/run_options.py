"""The options of `volery run` alone, as its help groups them; those of several: `cli.options`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.options import BRIDGES, FILES, FLIGHT

# What is flown.
Scenario = Annotated[str, typer.Argument(help="Name from `volery list`, or a TOML file.")]
Uavs = Annotated[int | None, typer.Option(help="Number of UAVs.", rich_help_panel=FLIGHT)]
Seconds = Annotated[
    float | None, typer.Option(help="Simulated seconds to fly.", rich_help_panel=FLIGHT)
]
Seed = Annotated[
    int | None, typer.Option(help="Seed of everything random.", rich_help_panel=FLIGHT)
]
NoNodes = Annotated[
    bool,
    typer.Option(
        "--no-nodes",
        help="Without the scenario's nodes: they run elsewhere.",
        rich_help_panel=FLIGHT,
    ),
]
Speed = Annotated[
    str | None,
    typer.Option(
        help="Set the factor of real time, such as 1 or 2.5, or max [default: 1 with bridges or a "
        "page, else max].",
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
    typer.Option(min=0.1, help="Wall seconds that --wait-for waits.", rich_help_panel=FLIGHT),
]
ReplayCommands = Annotated[
    Path | None,
    typer.Option(
        help="Give every command again that clients gave in this recorded flight.",
        rich_help_panel=FLIGHT,
    ),
]

# What is left of it.
Record = Annotated[
    Path | None,
    typer.Option(help="Write a log: .mcap (ROS 2) or .bag (ROS 1).", rich_help_panel=FILES),
]
Topics = Annotated[
    list[str] | None,
    typer.Option(
        help="Record these topics alone, such as '/uav*/laser/**'; repeatable. Without it: all, "
        "and no picture twice.",
        rich_help_panel=FILES,
    ),
]
Exclude = Annotated[
    list[str] | None,
    typer.Option(help="Do not record these topics; repeatable.", rich_help_panel=FILES),
]
Report = Annotated[
    Path | None,
    typer.Option(help="Write an illustrated report into this folder.", rich_help_panel=FILES),
]
Recordings = Annotated[
    Path | None,
    typer.Option(
        help="Folder in which clients may record: /volery/start_recording.",
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
        help="Print the SHA-256 over all states and messages, in order and by topic.",
        rich_help_panel=FILES,
    ),
]

# Who looks on.
Page = Annotated[
    str | None,
    typer.Option(
        metavar="[=HOST:PORT]",
        help="Show the flight on a page in the browser, at 127.0.0.1:8080 by default; the page "
        "stays open at the end until Ctrl-C.",
        rich_help_panel=BRIDGES,
    ),
]
ExitAtEnd = Annotated[
    bool,
    typer.Option(
        "--exit-at-end",
        help="End a run with a page where its scenario ends.",
        rich_help_panel=BRIDGES,
    ),
]
