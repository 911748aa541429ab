"""Commands that write data for other programs: identify, export, interfaces, schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.core.errors import VoleryError
from volery.core.whole_files import write_whole


@guarded
def identify(
    airframe: Annotated[str, typer.Argument(help="Airframe name or TOML file.")],
    out: Annotated[Path, typer.Option(help="Write this data file.")],
    order: Annotated[
        int, typer.Option(min=1, max=2, help="Set the order of the roll and pitch loops.")
    ] = 2,
) -> None:
    """Fit the identified plant to an airframe's rigid body and write it as a data file."""
    from volery.control import identification
    from volery.vehicle.airframe import load_airframe

    if not out.parent.is_dir():
        raise VoleryError(f"{out}: folder {out.parent} does not exist")
    model = identification.identify(load_airframe(airframe), 1 if order == 1 else 2)
    write_whole(out, identification.to_toml(model))
    errors = model.fit_error.model_dump() if model.fit_error else {}
    rows = [(name, f"{value:.4g}") for name, value in errors.items()]
    print_table((str(out), "error (root mean square)"), rows, right=(1,))


@guarded
def export(
    scenario: Annotated[str, typer.Argument(help="Scenario name (volery list) or TOML file.")],
    file: Annotated[Path, typer.Argument(help="The .glb file to write (glTF 2.0, binary).")],
    detail: Annotated[
        str, typer.Option(help="Set the trees' detail: visual, sensing or coarse.")
    ] = "sensing",
) -> None:
    """Write the world of a scenario as glTF: ground, trees, buildings."""
    from volery import load_scenario
    from volery.runtime.construction.world_export import export_world
    from volery.world.trees import DetailLevel

    if file.suffix.lower() != ".glb":
        raise VoleryError(f"{file}: worlds are written as binary glTF; the name must end in .glb")
    if not file.parent.is_dir():
        raise VoleryError(f"{file}: folder {file.parent} does not exist")
    if detail not in list(DetailLevel):
        raise VoleryError(f"--detail must be one of {', '.join(DetailLevel)} (found {detail!r})")
    size = export_world(load_scenario(scenario), file, detail=DetailLevel(detail))
    echo_line(f"{file} ({size / 1e6:.1f} MB)")


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
    _write_packages(folder, package or [], overwrite=overwrite, ros1=ros1)


def _write_packages(folder: Path, names: list[str], *, overwrite: bool, ros1: bool) -> None:
    """Writes packages into a folder of a workspace and prints what they need."""
    from volery.graph.codecs.interface_packages import (
        OWN,
        needs,
        packages,
        write_generator,
        write_package,
    )

    if not folder.is_dir():
        raise VoleryError(f"{folder}: no such folder; create it with `mkdir -p {folder}`")
    wanted = list(dict.fromkeys(names)) or [OWN]
    for name in wanted:
        echo_line(str(write_package(name, folder, overwrite=overwrite, ros1=ros1)))
    needed = sorted({other for name in wanted for other in needs(name, ros1=ros1)} - set(wanted))
    if needed:
        echo_line(f"needs   {', '.join(needed)}")
    ours = [name for name in needed if name in packages()]
    if ours:
        echo_line(
            f"Where your ROS {1 if ros1 else 2} lacks {' or '.join(ours)}: --package writes what "
            "Volery knows of it"
        )
    if ros1:
        echo_line(f"Without catkin: python3 {write_generator(folder)} makes Python modules")


@guarded
def schema(
    out: Annotated[
        Path | None,
        typer.Option(help="Write this file, such as scenario.schema.json beside a scenario."),
    ] = None,
) -> None:
    """Print or write the JSON schema of scenarios, for completion and checks in editors."""
    from volery.scenario.json_schema import schema_text, write_schema

    if out is None:
        typer.echo(schema_text(), nl=False)
        return
    write_schema(out)
    echo_line(str(out))
