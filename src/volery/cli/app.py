"""The command line: its commands, in the order in which `volery --help` lists them."""

from __future__ import annotations

from typing import Annotated

import typer

from volery.cli.error_reporting import format_logs
from volery.cli.examples import examples
from volery.cli.flight_commands import (
    launch,
    list_scenarios,
    play,
    px4,
    run,
    serve,
    worker,
)
from volery.cli.graph_commands import node, service_app, topic_app
from volery.cli.learning_commands import evaluate, export_policy, train
from volery.cli.log_commands import convert, info, recover, report, slam
from volery.cli.machine_commands import bench, doctor
from volery.cli.model_commands import export, identify, interfaces, schema
from volery.cli.node_logs import show_node_logs
from volery.cli.options import PageCommand, ServeCommand
from volery.cli.radio_commands import comms, gcs
from volery.cli.study_commands import grade, judge, sweep
from volery.cli.terminal import echo_lines

app = typer.Typer(
    name="volery",
    help="Simulate many UAVs with LIDARs, cameras and autopilots in lock step.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def volery(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print version, commit, Python, platform and libraries; exit."
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="With --version: print one JSON object.")
    ] = False,
) -> None:
    """Simulate many UAVs with LIDARs, cameras and autopilots in lock step."""
    if version:
        from volery.cli.build_info import describe_build

        build = describe_build()
        echo_lines(build.to_json() if as_json else str(build))
        raise typer.Exit
    if as_json:
        raise typer.BadParameter("needs --version", param_hint="--json")
    if context.invoked_subcommand is None:
        raise typer.BadParameter("name a command; `volery --help` lists them")


app.command(cls=PageCommand)(run)
app.command("list")(list_scenarios)
app.command(context_settings={"ignore_unknown_options": True})(examples)
app.command(cls=ServeCommand)(serve)
app.command("test")(judge)
for _command in (
    worker,
    play,
    sweep,
    grade,
    info,
    report,
    slam,
    recover,
    convert,
    node,
    launch,
    px4,
    comms,
    gcs,
    identify,
    train,
    evaluate,
    export_policy,
    export,
    interfaces,
    schema,
    bench,
    doctor,
):
    app.command()(_command)
app.add_typer(topic_app, name="topic")
app.add_typer(service_app, name="service")


def main() -> None:
    """Entry point of the command `volery`."""
    format_logs()
    show_node_logs()
    app()


if __name__ == "__main__":
    main()
