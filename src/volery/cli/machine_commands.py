"""Commands about this machine: how fast Volery is on it, and whether all is well."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.bench.registry import BENCHES
from volery.cli.error_reporting import guarded

_QUICK = [name for name, bench in BENCHES.items() if bench.has_quick]


@guarded
def bench(
    name: Annotated[str, typer.Argument(help=f"all, or one: {', '.join(BENCHES)}.")],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object a bench.")] = False,
    out: Annotated[Path | None, typer.Option(help="Write the JSON to this file too.")] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Write a page with figures and bounds.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help=f"Shorter, where the bench can: {', '.join(_QUICK)}.")
    ] = False,
) -> None:
    """Measure how fast Volery is on this machine."""
    from volery.cli.bench import measure_and_show

    measure_and_show(name, as_json=json, out=out, markdown=markdown, quick=quick)


@guarded
def doctor() -> None:
    """Check this machine and installation; each line is ok or says how to mend it."""
    from volery.cli.doctor import examine

    if not examine():
        raise typer.Exit(1)
