"""`volery bench`: runs benchmarks, prints and saves their results."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from volery.cli.build_info import describe_build
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.core.errors import VoleryError
from volery.core.whole_files import write_whole
from volery_benchmarks.document import render
from volery_benchmarks.registry import BENCHES, Result, find


def measure_and_show(
    name: str,
    *,
    as_json: bool,
    out: Path | None,
    markdown: Path | None,
    quick: bool = False,
    only: Sequence[str] = (),
) -> None:
    """Measures one bench, or all of them, each in its own process."""
    for path in (out, markdown):
        if path is not None and not path.parent.is_dir():
            raise VoleryError(f"{path}: folder {path.parent} does not exist")
    with _with_progress():
        if name == "all" and quick:
            short = ", ".join(each for each, bench in BENCHES.items() if bench.has_quick)
            raise VoleryError(f"--quick is for one of these benches: {short}")
        if name == "all" and only:
            whole = ", ".join(each for each, bench in BENCHES.items() if bench.has_parts)
            raise VoleryError(f"--only is for one of these benches: {whole}")
        if name == "all":
            results = [_in_own_process(each) for each, bench in BENCHES.items() if bench.in_all]
        else:
            results = [find(name).run(quick=quick, only=only)]
    document = _document(results) if name == "all" else results[0].as_dict()
    if as_json:
        echo_line(json.dumps(document))
    else:
        for result in results:
            _show(result)
    if out is not None:
        write_whole(out, json.dumps(document, indent=2) + "\n")
    if markdown is not None:
        write_whole(markdown, render(results))


def _document(results: Sequence[Result]) -> dict[str, Any]:
    """Returns all results with the build and the date; each result names its machine."""
    return {
        "build": asdict(describe_build()),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "results": [result.as_dict() for result in results],
    }


@contextmanager
def _with_progress() -> Iterator[None]:
    """Makes long benches report their progress on standard error."""
    log, handler = logging.getLogger("volery_benchmarks"), logging.StreamHandler()
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


def _in_own_process(name: str) -> Result:
    """Runs a bench in a new process, so that the memory of other benches does not affect it."""
    command = [sys.executable, "-P", "-m", "volery.cli.app", "bench", name, "--json"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise VoleryError(f"bench '{name}' failed with exit code {done.returncode}")
    return Result.from_json(done.stdout.strip().splitlines()[-1])


def _show(result: Result) -> None:
    bounds = BENCHES[result.bench].bounds
    rows = []
    for figure, value in result.figures.items():
        bound = bounds.get(figure)
        verdict = "" if bound is None else "ok" if bound.holds(value) else "missed"
        rows.append((figure, f"{value:,.4g}", str(bound or ""), verdict))
    print_table((result.bench, "figure", "bound", ""), rows, right=(1, 2))
    for what, reason in result.failures.items():
        echo_line(f"not measured: {what}: {reason}")
