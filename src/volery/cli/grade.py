"""`volery grade`: grades submissions and writes the points as text, JSON, CSV and HTML."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from volery.cli.error_reporting import warn
from volery.cli.terminal import echo_line, echo_lines
from volery.core.errors import ScenarioError, reason_of
from volery.core.plain_text import plain
from volery.core.whole_files import write_whole
from volery.grading.assignment import Assignment, load_assignment
from volery.grading.grader import grade
from volery.grading.grades import Grade, GradedFlight
from volery.grading.sandbox import bubblewrap
from volery.grading.submissions import find_submissions

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums }
th, td { padding: .35rem .6rem; border-bottom: 1px solid #d8dee6; vertical-align: top }
th, td { text-align: left }
.n { text-align: right }
.passed { color: #0b7a4b }
.failed, .error { color: #b3261e }
summary { cursor: pointer }
code { font-size: 13px }
"""


@dataclass(frozen=True)
class GradeOptions:
    """Options of `volery grade`."""

    assignment: Path
    """The assignment's file."""
    submissions: Path
    """A submission, or a folder of them."""
    jobs: int | None = None
    """Number of flights at a time; None: one for each core."""
    csv: Path | None = None
    """File of the table; None: none."""
    html: Path | None = None
    """File of the page; None: none."""


def report_grades(options: GradeOptions, *, as_json: bool) -> None:
    """Grades submissions and reports them.

    Raises `ScenarioError` or `DataFileError` for an invalid assignment, without submissions, and if
    a file cannot be written.
    """
    assignment = load_assignment(options.assignment)
    submissions = find_submissions(options.submissions)
    if bubblewrap() is None:
        warn(
            "bubblewrap (bwrap) is not usable here: submissions have limits of time and memory, "
            "but can read your files; on Debian: apt-get install bubblewrap"
        )
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(
            plain(assignment.name), total=len(submissions) * len(assignment.seeds)
        )
        grades = grade(
            assignment,
            submissions,
            jobs=options.jobs,
            on_flight=lambda _flight: progress.advance(task),
        )
    if as_json:
        echo_lines(json.dumps(_plain(assignment, grades), indent=1))
    else:
        _print(assignment, grades)
    for path, text in ((options.csv, csv_of), (options.html, html_of)):
        if path is not None:
            _write(path, text(assignment, grades))


def _print(assignment: Assignment, grades: Sequence[Grade]) -> None:
    max_points = sum(assignment.points.values())
    width = max(len(grade.submission) for grade in grades)
    for graded in grades:
        echo_line(f"{graded.submission:{width}}  {graded.total:g} of {max_points:g}")
        for name, points in graded.points.items():
            if points < assignment.points[name]:
                echo_line(f"{'':{width}}    {points:g} of {assignment.points[name]:g}  {name}")
        for problem in graded.problems:
            echo_line(f"{'':{width}}    {problem}")


def _plain(assignment: Assignment, grades: Sequence[Grade]) -> dict[str, object]:
    return {
        "assignment": assignment.name,
        "isolated": bubblewrap() is not None,
        "seeds": list(assignment.seeds),
        "grades": [graded.to_data() for graded in grades],
    }


def csv_of(assignment: Assignment, grades: Sequence[Grade]) -> str:
    """Returns a table with a row for each submission."""
    text = io.StringIO()
    writer = csv.writer(text)
    names = list(assignment.points)
    writer.writerow(["submission", "points", "of", *names, "problems"])
    for graded in grades:
        points = graded.points
        row = [f"{points[name]:g}" for name in names]
        max_points = sum(assignment.points.values())
        problems = "; ".join(graded.problems)
        cells = [graded.submission, f"{graded.total:g}", f"{max_points:g}", *row, problems]
        writer.writerow([_harmless(cell) for cell in cells])
    return text.getvalue()


def _harmless(cell: str) -> str:
    """Returns a cell that no spreadsheet takes for a formula."""
    return f"'{cell}" if cell.startswith(("=", "+", "-", "@", "\t", "\r")) else cell


def html_of(assignment: Assignment, grades: Sequence[Grade]) -> str:
    """Returns a page without scripts: the points, and the verdicts on each flight."""
    names = list(assignment.points)
    heads = "".join(
        f'<th class="n">{escape(name)} ({assignment.points[name]:g})</th>' for name in names
    )
    rows = "".join(_row(graded, names) for graded in grades)
    isolation = "under bubblewrap" if bubblewrap() else "with limits of time and memory only"
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{escape(assignment.name)}</title>
<meta name="viewport" content="width=device-width"><style>{_STYLE}</style>
<h1>{escape(assignment.name)}</h1>
<p>Scenario {escape(assignment.scenario.name)}, seeds {assignment.seeds.start} to
{assignment.seeds.stop - 1}; submissions ran {isolation}.</p>
<table><thead><tr><th>Submission</th><th class="n">Points
({sum(assignment.points.values()):g})</th>{heads}</tr></thead>
<tbody>{rows}</tbody></table></html>
"""


def _row(graded: Grade, names: Sequence[str]) -> str:
    points = graded.points
    cells = "".join(f'<td class="n">{points[name]:g}</td>' for name in names)
    flights = "".join(map(_flight, graded.flights))
    what = f"<details><summary>{escape(graded.submission)}</summary>{flights}</details>"
    return f'<tr><td>{what}</td><td class="n">{graded.total:g}</td>{cells}</tr>'


def _flight(flight: GradedFlight) -> str:
    lines = [
        f'<li class="{verdict.outcome}">{verdict.outcome} {escape(verdict.describe())}</li>'
        for verdict in flight.verdicts
    ]
    if flight.problem:
        lines.insert(0, f'<li class="error">{escape(flight.problem)}</li>')
    digest = f" <code>{flight.digest[:16]}</code>" if flight.digest else ""
    return f"<p>seed {flight.seed}{digest}</p><ul>{''.join(lines)}</ul>"


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be written: {reason_of(error)}") from None
