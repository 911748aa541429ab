"""Options shared by several commands, and a command with an optional option value."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

# Options by their panel in help texts.
flight_option = partial(typer.Option, rich_help_panel="Flight")
division_option = partial(typer.Option, rich_help_panel="Several machines")
file_option = partial(typer.Option, rich_help_panel="Output files")
bridge_option = partial(typer.Option, rich_help_panel="Bridges and access")
ros2_option = partial(typer.Option, rich_help_panel="ROS 2")
autopilot_option = partial(typer.Option, rich_help_panel="Autopilots")

BridgesOption = Annotated[
    list[str] | None,
    bridge_option(help="Open a bridge to other programs: NAME or NAME=[HOST:]PORT, repeatable."),
]
RemoteOption = Annotated[
    bool, bridge_option("--allow-remote", help="Allow bridges to accept remote clients.")
]
TokenOption = Annotated[
    str | None, typer.Option(envvar="VOLERY_TOKEN", help="Require this token from remote clients.")
]
BridgeTokenOption = Annotated[
    str | None, bridge_option(envvar="VOLERY_TOKEN", help="Require this token from remote clients.")
]
OriginOption = Annotated[
    list[str] | None,
    bridge_option(
        help="Accept pages of this web origin, such as https://lab.example.org, or null for pages "
        "opened from files; repeatable."
    ),
]
Ros2Option = Annotated[
    bool, ros2_option("--ros2", help="Join the ROS 2 graph by the bridge ros2 or ros2-zenoh.")
]
DomainOption = Annotated[
    int | None, ros2_option(min=0, max=232, help="Set the ROS 2 domain; default: ROS_DOMAIN_ID.")
]
MiddlewareOption = Annotated[
    Literal["dds", "zenoh"], ros2_option(help="Set the middleware of --ros2.")
]
InterfaceOption = Annotated[
    list[str] | None,
    ros2_option(help="Use this network interface for DDS, repeatable; default: loopback."),
]
TrustOption = Annotated[
    bool, flight_option("--trust", help="Run node code from the scenario's folder.")
]
ThreadsOption = Annotated[
    int | None,
    flight_option(min=1, max=256, help="Set the number of threads; results do not depend on it."),
]
Px4DirOption = Annotated[
    Path | None,
    autopilot_option(help="Start the PX4 build of this folder for each UAV; opens the bridge px4."),
]
SilenceOption = Annotated[
    float, autopilot_option(min=0.1, help="Set the timeout of autopilots in lock step, wall s.")
]
MavlinkKeyOption = Annotated[
    Path | None,
    autopilot_option(help="Sign MAVLink by the SHA-256 of this file's text; drop unsigned frames."),
]
DropOption = Annotated[
    bool,
    autopilot_option(
        "--drop-on-timeout", help="Continue after an autopilot times out; default: end the run."
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


_ADDRESS = re.compile(r"(\S+:)?\d+")
"""PORT or HOST:PORT."""


class PageCommand(TyperCommand):
    """Accepts `--page`, `--page ADDRESS` and `--port N` as well; typer only `--page=ADDRESS`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Implements typer's method for the arguments of the command line."""
        words = [re.sub("^--port=", "--page=", word) for word in _with_addresses(args)]
        return super().parse_args(ctx, ["--page=" if word == "--page" else word for word in words])


class ServeCommand(TyperCommand):
    """Accepts `--page=ADDRESS` as well, like `volery run`, for `--host` and `--port`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Implements typer's method for the arguments of the command line."""
        words: list[str] = []
        for word in _with_addresses(args):
            option, _, address = word.partition("=")
            if option != "--page":
                words.append(word)
                continue
            host, colon, port = address.rpartition(":")
            words += [f"--host={host.strip('[]')}"] if colon else []
            words += [f"--port={port}"] if port else []
        return super().parse_args(ctx, words)


def _with_addresses(args: list[str]) -> list[str]:
    """Joins `--page` and `--port` with an address that follows, by `=`."""
    words: list[str] = []
    for word in args:
        if words and words[-1] in ("--page", "--port") and _ADDRESS.fullmatch(word):
            words[-1] += f"={word}"
        else:
            words.append(word)
    return words
