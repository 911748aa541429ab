"""Matches regular expressions of clients in time linear in pattern and text length.

Python's own `re` backtracks: a pattern of twenty characters can block it practically forever, and
no other thread runs meanwhile. RE2 does not backtrack.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from volery.core.errors import PatternError

MAX_PATTERN_CHARACTERS = 200
_MAX_PATTERN_MEMORY = 1024 * 1024
"""Limit of the bytes of a compiled pattern and its automaton."""
_MAX_TEXT_CHARACTERS = 100_000


@lru_cache(maxsize=64)
def posix_search(pattern: str) -> Callable[[str], bool]:
    r"""Returns a function that searches a text for a POSIX extended regular expression.

    The classes `\d \s \w` and `\b` are supported too. Raises `PatternError` if the pattern is
    invalid, or needs too much memory.
    """
    if len(pattern) > MAX_PATTERN_CHARACTERS:
        raise PatternError(f"a pattern may have at most {MAX_PATTERN_CHARACTERS} characters")
    import re2

    try:
        expression = re2.compile(pattern, options=_options())
    except (re2.error, UnicodeEncodeError) as error:
        raise PatternError(f"'{pattern}' is not a regular expression: {_reason(error)}") from None

    def search(text: str) -> bool:
        readable = text[:_MAX_TEXT_CHARACTERS].encode("utf-8", "replace").decode("utf-8")
        return expression.search(readable) is not None

    return search


def _options() -> Any:
    import re2

    options = re2.Options()
    options.posix_syntax = True
    options.perl_classes = True
    options.word_boundary = True
    options.one_line = True
    options.dot_nl = True
    options.never_capture = True
    options.log_errors = False
    options.max_mem = _MAX_PATTERN_MEMORY
    return options


def _reason(error: Exception) -> str:
    """Returns RE2's error message, which is in bytes."""
    said = error.args[0] if error.args else ""
    return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(error)
