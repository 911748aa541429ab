"""Commands on logs: info, recover, convert, slam, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded, warn
from volery.cli.terminal import echo_line


@guarded
def info(
    file: Annotated[
        Path, typer.Argument(help="A .mcap or .bag log, a ROS 2 bag (folder, .db3) or a ULog.")
    ],
) -> None:
    """Show the contents of a log."""
    from volery.cli.logs import show_log

    if not show_log(file):
        raise typer.Exit(1)


@guarded
def recover(
    file: Annotated[Path, typer.Argument(help="A truncated log.")],
    out: Annotated[
        Path | None, typer.Argument(help="The new log; default: FILE.recovered.")
    ] = None,
) -> None:
    """Recover a truncated log."""
    from volery.cli.logs import recover_log

    recover_log(file, out)


@guarded
def convert(
    file: Annotated[Path, typer.Argument(help="A text log, one scan per line.")],
    out: Annotated[Path, typer.Argument(help="The new log, .mcap or .bag.")],
    layout: Annotated[Path, typer.Option(help="Read the columns' meaning from this TOML file.")],
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing log.")
    ] = False,
) -> None:
    """Convert a scanner's text log to .mcap or .bag."""
    from volery.cli.logs import convert_log

    convert_log(file, out, layout, overwrite=overwrite)


@guarded
def slam(
    log: Annotated[
        Path,
        typer.Argument(help="A .mcap or .bag log, a ROS 2 bag or a text log."),
    ],
    out: Annotated[Path, typer.Option(help="Write map and path into this folder.")] = Path("slam"),
    layout: Annotated[
        Path | None,
        typer.Option(help="Read the columns' meaning of a text log from this TOML file."),
    ] = None,
    uav: Annotated[str | None, typer.Option(help="Select the UAV by name.")] = None,
    scan_topic: Annotated[
        str | None, typer.Option(help="Set the topic of the horizontal LIDAR.")
    ] = None,
    odom_topic: Annotated[str | None, typer.Option(help="Set the topic of wheel odometry.")] = None,
    imu_topic: Annotated[str | None, typer.Option(help="Set the topic of the IMU.")] = None,
    no_odometry: Annotated[
        bool, typer.Option("--no-odometry", help="Ignore the log's odometry.")
    ] = False,
    imu: Annotated[
        bool | None,
        typer.Option(
            "--imu/--no-imu",
            help="Map with the IMU in 3D, or in the plane; default: by the log's topics.",
        ),
    ] = None,
    initial_pose: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z,YAW_DEG", help="Set the initial pose in the map."),
    ] = None,
    level_mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z", help="Set the horizontal LIDAR's position; overrides /tf_static."
        ),
    ] = None,
    nodding_mount: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Set the nodding LIDAR's position.")
    ] = None,
    resolution: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Set the cell size of the map, m.")
    ] = 0.05,
    max_range: Annotated[
        float, typer.Option(min=1.0, max=60.0, help="Ignore returns beyond this range, m.")
    ] = 30.0,
    loop_closure: Annotated[
        bool,
        typer.Option("--loop-closure/--no-loop-closure", help="Apply loop closures (gtsam)."),
    ] = True,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
) -> None:
    """Map a recorded log: map.png, map.pgm and .yaml (map_server), path.tum, summary.json."""
    from volery.cli.slam import SlamArguments, map_log

    map_log(
        SlamArguments(
            log, out, layout, uav, scan_topic, odom_topic, imu_topic, not no_odometry, imu,
            initial_pose, level_mount, nodding_mount, resolution, max_range, loop_closure,
            overwrite,
        )
    )  # fmt: skip


@guarded
def report(
    log: Annotated[Path, typer.Argument(help="A .mcap or .bag log of a simulated flight.")],
    out: Annotated[Path, typer.Option(help="Write index.html into this folder.")] = Path("report"),
    compare: Annotated[
        Path | None, typer.Option(help="Compare with this log of a real flight.")
    ] = None,
    compare_topic: Annotated[
        str | None,
        typer.Option(help="Select the topic of poses of that log."),
    ] = None,
    uav: Annotated[
        str | None,
        typer.Option(help="Draw, or compare with, this UAV; default: all, the first."),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing report.")
    ] = False,
) -> None:
    """Draw the true and estimated trajectories of a log, with a map of trunks."""
    from volery.report.trajectory_page import write_log_report

    written = write_log_report(
        log, out, compare=compare, compare_topic=compare_topic, uav=uav, overwrite=overwrite
    )
    for text in written.warnings:
        warn(text)
    if written.fit:
        echo_line(f"fit     {written.fit}")
    echo_line(f"report  {written.path}")
