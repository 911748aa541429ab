"""Commands that fly: a scenario, one after the other for the page, a log, real autopilots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli import run_options
from volery.cli.error_reporting import guarded
from volery.cli.options import (
    BridgesOption,
    BridgeTokenOption,
    DomainOption,
    DropOption,
    InterfaceOption,
    MavlinkKeyOption,
    MiddlewareOption,
    Px4DirOption,
    RemoteOption,
    Ros2Option,
    SilenceOption,
    ThreadsOption,
    TracebackOption,
    TrustOption,
)
from volery.cli.start_conditions import DEFAULT_TIMEOUT_S
from volery.core.errors import BridgeError


@guarded
def run(
    scenario: run_options.Scenario,
    uavs: run_options.Uavs = None,
    seconds: run_options.Seconds = None,
    seed: run_options.Seed = None,
    no_nodes: run_options.NoNodes = False,
    trust: TrustOption = False,
    speed: run_options.Speed = None,
    start_paused: run_options.StartPaused = False,
    wait_for: run_options.WaitFor = None,
    wait_timeout: run_options.WaitTimeout = DEFAULT_TIMEOUT_S,
    threads: ThreadsOption = None,
    replay_commands: run_options.ReplayCommands = None,
    record: run_options.Record = None,
    topics: run_options.Topics = None,
    exclude: run_options.Exclude = None,
    report: run_options.Report = None,
    recordings: run_options.Recordings = None,
    overwrite: run_options.Overwrite = False,
    digest: run_options.Digest = False,
    page: run_options.Page = None,
    exit_at_end: run_options.ExitAtEnd = False,
    bridge: BridgesOption = None,
    allow_remote: RemoteOption = False,
    token: BridgeTokenOption = None,
    ros2: Ros2Option = False,
    domain_id: DomainOption = None,
    middleware: MiddlewareOption = "dds",
    ros2_interface: InterfaceOption = None,
    px4_dir: Px4DirOption = None,
    autopilot_timeout: SilenceOption = 10.0,
    drop_silent: DropOption = False,
    mavlink_key: MavlinkKeyOption = None,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Fly a scenario.

    Bridges: rosbridge, ros-tcp (Unity), ros-tcp-2, ros-tcp-connector, ros1, ros2, ros2-zenoh,
    sensor-link, comms, mavlink, mavlink-tcp, mavlink-serial, px4, px4-serial, ardupilot.

    At a terminal keys steer it: space pauses and goes on, . (or s) makes one physics step,
    + and - double and halve the speed, m frees it. Ctrl-C ends the flight and still writes log and
    report.
    """
    from volery.cli.run import RunOptions, fly, parse_speed

    if middleware == "zenoh" and not ros2:
        raise BridgeError("--middleware zenoh is of --ros2; without that, --bridge ros2-zenoh")
    bridges = (*(bridge or ()), *((("ros2" if middleware == "dds" else "ros2-zenoh"),) * ros2))
    if px4_dir is not None and not any(text.partition("=")[0] == "px4" for text in bridges):
        bridges = (*bridges, "px4")
    options = RunOptions(
        scenario=scenario,
        uavs=uavs,
        seconds=seconds,
        seed=seed,
        nodes=not no_nodes,
        trust=trust,
        speed=parse_speed(speed or ("1" if bridges or page is not None else "max")),
        bridges=bridges,
        domain_id=domain_id,
        interfaces=tuple(ros2_interface or ()),
        recordings=recordings,
        allow_remote=allow_remote,
        token=token,
        threads=threads,
        record=record,
        topics=tuple(topics or ()),
        exclude=tuple(exclude or ()),
        report=report,
        digest=digest,
        overwrite=overwrite,
        page=page,
        exit_at_end=exit_at_end,
        replay_commands=replay_commands,
        px4_dir=px4_dir,
        autopilot_timeout_s=autopilot_timeout,
        drop_silent=drop_silent,
        start_paused=start_paused,
        wait_for=tuple(name for names in wait_for or () for name in names.split(",") if name),
        wait_timeout_s=wait_timeout,
        mavlink_key=mavlink_key,
    )
    code = fly(options)
    if code:
        raise typer.Exit(code)


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
    trust: TrustOption = False,
    bridge: BridgesOption = None,
    traceback: TracebackOption = False,  # noqa: ARG001
) -> None:
    """Serve the page until Ctrl-C: one world after the other, as its visitors choose.

    A scenario that ends stays there, paused at its end.
    """
    from volery.cli.run import RunOptions, parse_speed
    from volery.cli.serve import ServeOptions, serve
    from volery.server.auth import Tokens
    from volery.server.settings import PageSettings

    serve(
        ServeOptions(
            RunOptions(
                scenario=scenario or "hover",
                uavs=uavs,
                seconds=3600.0 if scenario is None and seconds is None else seconds,
                seed=seed,
                trust=trust,
                speed=parse_speed(speed),
                bridges=tuple(bridge or ()),
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


@guarded
def play(
    log: Annotated[Path, typer.Argument(help="A .mcap or .bag log.")],
    scenario: Annotated[
        Path | None,
        typer.Option(help="Your own file of its scenario, for files that its world needs."),
    ] = None,
    speed: Annotated[str, typer.Option(help="Factor of real time, or max.")] = "1",
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="Wait at the beginning.")] = False,
    bridge: BridgesOption = None,
    allow_remote: RemoteOption = False,
    token: BridgeTokenOption = None,
) -> None:
    """Play a recorded log behind bridges, rosbridge unless others are named, until Ctrl-C.

    At a terminal keys steer it: space pauses and goes on, . (or s) makes one physics step,
    + and - double and halve the speed, m frees it, comma and slash leap 5 s back and forward.
    """
    from volery.cli.play import play as play_log
    from volery.cli.run import RunOptions, parse_speed

    options = RunOptions(
        scenario="",
        speed=parse_speed(speed),
        bridges=tuple(bridge or ()),
        allow_remote=allow_remote,
        token=token,
    )
    play_log(log, options, scenario=scenario, loop=loop, paused=paused)


@guarded
def list_scenarios(
    nodes: Annotated[
        bool, typer.Option("--nodes", help="List the nodes that have a name instead.")
    ] = False,
) -> None:
    """List the scenarios that ship."""
    from volery.cli.list import show_nodes, show_scenarios

    if nodes:
        show_nodes()
    else:
        show_scenarios()


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
    airframe: Annotated[
        str | None,
        typer.Option(help="Fit PX4 to this airframe, by name or .toml file, not to its own Iris."),
    ] = None,
) -> None:
    """Run PX4s for a simulation with `--bridge px4`, until Ctrl-C.

    Instance i flies the i-th UAV, counted from 0. After a reset of the simulation, and when a run
    has ended, they begin anew and wait for it.
    """
    from volery.cli.px4 import run_px4

    run_px4(
        px4_dir,
        count,
        first=first,
        host=host,
        folder=folder,
        speed=speed,
        airframe=airframe,
    )


@guarded
def launch(
    profile: Annotated[Path, typer.Argument(help="A .toml profile with \\[\\[launch]] in it.")],
    via: Annotated[
        str | None, typer.Option(help="Way into the graph, as of `volery node`.")
    ] = None,
    trust: TrustOption = False,
    namespace: Annotated[str | None, typer.Option(help="Of the nodes, such as /uav1.")] = None,
    lock_step: Annotated[
        float | None, typer.Option(help="The simulation waits for them each so many seconds.")
    ] = None,
    traceback: TracebackOption = False,  # noqa: ARG001
) -> None:
    """Run the nodes of a launch profile in a process of their own."""
    from volery.cli.launch import launch_profile

    launch_profile(profile, via=via, namespace=namespace, lock_step_s=lock_step, trust=trust)
