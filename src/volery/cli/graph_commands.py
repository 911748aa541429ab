"""`volery node`, `volery topic ...` and `volery service ...`, with their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.connections import CONNECTION_FORMS, DEFAULT_VIA
from volery.cli.error_reporting import guarded
from volery.cli.options import TracebackOption

_CONTEXT = {"help_option_names": ["-h", "--help"]}
topic_app = typer.Typer(no_args_is_help=True, context_settings=_CONTEXT)
service_app = typer.Typer(no_args_is_help=True, context_settings=_CONTEXT)

Via = Annotated[
    str,
    typer.Option(help=f"Join the graph by {CONNECTION_FORMS}; default: VOLERY_VIA."),
]
ViaOfAll = Annotated[
    str,
    typer.Option("--via", envvar="VOLERY_VIA", help=f"Join the graph by {CONNECTION_FORMS}."),
]
Topic = Annotated[str, typer.Argument(help="Name of a topic.")]
Service = Annotated[str, typer.Argument(help="Name of a service.")]
Types = Annotated[bool, typer.Option("--types", "-t", help="Show types.")]


@topic_app.callback()
def topics(context: typer.Context, via: ViaOfAll = DEFAULT_VIA) -> None:
    """Inspect topics and publish on them."""
    _use(context, via)


@service_app.callback()
def services(context: typer.Context, via: ViaOfAll = DEFAULT_VIA) -> None:
    """Inspect and call services."""
    _use(context, via)


def _use(context: typer.Context, via: str) -> None:
    """Sets the default of `--via` for the group's commands."""
    commands = getattr(context.command, "commands", {})
    context.default_map = {name: {"via": via} for name in commands}


@guarded
def node(
    node: Annotated[str, typer.Argument(help="Name (volery list --nodes) or module:Class.")],
    via: Annotated[
        str | None,
        typer.Option(
            help=f"Join the graph by {CONNECTION_FORMS}; default: the profile's, VOLERY_VIA, "
            f"{DEFAULT_VIA}."
        ),
    ] = None,
    namespace: Annotated[str | None, typer.Option(help="Set the namespace, such as /uav1.")] = None,
    profile: Annotated[
        Path | None,
        typer.Option(
            help="Read connection, namespace, clock, remappings and parameters from TOML."
        ),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option("--param", "-p", help="Set a parameter, NAME=VALUE, repeatable."),
    ] = None,
    lock_step: Annotated[
        float | None,
        typer.Option(help="Synchronize the simulation with the node at this period, simulated s."),
    ] = None,
    messages: Annotated[
        list[str] | None,
        typer.Option(help="Read .msg and .srv files of this folder of ROS packages, repeatable."),
    ] = None,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Run a node in its own process, on the graph of a simulation or a real vehicle."""
    from volery.cli.node import NodeOptions, run_node

    run_node(
        NodeOptions(
            node, via, namespace, profile, tuple(param or ()), lock_step, tuple(messages or ())
        )
    )


@topic_app.command("list")
@guarded
def topic_list(types: Types = False, via: Via = DEFAULT_VIA) -> None:
    """List all topics."""
    from volery.cli.topics import list_topics

    list_topics(via, types=types)


@topic_app.command("type")
@guarded
def topic_type(topic: Topic, via: Via = DEFAULT_VIA) -> None:
    """Show a topic's type."""
    from volery.cli.topics import show_type

    show_type(via, topic)


@topic_app.command("echo")
@guarded
def topic_echo(
    topic: Topic,
    via: Via = DEFAULT_VIA,
    count: Annotated[
        int | None, typer.Option("--count", "-n", min=1, help="Exit after this many messages.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Exit after one message.")] = False,
    full_length: Annotated[
        bool, typer.Option("--full-length", "-f", help="Show all elements of long arrays.")
    ] = False,
) -> None:
    """Print a topic's messages as YAML until Ctrl-C."""
    from volery.cli.topics import echo

    echo(via, topic, count=1 if once else count, whole=full_length)


@topic_app.command("hz")
@guarded
def topic_hz(
    topic: Topic,
    via: Via = DEFAULT_VIA,
    window: Annotated[
        int, typer.Option("--window", "-w", min=2, help="Average over this many messages.")
    ] = 10_000,
) -> None:
    """Print a topic's rate each second until Ctrl-C."""
    from volery.cli.topics import Window, measure

    measure(via, topic, window=window, line=Window.rate_line)


@topic_app.command("bw")
@guarded
def topic_bw(
    topic: Topic,
    via: Via = DEFAULT_VIA,
    window: Annotated[
        int, typer.Option("--window", "-w", min=2, help="Average over this many messages.")
    ] = 100,
) -> None:
    """Print a topic's bandwidth, in CDR bytes, each second until Ctrl-C."""
    from volery.cli.topics import Window, measure

    measure(via, topic, window=window, line=Window.bandwidth_line)


@topic_app.command("pub")
@guarded
def topic_pub(
    topic: Topic,
    msgtype: Annotated[str, typer.Argument(help="Type, such as geometry_msgs/msg/Twist.")],
    values: Annotated[str, typer.Argument(help='Message as YAML: "{linear: {x: 1.0}}".')] = "{}",
    via: Via = DEFAULT_VIA,
    rate: Annotated[float, typer.Option("--rate", "-r", help="Set the rate, Hz.")] = 1.0,
    times: Annotated[
        int | None, typer.Option("--times", "-t", min=1, help="Exit after this many messages.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", "-1", help="Publish one message.")] = False,
) -> None:
    """Publish a message until Ctrl-C."""
    from volery.cli.topics import publish

    publish(via, topic, msgtype, values, rate_hz=rate, times=1 if once else times)


@service_app.command("list")
@guarded
def service_list(types: Types = False, via: Via = DEFAULT_VIA) -> None:
    """List all services."""
    from volery.cli.services import list_services

    list_services(via, types=types)


@service_app.command("type")
@guarded
def service_type(service: Service, via: Via = DEFAULT_VIA) -> None:
    """Show a service's type."""
    from volery.cli.services import show_type

    show_type(via, service)


@service_app.command("call")
@guarded
def service_call(
    service: Service,
    values: Annotated[
        str | None, typer.Argument(help='Request as YAML: "{altitude_m: 3.0}".')
    ] = None,
    via: Via = DEFAULT_VIA,
    timeout: Annotated[float, typer.Option(help="Set the timeout, s.")] = 10.0,
) -> None:
    """Call a service and print its response."""
    from volery.cli.services import call

    call(via, service, values, timeout_s=timeout)
