"""Loads a `Scenario` from a TOML file, with errors that name file, key and allowed values."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from volery.core.errors import ScenarioError, reason_of
from volery.core.near_names import near_miss
from volery.core.toml_text import parse_toml
from volery.scenario import library
from volery.scenario.access import ScenarioAccess
from volery.scenario.schema import Scenario
from volery.scenario.validation import validated


def load_scenario(
    name_or_path: str | Path, *, trust: bool = False, confined: bool = False
) -> Scenario:
    """Loads a scenario by its name in the library or by the path of a TOML file.

    trust: whether nodes may be modules in the file's folder or the working folder; otherwise nodes
    come from Volery and from installed packages. confined: whether the file is another person's:
    then it reads only below its own folder and among shipped data, and starts shipped nodes only.
    Raises `ScenarioError`, naming file, key and allowed values, for an invalid file.
    """
    path = _find(name_or_path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {reason_of(error)}") from None
    try:
        data = parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path}: not valid TOML: {error}") from None
    access = ScenarioAccess(path.parent, is_confined=confined, is_trusted=trust and not confined)
    return parse_scenario(data, where=str(path), access=access)


def has_tables(path: Path, *names: str) -> bool:
    """Returns whether a file seems to be a scenario with these arrays of tables, such as `expect`.

    It need not be valid: a scenario with a fault is one, too. False for a file that cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return False
    wanted = (rf"^[ \t]*(\[\[[ \t]*{name}[ \t]*\]\]|{name}[ \t]*=)" for name in ("uavs", *names))
    return all(re.search(pattern, text, re.MULTILINE) for pattern in wanted)


def list_scenarios() -> list[str]:
    """Returns the names of the shipped scenarios, sorted; `load_scenario` loads each of them."""
    return library.names()


def parse_scenario(
    data: dict[str, Any],
    *,
    where: str = "scenario",
    access: ScenarioAccess = ScenarioAccess(),  # noqa: B008 - frozen
) -> Scenario:
    """Returns the scenario of plain data, validated against the schema.

    where: names the source in errors. access: files and code that the scenario may use; the default
    is for scenarios that a program makes. Raises `ScenarioError`, naming key and allowed values,
    for invalid data.
    """
    return validated(data, Scenario, where).with_access(access)


def _find(name_or_path: str | Path) -> Path:
    if not isinstance(name_or_path, str | Path):
        raise ScenarioError(
            "a scenario is a shipped one's name, the path of a .toml file or a Scenario, not "
            f"{type(name_or_path).__name__}; parse_scenario makes one of plain data"
        )
    path = Path(name_or_path)
    if path.suffix == ".toml" or path.exists():
        if path.is_dir():
            raise ScenarioError(f"{path} is a folder; a scenario is a .toml file")
        if not path.exists():
            raise ScenarioError(f"{path}: no such file")
        return path
    shipped = library.path_of(str(name_or_path))
    if shipped is None:
        known = ", ".join(library.names())
        hint = near_miss(name_or_path, library.names())
        raise ScenarioError(
            f"no scenario '{name_or_path}'{hint} It is neither a file nor one of: {known}"
        )
    return shipped
