"""Commands about this machine: bench and doctor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded

_BENCHES = (
    "lidar, fleet, camera, dynamics, reset, start, bridge, ros2, coverage, avoidance, search, "
    "mavlink, comms, page, forest_search, load, hostile, cluster, swarm, verdicts, learning, peers"
)
_QUICK = "lidar, forest_search, load, hostile, cluster, swarm, verdicts"


@guarded
def bench(
    name: Annotated[str, typer.Argument(help=f"Benchmark: all, {_BENCHES}.")] = "",
    all_benches: Annotated[
        bool, typer.Option("--all", help="Run all that take minutes and need no extra.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object with machine and versions.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Write the JSON to this file.")] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Write figures and bounds as a page.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help=f"Run the short version of {_QUICK}.")
    ] = False,
    only: Annotated[
        str,
        typer.Option(
            help="Measure these parts of swarm, verdicts or learning, separated by commas."
        ),
    ] = "",
) -> None:
    """Measure how fast Volery is on this machine."""
    from volery.cli.bench import measure_and_show

    if all_benches == bool(name):
        raise typer.BadParameter(f"name one benchmark or say --all: {_BENCHES}")
    name = name or "all"
    parts = tuple(part.strip() for part in only.split(",") if part.strip())
    measure_and_show(name, as_json=json, out=out, markdown=markdown, quick=quick, only=parts)


@guarded
def doctor() -> None:
    """Check this machine and installation; problems come with their fix."""
    from volery.cli.doctor import examine

    if not examine():
        raise typer.Exit(1)
