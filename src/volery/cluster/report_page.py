"""The report of a study as one HTML file: distributions, sensitivities, maps, the worst runs."""

from __future__ import annotations

import itertools
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np

from volery.cluster.loading import LoadedStudy
from volery.cluster.metric_names import metrics_of
from volery.cluster.plan import RunPlan
from volery.cluster.report_charts import (
    correlation_chart,
    distribution_chart,
    sensitivity_chart,
    success_map,
)
from volery.cluster.report_data import (
    ParameterAxis,
    is_fraction,
    metric_values,
    parameter_axis,
    rank_correlation,
    varies,
)
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.runs import code_version
from volery.cluster.study_runs import worst_runs
from volery.cluster.summary import point_rows, value_text
from volery.cluster.table import StudyTable
from volery.core.arrays import Array
from volery.core.machine import describe_machine, describe_versions
from volery.core.plurals import counted
from volery.report.page import html_page

_POINTS_SHOWN, _FAILURES_SHOWN, _MAPS_SHOWN = 48, 10, 6
_STYLE = """
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: .85rem; padding: .8rem 1rem;
  background: var(--card); border: 1px solid var(--grid); border-radius: 10px; }
code { font-size: .88em; overflow-wrap: anywhere; }
details { margin: .4rem 0; } summary { cursor: pointer; }
.pair .chart:only-child { max-width: 38rem; }
"""


def write_study_report(
    loaded: LoadedStudy, table: StudyTable, plan: RunPlan, study_file: Path
) -> Path:
    """Writes `report/index.html` into the results folder and returns its path.

    study_file: the study as the user names it, for commands on the page. Raises `StudyError` if
    the file cannot be written.
    """
    folder = ResultsFolder(Path() if table.folder is None else table.folder)
    path = folder.path / "report" / "index.html"
    folder.make(path.parent)
    folder.write_file(path, study_page(loaded, table, plan, study_file).encode())
    return path


def study_page(loaded: LoadedStudy, table: StudyTable, plan: RunPlan, study_file: Path) -> str:
    """Returns the whole page as text."""
    study = loaded.study
    page = _Page(loaded, table, study_file)
    return html_page(
        study.name,
        [
            '<header><p class="kicker">Volery study report</p>',
            f"<h1>{escape(study.name.replace('_', ' '))}</h1>",
            f'<p class="lead">{escape(study.description)}</p>' if study.description else "",
            _missing_note(table, plan),
            "</header>",
            page.tiles(),
            *page.distributions(),
            *page.sensitivities(),
            *page.maps(),
            page.points(),
            page.worst(plan),
            page.failures(),
            page.details(),
        ],
        _STYLE,
        kind="study report",
    )


class _Page:
    """Draws the parts of the page."""

    def __init__(self, loaded: LoadedStudy, table: StudyTable, study_file: Path) -> None:
        self._loaded, self._table, self._file = loaded, table, study_file
        self._values = {name: metric_values(table, name) for name in table.metrics}
        self._axes = [parameter_axis(table, name) for name in table.parameters]
        self._axes = [axis for axis in self._axes if varies(axis.numbers)]
        self._number = 0

    def tiles(self) -> str:
        """Returns the numbers at the top."""
        table = self._table
        tiles = [
            (f"{len(table):,}", "run" if len(table) == 1 else "runs"),
            (f"{table.num_failed:,}", "failed"),
            (f"{len(set(table['point'])):,}", "parameter points"),
            (_duration(sum(table["simulated_s"])), "simulated in all"),
            (_duration(sum(table["cpu_s"])), "CPU time"),
        ]
        success = self._values.get("success")
        if success is not None and np.isfinite(success).any():
            tiles.insert(2, (f"{100.0 * np.nanmean(success):.1f} %", "successful"))
        cells = "".join(f"<div><dd>{escape(v)}</dd><dt>{escape(n)}</dt></div>" for v, n in tiles)
        return f'<dl class="tiles">{cells}</dl>'

    def distributions(self) -> list[str]:
        """Returns the distribution of each metric over all runs."""
        charts = [
            self._chart(distribution_chart(values, name), f"Distribution of {name} over all runs.")
            for name, values in self._values.items()
            if varies(values)
        ]
        same = [
            f"{escape(name)} is {value_text(float(values[np.isfinite(values)][0]))}"
            for name, values in self._values.items()
            if np.isfinite(values).any() and not varies(values)
        ]
        note = f"<p>The same in all runs: {', '.join(same)}.</p>" if same else ""
        lead = (
            "<p>Orange: the mean with its 95 % confidence interval; dashed: the median.</p>"
            if charts
            else ""
        )
        return ["<h2>Distributions</h2>", lead, *_pairs(charts), note]

    def sensitivities(self) -> list[str]:
        """Returns how each varying metric depends on each varying parameter."""
        charts = []
        numeric = [axis for axis in self._axes if axis.is_numeric]
        for name, values in self._values.items():
            if not varies(values):
                continue
            if len(numeric) > 1:
                found = [(a.name, rank_correlation(a.numbers, values)) for a in numeric]
                known = [(each, value) for each, value in found if np.isfinite(value)]
                if known:
                    chart = correlation_chart([n for n, _ in known], [v for _, v in known], name)
                    text = f"Spearman's rank correlation of each parameter with {name}."
                    charts.append(self._chart(chart, text))
            charts += [
                self._chart(
                    sensitivity_chart(axis, values, name), _sensitivity_text(axis, name, values)
                )
                for axis in self._axes
            ]
        return ["<h2>Sensitivity</h2>", *_pairs(charts)] if charts else []

    def maps(self) -> list[str]:
        """Returns maps of the first metric that varies over pairs of parameters; success first."""
        entries = sorted(metrics_of(self._loaded.study), key=lambda e: e.name != "success")
        varying = [e for e in entries if e.name in self._values and varies(self._values[e.name])]
        pairs = list(itertools.combinations(self._axes, 2))[:_MAPS_SHOWN]
        if not varying or not pairs:
            return []
        name, low = varying[0].name, varying[0].worst == "low"
        charts = [self._map(across, up, self._values[name], name, low) for across, up in pairs]
        return [f"<h2>Maps of {escape(name)}</h2>", *_pairs(charts)]

    def points(self) -> str:
        """Returns the table of parameter points."""
        head, rows = point_rows(self._table)
        more = len(rows) - _POINTS_SHOWN
        note = f"<p>And {more:,} more; table.parquet has all runs.</p>" if more > 0 else ""
        cells = [map(escape, row) for row in rows[:_POINTS_SHOWN]]
        return f"<h2>Parameter points</h2>{_table(head, cells)}{note}"

    def worst(self, plan: RunPlan) -> str:
        """Returns the worst runs and the commands that open their logs."""
        study, table = self._loaded.study, self._table
        chosen = worst_runs(self._loaded, plan)
        if not chosen:
            return ""
        by_run = {row["run"]: row for row in table}
        metric = study.worst.metric if study.worst else metrics_of(study)[0].name
        head = ["run", "seed", *table.parameters, *table.metrics, "log"]
        rows, unrecorded = [], []
        for run in chosen:
            row = by_run[run.id]
            cells = [row["seed"], *(row[n] for n in (*table.parameters, *table.metrics))]
            link = f'<a href="../{escape(row["log"])}">{escape(Path(row["log"]).suffix[1:])}</a>'
            rows.append([f"<code>{run.id[:12]}</code>", *map(_cell, cells), row["log"] and link])
            unrecorded += [] if row["log"] else [run.id[:12]]
        return (
            f"<h2>Worst runs by {escape(metric)}</h2>{_table(head, rows)}"
            f"{self._record_command(unrecorded)}{self._open_command()}"
        )

    def _record_command(self, runs: Sequence[str]) -> str:
        """Returns the command that records logs of runs."""
        if not runs:
            return ""
        words = ["volery", "sweep", str(self._file)]
        folder = self._table.folder
        words += [] if folder is None else ["--out", str(folder)]
        words += ["--trust"] if self._loaded.is_trusted else []
        words += [word for run in runs for word in ("--log", run)]
        return f"<p>Fly them again with a log:</p><pre>{escape(shlex.join(words))}</pre>"

    def _open_command(self) -> str:
        """Returns the command that opens logs on the page."""
        words = [
            "volery",
            "serve",
            "--recordings-dir",
            str((self._table.folder or Path()) / "logs"),
        ]
        return (
            f"<p>Open the logs on the page, by the names of the runs:</p>"
            f"<pre>{escape(shlex.join(words))}</pre>"
        )

    def failures(self) -> str:
        """Returns the failed runs by their reasons, with a traceback of each."""
        rows = [row for row in self._table if row["status"] == "failed"]
        if not rows:
            return ""
        reasons = Counter(row["error"] for row in rows)
        parts = []
        for reason, count in reasons.most_common(_FAILURES_SHOWN):
            row = next(row for row in rows if row["error"] == reason)
            trace = escape(self._table.tracebacks[row["run"]] or reason)
            parts.append(
                f"<details><summary>{counted(count, 'run')}: {escape(reason)}</summary>"
                f"<p>First: run <code>{row['run']}</code>, seed {row['seed']}</p>"
                f"<pre>{trace}</pre></details>"
            )
        return f"<h2>Failed runs</h2>{''.join(parts)}"

    def details(self) -> str:
        """Returns how the study was flown."""
        study = self._loaded.study
        rows = [
            ("study", str(self._file)),
            ("scenario", study.scenario),
            ("simulated time of a run", f"{self._loaded.duration_s:g} s"),
            ("code", code_version()),
            *describe_machine().items(),
            *((f"{name} version", version) for name, version in describe_versions().items()),
        ]
        lines = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
        table = f'<div class="scroll"><table class="facts"><tbody>{lines}</tbody></table></div>'
        return f"<h2>How it was made</h2>{table}"

    def _chart(self, svg: str, text: str) -> str:
        self._number += 1
        caption = f"<figcaption><b>Figure {self._number}.</b> {escape(text)}</figcaption>"
        return f'<figure class="chart">{svg}{caption}</figure>'

    def _map(
        self, across: ParameterAxis, up: ParameterAxis, values: Array, name: str, low: bool
    ) -> str:
        chart = success_map(across, up, values, name, low_is_bad=low)
        is_grid = bool(across.levels and up.levels)
        what = f"Mean of {name}" if is_grid else f"{name} of each run"
        return self._chart(chart, f"{what} over {across.name} and {up.name}.")


def _sensitivity_text(axis: ParameterAxis, name: str, values: Array) -> str:
    dots = "" if is_fraction(values) else "runs in blue, "
    return f"{name} over {axis.name}: {dots}means with 95 % confidence intervals."


def _missing_note(table: StudyTable, plan: RunPlan) -> str:
    missing = plan.total - len(table)
    if not missing:
        return ""
    return f'<p class="note">{counted(missing, "run")} of {plan.total:,} not flown yet.</p>'


def _pairs(charts: Sequence[str]) -> list[str]:
    return ['<div class="pair">', *charts, "</div>"] if charts else []


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(f"<tr>{''.join(f'<td>{c}</td>' for c in row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table class="numbers"><thead><tr>{names}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div>"
    )


def _duration(seconds: float) -> str:
    if seconds >= 3600.0:
        return f"{seconds / 3600.0:.1f} h"
    return f"{seconds / 60.0:.1f} min" if seconds >= 60.0 else f"{seconds:.1f} s"


def _cell(value: object) -> str:
    return "" if value is None else escape(value_text(value))
