"""Parses TOML with a limit on its nesting.

The parser of the standard library remembers each start of a dotted key: time and memory grow with
the square of the number of its parts. Lists and inline tables it parses by recursion.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

MAX_PARTS = 50
"""Max number of parts of a dotted key, such as 3 of `world.terrain.kind`."""
_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_TOO_LONG = re.compile(rf"(?<![A-Za-z0-9_.\"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MAX_PARTS}}}")


_LINE = re.compile(r"line (\d+)")
_ADVICE = (
    (re.compile(r"""\s*[\w-]+\s*:(\s|$)|---"""), "this looks like YAML; TOML has key = value"),
    (re.compile(r"\s*[{\[]?\s*\"[^\"]*\"\s*:|\s*\{"), "this looks like JSON; TOML has key = value"),
    (re.compile(r".*=\s*(True|False|yes|no|on|off)\b"), "write true or false"),
    (re.compile(r".*=\s*(None|null|nil|~)"), "TOML has no such value; leave the key out"),
    (
        re.compile(r".*=\s*\.\d|.*=\s*\d+\.(\s|,|$)"),
        "a number has digits on both sides of its point",
    ),
    (re.compile(r'.*=\s*"[^"]*\\'), "write / in paths, or '...' around a text with \\"),
    (re.compile(r".*=\s*[A-Za-z_]"), "a text is in quotes"),
)
"""What a line with an error looks like, and what to do about it."""


def parse_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text.

    Raises `tomllib.TOMLDecodeError` if it is not TOML, or is nested too deep.
    """
    found = _TOO_LONG.search(text)
    if found is not None:
        line = text.count("\n", 0, found.start()) + 1
        raise tomllib.TOMLDecodeError(
            f"a key of more than {MAX_PARTS} parts (at line {line}); it is nested too deep"
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise tomllib.TOMLDecodeError(f"{error}{_advice(str(error), text)}") from None
    except RecursionError:
        raise tomllib.TOMLDecodeError("its lists or tables are nested too deep") from None


def _advice(error: str, text: str) -> str:
    """Returns what to do about an error, for lines that are often written; else empty."""
    found = _LINE.search(error)
    lines = text.splitlines()
    number = int(found[1]) if found else 0
    line = lines[number - 1] if 0 < number <= len(lines) else ""
    advice = next((advice for look, advice in _ADVICE if look.match(line)), "")
    return f": {advice}" if advice else ""
