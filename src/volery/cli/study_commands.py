"""Commands about many runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from volery.cli.error_reporting import guarded
from volery.cli.options import TracebackOption
from volery.core.errors import ScenarioError


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


@guarded
def judge(
    scenarios: Annotated[
        list[str],
        typer.Argument(help="Scenario names (volery list), TOML files, or folders of them."),
    ],
    seeds: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Fly this number of seeds; default: the scenario's."),
    ] = None,
    first_seed: Annotated[int, typer.Option(min=0, help="Set the first seed of --seeds.")] = 1,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=LOW:HIGH",
            help="Draw a value of a key for each seed, such as wind=0:6, repeatable.",
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Set the duration of the flights, simulated s.")
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Set the number of processes; default: one per core."),
    ] = None,
    timeout: Annotated[
        float | None, typer.Option(min=0.1, help="End a flight after this wall time, s.")
    ] = None,
    search: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=100_000,
            metavar="N",
            help="Search the values of --vary and --seeds for a failure, in N flights at most.",
        ),
    ] = None,
    sampler: Annotated[
        Literal["tpe", "random"] | None,
        typer.Option(help="Set what proposes values for --search; default: tpe."),
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the verdicts as JUnit XML.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
    out: Annotated[
        Path, typer.Option(help="Set the folder for logs and scenarios of failed flights.")
    ] = Path("runs/test"),
    no_logs: Annotated[
        bool, typer.Option("--no-logs", help="Do not repeat failed flights for their logs.")
    ] = False,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run code that the scenarios name: nodes, predicates.")
    ] = False,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Fly scenarios and judge the flights by their expectations.

    Exit codes: 0 all flights passed, 1 some failed, 2 a test could not start.
    """
    from volery.cli.scenario_tests import TestOptions
    from volery.cli.test_report import report_search, report_tests

    options = TestOptions(
        paths=tuple(scenarios),
        seeds=seeds,
        first_seed=first_seed,
        jobs=jobs,
        vary=tuple(vary or ()),
        seconds=seconds,
        timeout_s=timeout,
        out=out,
        keeps_logs=not no_logs,
        trust=trust,
    )
    if search is None:
        if sampler is not None:
            raise ScenarioError("--sampler proposes values for --search, which is not given")
        passed = report_tests(options, junit, as_json=as_json)
    else:
        passed = report_search(options, search, sampler or "tpe", junit, as_json=as_json)
    if not passed:
        raise typer.Exit(1)


@guarded
def grade(
    assignment: Annotated[Path, typer.Argument(help="Assignment (.toml).")],
    submissions: Annotated[
        Path, typer.Argument(help="Folder of submissions, or one of them (.py or a folder).")
    ],
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Set the number of flights at a time; default: cores."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the points as a table.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a page with points and verdicts.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all verdicts as JSON.")] = False,
    traceback: TracebackOption = False,  # noqa: ARG001  # of `guarded`
) -> None:
    """Fly nodes of students with the same seeds and give points for the expectations.

    Each node runs in a process of limited time and memory, under bubblewrap without access to other
    files and networks. The scenario of the assignment is trusted, submissions are not.
    """
    from volery.cli.grade import GradeOptions, report_grades

    report_grades(GradeOptions(assignment, submissions, jobs, csv, html), as_json=as_json)
