"""Commands that run scenarios, logs, autopilots and nodes."""

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
    OriginOption,
    Px4DirOption,
    RemoteOption,
    Ros2Option,
    SilenceOption,
    ThreadsOption,
    TracebackOption,
    TrustOption,
)
from volery.cli.start_conditions import DEFAULT_TIMEOUT_S
from volery.cli.tables import print_table
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
    fail_on: run_options.FailOn = None,
    threads: ThreadsOption = None,
    replay_commands: run_options.ReplayCommands = None,
    workers: run_options.Workers = None,
    listen: run_options.Listen = None,
    drop_lost: run_options.DropLost = False,
    record: run_options.Record = None,
    topics: run_options.Topics = None,
    exclude: run_options.Exclude = None,
    report: run_options.Report = None,
    recordings_dir: run_options.RecordingsDir = None,
    overwrite: run_options.Overwrite = False,
    digest: run_options.Digest = False,
    page: run_options.Page = None,
    exit_at_end: run_options.ExitAtEnd = False,
    bridge: BridgesOption = None,
    allow_remote: RemoteOption = False,
    token: BridgeTokenOption = None,
    origin: OriginOption = None,
    ros2: Ros2Option = False,
    domain_id: DomainOption = None,
    middleware: MiddlewareOption = "dds",
    ros2_interface: InterfaceOption = None,
    px4_dir: Px4DirOption = None,
    autopilot_timeout: SilenceOption = 10.0,
    drop_on_timeout: DropOption = False,
    mavlink_key: MavlinkKeyOption = None,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Fly a scenario.

    Bridges: rosbridge, ros-tcp (Unity), ros-tcp-2, ros-tcp-connector, ros1, ros2, ros2-zenoh,
    sensor-link, comms, mavlink, mavlink-tcp, mavlink-serial, px4, px4-serial, ardupilot.

    Keys at a terminal: space pauses and resumes, . (or s) runs one physics step, + and - double
    and halve the real-time factor, m lifts it. Ctrl-C ends the run and writes log and report.
    """
    from volery.cli.flight_checks import parse_failures
    from volery.cli.run import RunOptions, fly, parse_speed

    if middleware == "zenoh" and not ros2:
        raise BridgeError("--middleware zenoh needs --ros2; or use --bridge ros2-zenoh")
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
        recordings=recordings_dir,
        allow_remote=allow_remote,
        token=token,
        origins=tuple(origin or ()),
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
        drop_on_timeout=drop_on_timeout,
        start_paused=start_paused,
        wait_for=tuple(name for names in wait_for or () for name in names.split(",") if name),
        wait_timeout_s=wait_timeout,
        fail_on=parse_failures(fail_on or ()),
        mavlink_key=mavlink_key,
        workers=workers,
        listen=listen,
        drop_lost=drop_lost,
    )
    code = fly(options)
    if code:
        raise typer.Exit(code)


@guarded
def worker(
    join: Annotated[
        str,
        typer.Option(metavar="HOST[:PORT]", help="Join the leader there (volery run --listen)."),
    ],
    token: Annotated[
        str | None, typer.Option(envvar="VOLERY_TOKEN", help="Know this token of the leader's run.")
    ] = None,
    threads: ThreadsOption = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run node code of this machine that the leader names.")
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(help="Read the scenario's files in this folder; default: they travel."),
    ] = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print only what nodes print; the leader gets errors.")
    ] = False,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Serve a part of a run that is divided among machines, to its end."""
    from volery.cli.division import join_run

    join_run(join, token, threads, trust=trust, folder=folder, quiet=quiet)


@guarded
def serve(
    scenario: Annotated[
        str | None,
        typer.Argument(
            help="Scenario name (volery list), TOML file, or log; default: hover for an hour."
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Set the page's port; 0 picks a free one. Default: 8080, or a free one if it is "
            "taken.",
        ),
    ] = None,
    host: Annotated[str, typer.Option(help="Set the address to listen on.")] = "127.0.0.1",
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Accept remote clients.")
    ] = False,
    token: Annotated[
        str | None,
        typer.Option(
            envvar="VOLERY_TOKEN",
            help="Require this token from operators; needed with --allow-remote.",
        ),
    ] = None,
    viewer_token: Annotated[
        str | None,
        typer.Option(envvar="VOLERY_VIEWER_TOKEN", help="Require this token from viewers."),
    ] = None,
    origin: OriginOption = None,
    recordings_dir: Annotated[
        Path, typer.Option(help="Set the folder of recordings; uploads go to its folder uploads.")
    ] = Path("runs/recordings"),
    tensorboard: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Show TensorBoard inside the page, for trainings in this folder."
        ),
    ] = None,
    uavs: Annotated[
        int | None, typer.Option(help="Set the number of UAVs of the first scenario.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Set the duration of the first scenario, simulated s.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Set the seed of the first scenario.")] = None,
    speed: Annotated[str, typer.Option(help="Set the real-time factor, or max.")] = "1",
    threads: ThreadsOption = None,
    trust: TrustOption = False,
    bridge: BridgesOption = None,
    traceback: TracebackOption = False,  # noqa: ARG001
) -> None:
    """Serve the page until Ctrl-C; its visitors choose the scenarios.

    A scenario that ends stays loaded, paused at its end.
    """
    from volery.cli.pages import usual_port
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
                recordings=recordings_dir,
                allow_remote=allow_remote,
                token=token,
                origins=tuple(origin or ()),
                threads=threads,
            ),
            PageSettings(
                host=host,
                port=usual_port(host) if port is None else port,
                tokens=Tokens(token, viewer_token),
                anywhere=allow_remote,
                origins=tuple(origin or ()),
                recordings=recordings_dir,
                uploads=recordings_dir / "uploads",
                tensorboard=tensorboard,
                unasked=scenario is None,
            ),
        )
    )


@guarded
def play(
    log: Annotated[
        Path, typer.Argument(help="A .mcap, .bag or .db3 log, or the folder of a ROS 2 bag.")
    ],
    scenario: Annotated[
        Path | None,
        typer.Option(help="Read the world's data files from the folder of this scenario file."),
    ] = None,
    speed: Annotated[str, typer.Option(help="Set the real-time factor, or max.")] = "1",
    loop: Annotated[bool, typer.Option("--loop", help="Loop the log.")] = False,
    paused: Annotated[bool, typer.Option("--paused", help="Start paused.")] = False,
    bridge: BridgesOption = None,
    allow_remote: RemoteOption = False,
    token: BridgeTokenOption = None,
    origin: OriginOption = None,
) -> None:
    """Play a log over bridges (rosbridge by default) until Ctrl-C.

    Keys at a terminal: space pauses and resumes, . (or s) runs one physics step, + and - double
    and halve the real-time factor, m lifts it, comma and slash seek 5 s back and forward.
    """
    from volery.cli.play import play as play_log
    from volery.cli.run import RunOptions, parse_speed

    options = RunOptions(
        scenario="",
        speed=parse_speed(speed),
        bridges=tuple(bridge or ()),
        allow_remote=allow_remote,
        token=token,
        origins=tuple(origin or ()),
    )
    play_log(log, options, scenario=scenario, loop=loop, paused=paused)


@guarded
def list_scenarios(
    nodes: Annotated[bool, typer.Option("--nodes", help="List registered nodes instead.")] = False,
) -> None:
    """List the shipped scenarios."""
    if nodes:
        from volery.scenario.node_names import registered_nodes

        print_table(("node", "class"), list(registered_nodes().items()))
        return
    from volery.scenario import library
    from volery.scenario.load import load_scenario

    rows = []
    for name in library.names():
        scenario = load_scenario(name)
        count = str(scenario.uav_count)
        rows.append((name, count, f"{scenario.duration_s:g} s", library.describe(name)))
    print_table(("scenario", "UAVs", "duration", "what it is"), rows, right=(1, 2))


@guarded
def px4(
    px4_dir: Annotated[
        Path, typer.Option(help="Use this PX4-Autopilot folder, built by `make px4_sitl_default`.")
    ],
    count: Annotated[
        int, typer.Option(min=1, help="Set the number of instances, one for each UAV.")
    ] = 1,
    first: Annotated[int, typer.Option(min=0, help="Set the number of the first instance.")] = 0,
    host: Annotated[str, typer.Option(help="Set the host of the simulation.")] = "127.0.0.1",
    work_dir: Annotated[
        Path | None, typer.Option(help="Keep parameters and logs in this folder.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=0.01, help="Scale PX4's timeouts to this real-time factor.")
    ] = None,
    airframe: Annotated[
        str | None,
        typer.Option(
            help="Set PX4's parameters for this airframe, a name or .toml file; default: Iris."
        ),
    ] = None,
) -> None:
    """Run PX4s for a simulation with `--bridge px4`, until Ctrl-C.

    Instance i flies the i-th UAV, from 0. Instances restart after a reset of the simulation and
    after the end of a run.
    """
    from volery.cli.px4 import run_px4

    run_px4(
        px4_dir,
        count,
        first=first,
        host=host,
        folder=work_dir,
        speed=speed,
        airframe=airframe,
    )


@guarded
def launch(
    profile: Annotated[
        Path, typer.Argument(help="Launch profile, a .toml file with \\[\\[launch]].")
    ],
    via: Annotated[
        str | None, typer.Option(help="Join the graph by this connection, see `volery node`.")
    ] = None,
    trust: TrustOption = False,
    namespace: Annotated[
        str | None, typer.Option(help="Set the namespace of the nodes, such as /uav1.")
    ] = None,
    lock_step: Annotated[
        float | None,
        typer.Option(help="Synchronize the simulation with the nodes at this period, s."),
    ] = None,
    traceback: TracebackOption = False,  # noqa: ARG001
) -> None:
    """Run the nodes of a launch profile in one process."""
    from volery.cli.launch import launch_profile

    launch_profile(profile, via=via, namespace=namespace, lock_step_s=lock_step, trust=trust)
