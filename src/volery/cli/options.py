"""Options that several commands take, and one whose value may be left away."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

DoorsOption = Annotated[
    list[str] | None,
    typer.Option(help="Open a door to other programs: NAME or NAME=[HOST:]PORT, repeatable."),
]
RemoteOption = Annotated[
    bool, typer.Option("--allow-remote", help="Let doors listen beyond this machine.")
]
TokenOption = Annotated[
    str | None, typer.Option(envvar="VOLERY_TOKEN", help="What remote clients must show.")
]
Ros2Option = Annotated[
    bool, typer.Option("--ros2", help="Take part in a ROS 2 graph: the door ros2 or ros2-zenoh.")
]
DomainOption = Annotated[
    int | None,
    typer.Option(min=0, max=232, help="ROS 2 domain; ROS_DOMAIN_ID unless given."),
]
MiddlewareOption = Annotated[
    Literal["dds", "zenoh"], typer.Option(help="How --ros2 talks to ROS 2.")
]
InterfaceOption = Annotated[
    list[str] | None,
    typer.Option(help="Network interface for ROS 2 over DDS, repeatable; else this machine alone."),
]
ThreadsOption = Annotated[
    int | None, typer.Option(min=1, max=256, help="Threads; results do not depend on it.")
]
Px4DirOption = Annotated[
    Path | None,
    typer.Option(help="Run the PX4 of this folder for each UAV; opens the door px4."),
]
SilenceOption = Annotated[
    float,
    typer.Option(min=0.1, help="Wall seconds that an autopilot in lock step may be silent."),
]
MavlinkKeyOption = Annotated[
    Path | None,
    typer.Option(help="File with a text whose SHA-256 signs MAVLink; what is unsigned counts not."),
]
DropOption = Annotated[
    bool,
    typer.Option("--drop-silent", help="Go on without a silent autopilot; else the run ends."),
]

BatchSizeOption = Annotated[
    int, typer.Option(min=1, max=0x7F00, help="Planes a batch; linear id = it x batch + plane.")
]


class PageCommand(TyperCommand):
    """A command that takes `--page` as well as `--page=HOST:PORT`; typer knows only the latter."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As of typer, for the words of the command line."""
        return super().parse_args(ctx, ["--page=" if word == "--page" else word for word in args])
