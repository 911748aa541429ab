"""The commands and their options; each command's work is in its own module."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.bench.registry import BENCHES
from volery.cli.graph_commands import node, service_app, topic_app
from volery.cli.guard import guarded, warn
from volery.cli.options import (
    BatchSizeOption,
    DomainOption,
    DoorsOption,
    DropOption,
    InterfaceOption,
    MavlinkKeyOption,
    MiddlewareOption,
    PageCommand,
    Px4DirOption,
    RemoteOption,
    Ros2Option,
    SilenceOption,
    ThreadsOption,
    TokenOption,
)
from volery.core.errors import BridgeError

_QUICK = [name for name, bench in BENCHES.items() if bench.has_quick]

app = typer.Typer(
    name="volery",
    help="Flies many UAVs with LIDARs and cameras in lock step.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


app.command()(node)
app.add_typer(topic_app, name="topic")
app.add_typer(service_app, name="service")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"volery {version('volery')}")
        raise typer.Exit


@app.callback()
def volery(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Fly many UAVs with LIDARs and cameras in lock step."""


@app.command(cls=PageCommand)
@guarded
def run(
    scenario: Annotated[str, typer.Argument(help="Name from `volery list`, or a TOML file.")],
    uavs: Annotated[int | None, typer.Option(help="Number of UAVs.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Simulated seconds to fly.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random.")] = None,
    no_nodes: Annotated[
        bool,
        typer.Option("--no-nodes", help="Without the scenario's nodes: they run elsewhere."),
    ] = False,
    speed: Annotated[
        str | None,
        typer.Option(help="Factor of real time, such as 1 or 2.5, or max; 1 where doors are open."),
    ] = None,
    threads: ThreadsOption = None,
    record: Annotated[
        Path | None, typer.Option(help="Write a log: .mcap (ROS 2) or .bag (ROS 1).")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write an illustrated report into this folder.")
    ] = None,
    door: DoorsOption = None,
    allow_remote: RemoteOption = False,
    token: TokenOption = None,
    ros2: Ros2Option = False,
    domain_id: DomainOption = None,
    middleware: MiddlewareOption = "dds",
    ros2_interface: InterfaceOption = None,
    recordings: Annotated[
        Path | None,
        typer.Option(help="Folder in which clients may record: /volery/start_recording."),
    ] = None,
    replay_commands: Annotated[
        Path | None,
        typer.Option(help="Give every command again that clients gave in this recorded flight."),
    ] = None,
    digest: Annotated[
        bool, typer.Option("--digest", help="Print the SHA-256 over all states and messages.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an existing log.")
    ] = False,
    page: Annotated[
        str | None,
        typer.Option(
            metavar="[=HOST:PORT]",
            help="Show the flight on a page in the browser; at 127.0.0.1:8080 unless said.",
        ),
    ] = None,
    px4_dir: Px4DirOption = None,
    autopilot_timeout: SilenceOption = 10.0,
    drop_silent: DropOption = False,
    mavlink_key: MavlinkKeyOption = None,
) -> None:
    """Fly a scenario.

    Doors: rosbridge, ros-tcp (Unity), ros-tcp-2, ros-tcp-connector, ros1, ros2, ros2-zenoh,
    sensor-link, comms, mavlink, mavlink-tcp, mavlink-serial, px4,
    px4-serial, ardupilot.

    At a terminal keys steer it: space pauses and goes on, . (or s) makes one physics step,
    + and - double and halve the speed, m frees it. Ctrl-C ends the flight and still writes log and
    report.
    """
    from volery.cli.run import RunOptions, fly, parse_speed

    if middleware == "zenoh" and not ros2:
        raise BridgeError("--middleware zenoh is of --ros2; without that, --door ros2-zenoh")
    doors = (*(door or ()), *((("ros2" if middleware == "dds" else "ros2-zenoh"),) * ros2))
    if px4_dir is not None and not any(text.partition("=")[0] == "px4" for text in doors):
        doors = (*doors, "px4")
    options = RunOptions(
        scenario=scenario,
        uavs=uavs,
        seconds=seconds,
        seed=seed,
        nodes=not no_nodes,
        speed=parse_speed(speed or ("1" if doors else "max")),
        doors=doors,
        domain_id=domain_id,
        interfaces=tuple(ros2_interface or ()),
        recordings=recordings,
        allow_remote=allow_remote,
        token=token,
        threads=threads,
        record=record,
        report=report,
        digest=digest,
        overwrite=overwrite,
        page=page,
        replay_commands=replay_commands,
        px4_dir=px4_dir,
        autopilot_timeout_s=autopilot_timeout,
        drop_silent=drop_silent,
        mavlink_key=mavlink_key,
    )
    code = fly(options)
    if code:
        raise typer.Exit(code)


@app.command()
@guarded
def serve(
    scenario: Annotated[
        str | None,
        typer.Argument(
            help="Name from `volery list`, or a TOML file; hover for an hour unless given."
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0: a free one.")] = 8080,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Listen beyond this machine.")
    ] = False,
    token: Annotated[
        str | None,
        typer.Option(
            envvar="VOLERY_TOKEN", help="What pilots must show; needed with --allow-remote."
        ),
    ] = None,
    viewer_token: Annotated[
        str | None,
        typer.Option(envvar="VOLERY_VIEWER_TOKEN", help="What those must show who only look on."),
    ] = None,
    origin: Annotated[
        list[str] | None,
        typer.Option(help="Let in pages of this origin too, such as that of a reverse proxy."),
    ] = None,
    recordings: Annotated[
        Path, typer.Option(help="Folder for recordings; uploads go to its folder uploads.")
    ] = Path("runs/recordings"),
    uavs: Annotated[int | None, typer.Option(help="Number of UAVs of the first scenario.")] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Simulated seconds of the first scenario.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first scenario.")] = None,
    speed: Annotated[str, typer.Option(help="Factor of real time, or max.")] = "1",
    threads: ThreadsOption = None,
    door: DoorsOption = None,
) -> None:
    """Serve the page until Ctrl-C: one world after the other, as its visitors choose.

    A scenario that ends stays there, paused at its end.
    """
    from volery.cli.run import RunOptions, parse_speed
    from volery.cli.serve import ServeOptions, serve
    from volery.server.rights import Tokens
    from volery.server.settings import PageSettings

    serve(
        ServeOptions(
            RunOptions(
                scenario=scenario or "hover",
                uavs=uavs,
                seconds=3600.0 if scenario is None and seconds is None else seconds,
                seed=seed,
                speed=parse_speed(speed),
                doors=tuple(door or ()),
                recordings=recordings,
                allow_remote=allow_remote,
                token=token,
                threads=threads,
            ),
            PageSettings(
                host=host,
                port=port,
                tokens=Tokens(token, viewer_token),
                anywhere=allow_remote,
                origins=tuple(origin or ()),
                recordings=recordings,
                uploads=recordings / "uploads",
            ),
        )
    )


@app.command()
@guarded
def play(
    log: Annotated[Path, typer.Argument(help="A .mcap or .bag log.")],
    speed: Annotated[str, typer.Option(help="Factor of real time, or max.")] = "1",
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="Wait at the beginning.")] = False,
    door: DoorsOption = None,
    allow_remote: RemoteOption = False,
    token: TokenOption = None,
) -> None:
    """Play a recorded log behind doors, rosbridge unless others are named, until Ctrl-C.

    At a terminal keys steer it: space pauses and goes on, . (or s) makes one physics step,
    + and - double and halve the speed, m frees it, comma and slash leap 5 s back and forward.
    """
    from volery.cli.playing import play as play_log
    from volery.cli.run import RunOptions, parse_speed

    options = RunOptions(
        scenario="",
        speed=parse_speed(speed),
        doors=tuple(door or ()),
        allow_remote=allow_remote,
        token=token,
    )
    play_log(log, options, loop=loop, paused=paused)


@app.command()
@guarded
def comms(
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: a free one.")] = 10200,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    batch_size: BatchSizeOption = 4,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Listen beyond this machine; needs a token.")
    ] = False,
    token: TokenOption = None,
) -> None:
    """Serve the radio network's stations until Ctrl-C: UAVs and ground stations."""
    from volery.cli.comms import serve_stations
    from volery.comms.settings import RouterSettings

    settings = RouterSettings(planes_per_batch=batch_size, token=token)
    serve_stations(host, port, settings, anywhere=allow_remote)


@app.command()
@guarded
def gcs(
    server: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Of volery comms.")
    ] = "127.0.0.1:10200",
    number: Annotated[int, typer.Option(min=0, max=255, help="Of this ground station.")] = 0,
    batch_size: BatchSizeOption = 4,
    token: TokenOption = None,
    log: Annotated[Path | None, typer.Option(help="Append what is said to this file.")] = None,
) -> None:
    """Watch and command UAVs over the radio network, line by line; help lists the commands."""
    from volery.cli.gcs import command_station

    command_station(server, number, token, batch_size, log)


@app.command("list")
@guarded
def list_scenarios() -> None:
    """List the scenarios that ship."""
    from volery.cli.listing import show_scenarios

    show_scenarios()


@app.command()
@guarded
def px4(
    px4_dir: Annotated[
        Path, typer.Option(help="Of PX4-Autopilot, in which `make px4_sitl_default` was run.")
    ],
    count: Annotated[int, typer.Option(min=1, help="Instances, one for each UAV.")] = 1,
    first: Annotated[int, typer.Option(min=0, help="Number of the first one.")] = 0,
    host: Annotated[str, typer.Option(help="Where the simulation runs.")] = "127.0.0.1",
    folder: Annotated[
        Path | None, typer.Option(help="For parameters and logs, which else are not kept.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=0.01, help="Factor of real time, for PX4's time-outs.")
    ] = None,
) -> None:
    """Run PX4s for a simulation with `--door px4`, until Ctrl-C.

    Instance i flies the i-th UAV, counted from 0. After a reset of the simulation, and when a run
    has ended, they begin anew and wait for it.
    """
    from volery.cli.px4 import run_px4

    run_px4(px4_dir, count, first=first, host=host, folder=folder, speed=speed)


@app.command()
@guarded
def info(file: Annotated[Path, typer.Argument(help="A .mcap or .bag log.")]) -> None:
    """Show what is in a log."""
    from volery.cli.logs import show_log

    if not show_log(file):
        raise typer.Exit(1)


@app.command()
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


@app.command()
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


@app.command()
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
    from volery.cli.slam import SlamAsked, map_log

    map_log(
        SlamAsked(
            log, out, layout, uav, scan, odom, imu_topic, not no_odometry, imu, start, level_mount,
            nodding_mount, resolution, reach, loops, overwrite,
        )
    )  # fmt: skip


@app.command()
@guarded
def bench(
    name: Annotated[str, typer.Argument(help=f"all, or one: {', '.join(BENCHES)}.")],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object a bench.")] = False,
    out: Annotated[Path | None, typer.Option(help="Write the JSON to this file too.")] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Write a page with figures and bounds.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help=f"Shorter, where the bench can: {', '.join(_QUICK)}.")
    ] = False,
) -> None:
    """Measure how fast Volery is on this machine."""
    from volery.cli.benching import measure_and_show

    measure_and_show(name, as_json=json, out=out, markdown=markdown, quick=quick)


@app.command()
@guarded
def launch(
    profile: Annotated[Path, typer.Argument(help="A .toml profile with \\[\\[launch]] in it.")],
    via: Annotated[
        str | None, typer.Option(help="Way into the graph, as of `volery node`.")
    ] = None,
    namespace: Annotated[str | None, typer.Option(help="Of the nodes, such as /uav1.")] = None,
    lock_step: Annotated[
        float | None, typer.Option(help="The simulation waits for them each so many seconds.")
    ] = None,
) -> None:
    """Run the nodes of a launch profile in a process of their own."""
    from volery.cli.launching import launch_profile

    launch_profile(profile, via=via, namespace=namespace, lock_step_s=lock_step)


@app.command()
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
    from volery.report.way_page import write_log_report

    written = write_log_report(
        log, out, compare=compare, compare_topic=compare_topic, uav=uav, overwrite=overwrite
    )
    for text in written.warnings:
        warn(text)
    typer.echo(f"report  {written.path}")


@app.command()
@guarded
def identify(
    airframe: Annotated[str, typer.Argument(help="A shipped airframe, or a TOML file.")],
    out: Annotated[Path, typer.Option(help="The data file to write.")],
    order: Annotated[int, typer.Option(min=1, max=2, help="Of the roll and pitch loops.")] = 2,
) -> None:
    """Fit the identified plant to an airframe's rigid body and write it as a data file."""
    from volery.cli.identifying import identify_and_write

    identify_and_write(airframe, out, order)


@app.command()
@guarded
def export(
    scenario: Annotated[str, typer.Argument(help="Name from `volery list`, or a TOML file.")],
    file: Annotated[Path, typer.Argument(help="The .glb file to write (glTF 2.0, binary).")],
    detail: Annotated[
        str, typer.Option(help="Of the trees: visual, sensing or coarse.")
    ] = "sensing",
) -> None:
    """Write the world of a scenario as glTF: ground, trees, buildings."""
    from volery.cli.exporting import export_and_tell

    export_and_tell(scenario, file, detail)


@app.command()
@guarded
def interfaces(
    folder: Annotated[Path, typer.Argument(help="To write into: src of a colcon workspace.")],
    package: Annotated[
        list[str] | None,
        typer.Option(help="Package to write, repeatable; volery_interfaces unless said."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace older ones.")] = False,
) -> None:
    """Write Volery's message types as ROS 2 packages, which colcon builds for ros2cli and rclpy."""
    from volery.cli.interfaces import write_and_tell

    write_and_tell(folder, package or [], overwrite=overwrite)


@app.command()
@guarded
def doctor() -> None:
    """Check this machine and installation; each line is ok or says how to mend it."""
    from volery.cli.doctor import examine

    if not examine():
        raise typer.Exit(1)


def main() -> None:
    """Entry point of the command `volery`."""
    app()


if __name__ == "__main__":
    main()
