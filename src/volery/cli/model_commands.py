"""Commands that write data for other programs: identify, export, interfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded


@guarded
def identify(
    airframe: Annotated[str, typer.Argument(help="Airframe name or TOML file.")],
    out: Annotated[Path, typer.Option(help="Write this data file.")],
    order: Annotated[
        int, typer.Option(min=1, max=2, help="Set the order of the roll and pitch loops.")
    ] = 2,
) -> None:
    """Fit the identified plant to an airframe's rigid body and write it as a data file."""
    from volery.cli.identify import identify_and_write

    identify_and_write(airframe, out, order)


@guarded
def export(
    scenario: Annotated[str, typer.Argument(help="Scenario name (volery list) or TOML file.")],
    file: Annotated[Path, typer.Argument(help="The .glb file to write (glTF 2.0, binary).")],
    detail: Annotated[
        str, typer.Option(help="Set the trees' detail: visual, sensing or coarse.")
    ] = "sensing",
) -> None:
    """Write the world of a scenario as glTF: ground, trees, buildings."""
    from volery.cli.export import export_and_report

    export_and_report(scenario, file, detail)


@guarded
def interfaces(
    folder: Annotated[
        Path, typer.Argument(help="Folder to write into, such as src of a workspace.")
    ],
    package: Annotated[
        list[str] | None,
        typer.Option(help="Write this package, repeatable; default: volery_interfaces."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace existing packages.")
    ] = False,
    ros1: Annotated[
        bool, typer.Option("--ros1", help="Write ROS 1 packages for catkin or genpy.")
    ] = False,
) -> None:
    """Write Volery's message types as ROS 2 packages or, with --ros1, ROS 1 packages."""
    from volery.cli.interfaces import write_and_report

    write_and_report(folder, package or [], overwrite=overwrite, ros1=ros1)
