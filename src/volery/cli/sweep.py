"""`volery sweep`: flies studies, repeats and records runs, and writes reports."""

from __future__ import annotations

import re
import time
from pathlib import Path

from volery.cli.sweep_progress import StudyProgress
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.cli.trust import may_run_local_code
from volery.cluster.errors import StudyError
from volery.cluster.loading import LoadedStudy, load_study, read_study
from volery.cluster.metric_names import metrics_of
from volery.cluster.study_runs import TABLE_FILE, SweepOptions, fly_study, on_ray, stored_plan
from volery.cluster.summary import point_rows
from volery.cluster.table import StudyTable
from volery.core.plurals import counted

_PART = re.compile(r"(\d+)/(\d+)")
_POINTS_SHOWN = 24


def parse_part(text: str | None) -> tuple[int, int] | None:
    """Returns the part `(i, n)` of `I/N`. Raises `StudyError` for another text."""
    if text is None:
        return None
    found = _PART.fullmatch(text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise StudyError(f"--part: I/N with I from 1 to N, such as 3/16, not '{text}'")
    return int(found[1]), int(found[2])


class SweepCommand:
    """Runs one `volery sweep`; see the options of the command."""

    def __init__(
        self, study: Path, out: Path | None, workers: int | None, ray: str | None, *, trust: bool
    ) -> None:
        self._file = study
        self._loaded = _loaded(study, trust=trust)
        self._results = Path("runs") / self._loaded.study.name if out is None else out
        self._workers = workers
        self._executor = None if ray is None else on_ray(ray, workers)

    def fly(self, part: tuple[int, int] | None, *, retry_failed: bool, report: bool) -> None:
        """Flies the missing runs and writes the table and, if wanted, the report."""
        if report and part is not None:
            raise StudyError("--report is of all parts: leave --part out when all have ended")
        start = time.monotonic()
        with StudyProgress(self._loaded.study.name) as progress:
            options = SweepOptions(
                self._results,
                self._workers,
                part,
                retry_failed,
                self._executor,
                on_progress=progress.update,
            )
            try:
                table = fly_study(self._loaded, options)
            except KeyboardInterrupt:
                progress.stop()
                self._print_how_to_continue()
                raise
        self._print(table, progress.flown, time.monotonic() - start, part)
        if report:
            from volery.cluster.report_page import write_study_report

            plan = stored_plan(self._loaded, self._results)
            path = write_study_report(self._loaded, table, plan, self._file)
            echo_line(f"report  {path}")

    def verify(self, count: int) -> None:
        """Repeats finished runs and compares their results."""
        from volery.cluster.verification import verify_study

        options = SweepOptions(self._results, self._workers, executor=self._executor)
        repeated, differences = verify_study(self._loaded, options, count)
        for each in differences:
            echo_line(f"run {each.run}: {each.what}")
        if differences:
            raise StudyError(
                f"{len(differences)} of {counted(repeated, 'repeated run')} differ: a node or a "
                "metric is not repeatable"
            )
        echo_line(f"{counted(repeated, 'run')} repeated alone, with all sensors: equal")

    def record(self, names: list[str]) -> None:
        """Records logs of finished runs, named by their identities or the beginnings of them."""
        from volery.cluster.verification import record_runs

        plan = stored_plan(self._loaded, self._results)
        chosen = []
        for name in names:
            found = [run for run in plan.results if run.startswith(name)]
            if len(found) != 1:
                what = "no finished run" if not found else f"{len(found)} runs"
                raise StudyError(f"--log {name}: {what} of this study in {self._results}")
            chosen += [run for run in plan.wanted() if run.id == found[0]]
        options = SweepOptions(self._results, self._workers, executor=self._executor)
        record_runs(self._loaded, options, chosen)
        for run in chosen:
            echo_line(f"log     {self._results / 'logs' / f'{run.id}.mcap'}")
        echo_line(f"page    volery serve --recordings-dir {self._results / 'logs'}")

    def _print_how_to_continue(self) -> None:
        plan = stored_plan(self._loaded, self._results)
        echo_line(
            f"{len(plan.results):,} of {counted(plan.total, 'run')} are in {self._results}; the "
            "same command flies the others",
            err=True,
        )

    def _print(
        self, table: StudyTable, flown: int, seconds: float, part: tuple[int, int] | None
    ) -> None:
        what = "" if part is None else f" (part {part[0]} of {part[1]})"
        rate = f", {flown / seconds:.1f} runs/s" if flown else ""
        echo_line(
            f"{self._loaded.study.name}{what}: {counted(len(table), 'run')}, "
            f"{table.num_failed:,} failed; {flown:,} flown now in {seconds:.1f} s{rate}"
        )
        for row in [row for row in table if row["status"] == "failed"][:3]:
            echo_line(f"  failed: {row['run']}: {row['error']}")
        if part is not None:
            return
        head, rows = point_rows(table)
        if len(rows) <= _POINTS_SHOWN:
            print_table(head, rows, right=range(len(table.parameters), len(head)))
        echo_line(f"table   {self._results / TABLE_FILE}")


def _loaded(path: Path, *, trust: bool) -> LoadedStudy:
    """Loads a study; asks at a terminal whether its own functions may run."""
    if not trust:
        entries = [entry for entry in metrics_of(read_study(path)) if not entry.is_built_in]
        own = {entry.function.partition(":")[0] for entry in entries}
        trust = may_run_local_code(path, sorted(own))
    return load_study(path, trust=trust)
