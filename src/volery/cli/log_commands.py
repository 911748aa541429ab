"""Commands on what was recorded: look, mend, convert, map, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded, warn


@guarded
def info(file: Annotated[Path, typer.Argument(help="A .mcap or .bag log.")]) -> None:
    """Show what is in a log."""
    from volery.cli.logs import show_log

    if not show_log(file):
        raise typer.Exit(1)


@guarded
def recover(
    file: Annotated[Path, typer.Argument(help="A log that was cut off.")],
    out: Annotated[
        Path | None, typer.Argument(help="The new log; FILE.recovered by default.")
    ] = None,
) -> None:
    """Write a log that was cut off as a whole file."""
    from volery.cli.logs import recover_log

    recover_log(file, out)


@guarded
def convert(
    file: Annotated[Path, typer.Argument(help="A plain text log with one scan a line.")],
    out: Annotated[Path, typer.Argument(help="The new log, .mcap or .bag.")],
    layout: Annotated[
        Path, typer.Option(help="A TOML file that says what stands in which column.")
    ],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the new log.")] = False,
) -> None:
    """Turn a scanner's text log into one that can be played, shown and mapped."""
    from volery.cli.logs import convert_log

    convert_log(file, out, layout, overwrite=overwrite)


@guarded
def slam(
    log: Annotated[
        Path,
        typer.Argument(help="A .mcap or .bag log, a ROS 2 bag, or a scanner's text log."),
    ],
    out: Annotated[Path, typer.Option(help="The folder to write map and path into.")] = Path(
        "slam"
    ),
    layout: Annotated[
        Path | None,
        typer.Option(help="For a text log: a TOML file that says what stands in which column."),
    ] = None,
    uav: Annotated[str | None, typer.Option(help="Name, where the log has several.")] = None,
    scan: Annotated[str | None, typer.Option(help="Topic of the level LIDAR.")] = None,
    odom: Annotated[str | None, typer.Option(help="Topic of the wheels' odometry.")] = None,
    imu_topic: Annotated[str | None, typer.Option(help="Topic of the IMU.")] = None,
    no_odometry: Annotated[
        bool, typer.Option("--no-odometry", help="Leave odometry out that the log has.")
    ] = False,
    imu: Annotated[
        bool | None,
        typer.Option(
            "--imu/--no-imu", help="In space, or in the plane; by what the log has unless said."
        ),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,Z,YAW_DEG", help="Where in the map it begins.")
    ] = None,
    level_mount: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Of the level LIDAR, not /tf_static's.")
    ] = None,
    nodding_mount: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Of the nodding one.")
    ] = None,
    resolution: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Width of the map's cells, m.")
    ] = 0.05,
    reach: Annotated[float, typer.Option(min=1.0, max=60.0, help="Farther is left out, m.")] = 30.0,
    loops: Annotated[
        bool, typer.Option("--loops/--no-loops", help="Correct by places seen again (gtsam).")
    ] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace older files.")] = False,
) -> None:
    """Map a recorded log: map.png, map.pgm and .yaml (map_server), path.tum, summary.json."""
    from volery.cli.slam import SlamArguments, map_log

    map_log(
        SlamArguments(
            log, out, layout, uav, scan, odom, imu_topic, not no_odometry, imu, start, level_mount,
            nodding_mount, resolution, reach, loops, overwrite,
        )
    )  # fmt: skip


@guarded
def report(
    log: Annotated[Path, typer.Argument(help="A .mcap or .bag log of a simulated flight.")],
    out: Annotated[Path, typer.Option(help="The folder to write index.html into.")] = Path(
        "report"
    ),
    compare: Annotated[
        Path | None, typer.Option(help="Log of a real flight, laid over the simulated one.")
    ] = None,
    compare_topic: Annotated[
        str | None,
        typer.Option(help="Its topic of poses, where there are several."),
    ] = None,
    uav: Annotated[
        str | None, typer.Option(help="UAV to draw, else all; or to compare with, else the first.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an older one.")] = False,
) -> None:
    """Draw the ways of a log, simulated against estimated, with a map of trunks."""
    from volery.report.trajectory_page import write_log_report

    written = write_log_report(
        log, out, compare=compare, compare_topic=compare_topic, uav=uav, overwrite=overwrite
    )
    for text in written.warnings:
        warn(text)
    if written.fit:
        typer.echo(f"fit     {written.fit}")
    typer.echo(f"report  {written.path}")
