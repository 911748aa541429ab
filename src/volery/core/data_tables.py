"""Reads tables of constants from TOML files beside the modules that use them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any


def read_table(module_file: str, name: str) -> dict[str, Any]:
    """Returns the tables of the TOML file `name` in the folder of a module.

    module_file: the module's `__file__`.
    """
    return tomllib.loads(Path(module_file).with_name(name).read_text(encoding="utf-8"))
