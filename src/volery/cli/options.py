"""Options shared by several commands, and a command with an optional option value."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

FLIGHT, FILES, BRIDGES = "Flight", "Output files", "Bridges and access"
ROS2, AUTOPILOTS = "ROS 2", "Autopilots"
"""Panels of options in help texts."""

BridgesOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Open a bridge to other programs: NAME or NAME=[HOST:]PORT, repeatable.",
        rich_help_panel=BRIDGES,
    ),
]
RemoteOption = Annotated[
    bool,
    typer.Option(
        "--allow-remote", help="Allow bridges to accept remote clients.", rich_help_panel=BRIDGES
    ),
]
TokenOption = Annotated[
    str | None, typer.Option(envvar="VOLERY_TOKEN", help="Require this token from remote clients.")
]
BridgeTokenOption = Annotated[
    str | None,
    typer.Option(
        envvar="VOLERY_TOKEN",
        help="Require this token from remote clients.",
        rich_help_panel=BRIDGES,
    ),
]
Ros2Option = Annotated[
    bool,
    typer.Option(
        "--ros2",
        help="Join the ROS 2 graph by the bridge ros2 or ros2-zenoh.",
        rich_help_panel=ROS2,
    ),
]
DomainOption = Annotated[
    int | None,
    typer.Option(
        min=0, max=232, help="Set the ROS 2 domain; default: ROS_DOMAIN_ID.", rich_help_panel=ROS2
    ),
]
MiddlewareOption = Annotated[
    Literal["dds", "zenoh"],
    typer.Option(help="Set the middleware of --ros2.", rich_help_panel=ROS2),
]
InterfaceOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Use this network interface for DDS, repeatable; default: loopback.",
        rich_help_panel=ROS2,
    ),
]
TrustOption = Annotated[
    bool,
    typer.Option(
        "--trust", help="Run node code from the scenario's folder.", rich_help_panel=FLIGHT
    ),
]
ThreadsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=256,
        help="Set the number of threads; results do not depend on it.",
        rich_help_panel=FLIGHT,
    ),
]
Px4DirOption = Annotated[
    Path | None,
    typer.Option(
        help="Start the PX4 build of this folder for each UAV; opens the bridge px4.",
        rich_help_panel=AUTOPILOTS,
    ),
]
SilenceOption = Annotated[
    float,
    typer.Option(
        min=0.1,
        help="Set the timeout of autopilots in lock step, wall s.",
        rich_help_panel=AUTOPILOTS,
    ),
]
MavlinkKeyOption = Annotated[
    Path | None,
    typer.Option(
        help="Sign MAVLink by the SHA-256 of this file's text; drop unsigned frames.",
        rich_help_panel=AUTOPILOTS,
    ),
]
DropOption = Annotated[
    bool,
    typer.Option(
        "--drop-on-timeout",
        help="Continue after an autopilot times out; default: end the run.",
        rich_help_panel=AUTOPILOTS,
    ),
]

TracebackOption = Annotated[
    bool, typer.Option("--traceback", help="Print the traceback of an error.", show_default=False)
]

GroupSizeOption = Annotated[
    int,
    typer.Option(
        min=1, max=0x7F00, help="Set the planes of a group; linear id = group x size + plane."
    ),
]


class PageCommand(TyperCommand):
    """Accepts `--page` as well as `--page=HOST:PORT`; typer supports only the latter."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Implements typer's method for the arguments of the command line."""
        return super().parse_args(ctx, ["--page=" if word == "--page" else word for word in args])
