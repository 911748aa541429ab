"""`volery export`: writes the world of a scenario as a glTF file."""

from __future__ import annotations

from pathlib import Path

import typer

from volery.core.errors import VoleryError


def export_and_report(scenario: str, file: Path, detail: str) -> None:
    """Writes the file and prints its size."""
    from volery import load_scenario
    from volery.runtime.build.world_export import export_world
    from volery.world.trees import DetailLevel

    if file.suffix.lower() != ".glb":
        raise VoleryError(f"{file}: worlds are written as binary glTF; the name must end in .glb")
    if not file.parent.is_dir():
        raise VoleryError(f"{file}: folder {file.parent} does not exist")
    if detail not in list(DetailLevel):
        raise VoleryError(f"--detail must be one of {', '.join(DetailLevel)} (found {detail!r})")
    size = export_world(load_scenario(scenario), file, detail=DetailLevel(detail))
    typer.echo(f"{file} ({size / 1e6:.1f} MB)")
