"""Parses TOML with a limit on its nesting.

The parser of the standard library remembers each start of a dotted key: time and memory grow with
the square of the number of its parts. Lists and inline tables it parses by recursion.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

MOST_PARTS = 50
"""Max number of parts of a dotted key, such as 3 of `world.terrain.kind`."""
_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_TOO_LONG = re.compile(rf"(?<![A-Za-z0-9_.\"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MOST_PARTS}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text.

    Raises `tomllib.TOMLDecodeError` if it is not TOML, or is nested too deep.
    """
    found = _TOO_LONG.search(text)
    if found is not None:
        line = text.count("\n", 0, found.start()) + 1
        raise tomllib.TOMLDecodeError(
            f"a key of more than {MOST_PARTS} parts (at line {line}); it is nested too deep"
        )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("its lists or tables are nested too deep") from None
