"""Commands about many runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.options import TracebackOption


@guarded
def sweep(
    study: Annotated[Path, typer.Argument(help="Study file (.toml).")],
    out: Annotated[
        Path | None, typer.Option(help="Set the folder of results; default: runs/NAME.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=1024,
            help="Set the number of processes; default: one per core; 0: only this one.",
        ),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Fly on a Ray cluster: HOST:PORT, or auto."),
    ] = None,
    part: Annotated[
        str | None, typer.Option(help="Fly part I/N of the runs, as in an array job of Slurm.")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Fly failed runs again.")
    ] = False,
    report: Annotated[
        bool, typer.Option("--report", help="Write a report of the results: report/index.html.")
    ] = False,
    verify: Annotated[
        int | None, typer.Option(min=1, help="Repeat this number of finished runs and compare.")
    ] = None,
    log: Annotated[
        list[str] | None,
        typer.Option(help="Fly this finished run again and keep its log, repeatable."),
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run code beside the study: metrics and nodes.")
    ] = False,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Fly all runs of a study; finished runs are kept, so the same command continues.

    Ctrl-C ends it and loses only the runs that are being flown.
    """
    from volery.cli.sweep import SweepCommand, parse_part

    command = SweepCommand(study, out, workers, ray, trust=trust)
    if verify is not None:
        command.verify(verify)
    elif log:
        command.record(log)
    else:
        command.fly(parse_part(part), retry_failed=retry_failed, report=report)
