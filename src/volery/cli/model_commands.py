"""Commands that write files for others: data of an airframe, a world, message types."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded


@guarded
def identify(
    airframe: Annotated[str, typer.Argument(help="A shipped airframe, or a TOML file.")],
    out: Annotated[Path, typer.Option(help="The data file to write.")],
    order: Annotated[int, typer.Option(min=1, max=2, help="Of the roll and pitch loops.")] = 2,
) -> None:
    """Fit the identified plant to an airframe's rigid body and write it as a data file."""
    from volery.cli.identify import identify_and_write

    identify_and_write(airframe, out, order)


@guarded
def export(
    scenario: Annotated[str, typer.Argument(help="Name from `volery list`, or a TOML file.")],
    file: Annotated[Path, typer.Argument(help="The .glb file to write (glTF 2.0, binary).")],
    detail: Annotated[
        str, typer.Option(help="Of the trees: visual, sensing or coarse.")
    ] = "sensing",
) -> None:
    """Write the world of a scenario as glTF: ground, trees, buildings."""
    from volery.cli.export import export_and_tell

    export_and_tell(scenario, file, detail)


@guarded
def interfaces(
    folder: Annotated[Path, typer.Argument(help="Write into this folder: src of a workspace.")],
    package: Annotated[
        list[str] | None,
        typer.Option(help="Package to write, repeatable; volery_interfaces unless said."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace older ones.")] = False,
    ros1: Annotated[
        bool, typer.Option("--ros1", help="Write packages of ROS 1, for catkin or genpy.")
    ] = False,
) -> None:
    """Write Volery's message types as packages for the tools of ROS 2 or, with --ros1, ROS 1."""
    from volery.cli.interfaces import write_and_tell

    write_and_tell(folder, package or [], overwrite=overwrite, ros1=ros1)
