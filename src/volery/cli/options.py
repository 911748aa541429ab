"""Options that several commands take, and one whose value may be left away."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

FLIGHT, FILES, BRIDGES = "The flight", "What is written", "Bridges and access"
ROS2, AUTOPILOTS = "ROS 2", "Autopilots"
"""How a help groups many options."""

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
        "--allow-remote", help="Let bridges listen beyond this machine.", rich_help_panel=BRIDGES
    ),
]
TokenOption = Annotated[
    str | None, typer.Option(envvar="VOLERY_TOKEN", help="What remote clients must show.")
]
BridgeTokenOption = Annotated[
    str | None,
    typer.Option(
        envvar="VOLERY_TOKEN", help="What remote clients must show.", rich_help_panel=BRIDGES
    ),
]
Ros2Option = Annotated[
    bool,
    typer.Option(
        "--ros2",
        help="Take part in a ROS 2 graph: the bridge ros2 or ros2-zenoh.",
        rich_help_panel=ROS2,
    ),
]
DomainOption = Annotated[
    int | None,
    typer.Option(
        min=0, max=232, help="ROS 2 domain; ROS_DOMAIN_ID unless given.", rich_help_panel=ROS2
    ),
]
MiddlewareOption = Annotated[
    Literal["dds", "zenoh"],
    typer.Option(help="How --ros2 talks to ROS 2.", rich_help_panel=ROS2),
]
InterfaceOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Network interface for ROS 2 over DDS, repeatable; else this machine alone.",
        rich_help_panel=ROS2,
    ),
]
TrustOption = Annotated[
    bool,
    typer.Option("--trust", help="Run nodes that lie beside the file.", rich_help_panel=FLIGHT),
]
ThreadsOption = Annotated[
    int | None,
    typer.Option(
        min=1, max=256, help="Threads; results do not depend on it.", rich_help_panel=FLIGHT
    ),
]
Px4DirOption = Annotated[
    Path | None,
    typer.Option(
        help="Run the PX4 of this folder for each UAV; opens the bridge px4.",
        rich_help_panel=AUTOPILOTS,
    ),
]
SilenceOption = Annotated[
    float,
    typer.Option(
        min=0.1,
        help="Wall seconds that an autopilot in lock step may be silent.",
        rich_help_panel=AUTOPILOTS,
    ),
]
MavlinkKeyOption = Annotated[
    Path | None,
    typer.Option(
        help="File with a text whose SHA-256 signs MAVLink; what is unsigned counts not.",
        rich_help_panel=AUTOPILOTS,
    ),
]
DropOption = Annotated[
    bool,
    typer.Option(
        "--drop-silent",
        help="Go on without a silent autopilot; else the run ends.",
        rich_help_panel=AUTOPILOTS,
    ),
]

TracebackOption = Annotated[
    bool, typer.Option("--traceback", help="Print all frames of an error.", show_default=False)
]

BatchSizeOption = Annotated[
    int, typer.Option(min=1, max=0x7F00, help="Planes a batch; linear id = it x batch + plane.")
]


class PageCommand(TyperCommand):
    """A command that takes `--page` as well as `--page=HOST:PORT`; typer knows only the latter."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As of typer, for the words of the command line."""
        return super().parse_args(ctx, ["--page=" if word == "--page" else word for word in args])
