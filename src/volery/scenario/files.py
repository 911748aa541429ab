"""Where the files that a scenario names are found."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import DataFileError

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"
"""Where the data files lie that come with Volery."""


def resolve(name: str, folder: Path | None, shipped: Path) -> Path:
    """Path of `name`: beside the scenario, from the working folder, else among the shipped data.

    Raises `DataFileError` listing the places looked at.
    """
    given = Path(name)
    places = [given] if given.is_absolute() else [(folder or Path()) / given, given, shipped / name]
    for place in places:
        if place.is_file():
            return place
    looked = ", ".join(dict.fromkeys(str(place.parent.resolve()) for place in places))
    raise DataFileError(f"no file '{name}' (looked in {looked})")
