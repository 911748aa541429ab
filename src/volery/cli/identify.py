"""`volery identify`: writes the data file of an airframe's identified plant."""

from __future__ import annotations

from pathlib import Path

from volery.cli.tables import print_table
from volery.core.errors import VoleryError


def identify_and_write(airframe: str, out: Path, order: int) -> None:
    """Flies, fits, writes the file and prints the fit's errors."""
    from volery.control.identification import identify, to_toml
    from volery.vehicle.airframe import load_airframe

    if not out.parent.is_dir():
        raise VoleryError(f"{out}: folder {out.parent} does not exist")
    model = identify(load_airframe(airframe), 1 if order == 1 else 2)
    out.write_text(to_toml(model), encoding="utf-8")
    errors = model.fit_error.model_dump() if model.fit_error else {}
    rows = [(name, f"{value:.4g}") for name, value in errors.items()]
    print_table((str(out), "error (root mean square)"), rows, right=(1,))
