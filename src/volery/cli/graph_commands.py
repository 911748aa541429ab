"""`volery node`, `volery topic ...` and `volery service ...`, with their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.connections import DEFAULT_VIA, WAYS
from volery.cli.error_reporting import guarded
from volery.cli.options import TracebackOption

_CONTEXT = {"help_option_names": ["-h", "--help"]}
topic_app = typer.Typer(no_args_is_help=True, context_settings=_CONTEXT)
service_app = typer.Typer(no_args_is_help=True, context_settings=_CONTEXT)

Via = Annotated[
    str,
    typer.Option(help=f"Way into the graph: {WAYS}; else VOLERY_VIA."),
]
ViaOfAll = Annotated[
    str,
    typer.Option("--via", envvar="VOLERY_VIA", help=f"Way into the graph, here or last: {WAYS}."),
]
Topic = Annotated[str, typer.Argument(help="Name of a topic.")]
Service = Annotated[str, typer.Argument(help="Name of a service.")]
Types = Annotated[bool, typer.Option("--types", "-t", help="Show types too.")]


@topic_app.callback()
def topics(context: typer.Context, via: ViaOfAll = DEFAULT_VIA) -> None:
    """Look at topics and publish on them."""
    _use(context, via)


@service_app.callback()
def services(context: typer.Context, via: ViaOfAll = DEFAULT_VIA) -> None:
    """Look at services and call them."""
    _use(context, via)


def _use(context: typer.Context, via: str) -> None:
    """Have the group's commands take this way unless they are given one themselves."""
    commands = getattr(context.command, "commands", {})
    context.default_map = {name: {"via": via} for name in commands}


@guarded
def node(
    node: Annotated[str, typer.Argument(help="Name (volery list --nodes) or module:Class.")],
    via: Annotated[
        str | None,
        typer.Option(
            help=f"Way into the graph: {WAYS}; else the profile's, VOLERY_VIA, {DEFAULT_VIA}."
        ),
    ] = None,
    namespace: Annotated[str | None, typer.Option(help="Such as /uav1.")] = None,
    profile: Annotated[
        Path | None, typer.Option(help="TOML: way, namespace, clock, other names, parameters.")
    ] = None,
    param: Annotated[
        list[str] | None, typer.Option("--param", "-p", help="NAME=VALUE, repeatable.")
    ] = None,
    lock_step: Annotated[
        float | None,
        typer.Option(help="Have the simulation wait for the node each so many simulated s: 0.001."),
    ] = None,
    messages: Annotated[
        list[str] | None,
        typer.Option(help="Folder of ROS packages with .msg and .srv files, repeatable."),
    ] = None,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Run a node as a process of its own, on the graph of a simulation or a real vehicle."""
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
        int | None, typer.Option("--count", "-n", min=1, help="End after so many messages.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End after one message.")] = False,
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
    window: Annotated[int, typer.Option("--window", "-w", min=2, help="Messages.")] = 10_000,
) -> None:
    """Print a topic's rate each second until Ctrl-C."""
    from volery.cli.topics import Window, measure

    measure(via, topic, window=window, line=Window.rate_line)


@topic_app.command("bw")
@guarded
def topic_bw(
    topic: Topic,
    via: Via = DEFAULT_VIA,
    window: Annotated[int, typer.Option("--window", "-w", min=2, help="Messages.")] = 100,
) -> None:
    """Print a topic's bandwidth, in CDR bytes, each second until Ctrl-C."""
    from volery.cli.topics import Window, measure

    measure(via, topic, window=window, line=Window.bandwidth_line)


@topic_app.command("pub")
@guarded
def topic_pub(
    topic: Topic,
    msgtype: Annotated[str, typer.Argument(help="Such as geometry_msgs/msg/Twist.")],
    values: Annotated[str, typer.Argument(help='YAML: "{linear: {x: 1.0}}".')] = "{}",
    via: Via = DEFAULT_VIA,
    rate: Annotated[float, typer.Option("--rate", "-r", help="Hz.")] = 1.0,
    times: Annotated[
        int | None, typer.Option("--times", "-t", min=1, help="End after so many messages.")
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
    values: Annotated[str | None, typer.Argument(help='YAML: "{altitude_m: 3.0}".')] = None,
    via: Via = DEFAULT_VIA,
    timeout: Annotated[float, typer.Option(help="s.")] = 10.0,
) -> None:
    """Call a service and print its response."""
    from volery.cli.services import call

    call(via, service, values, timeout_s=timeout)
