"""Selects topics by patterns like those of file names.

`*` matches any characters within one part of a name, `?` one character, `**` any number of parts:
`/uav*/laser/**` matches `/uav1/laser/horizontal/scan`, `/**` matches all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from volery.core.errors import GraphError
from volery.core.patterns import MAX_PATTERN_CHARACTERS

_ALLOWED = re.compile(r"/(?:[\w*?]+(?:/[\w*?]+)*)?")
_TOKENS = re.compile(r"/\*\*(?=/|$)|\*\*|\*|\?|[^*?/]+|/")

Pattern = list[str]
"""Tokens: wildcards, and the text between them."""


def topic_filter(topics: Iterable[str], exclude: Iterable[str] = ()) -> Callable[[str], bool]:
    """Returns a function that tests whether a topic matches one of `topics` and none of `exclude`.

    The result for each topic is computed once. Raises `GraphError` for an invalid pattern.
    """
    wanted, unwanted = _compiled(topics), _compiled(exclude)
    answers: dict[str, bool] = {}

    def matches(topic: str) -> bool:
        answer = answers.get(topic)
        if answer is None:
            answer = any(_match(p, topic) for p in wanted) and not any(
                _match(p, topic) for p in unwanted
            )
            answers[topic] = answer
        return answer

    return matches


def renamer(names: Mapping[str, str]) -> Callable[[str], str]:
    """Returns a function that renames topics, `{"/scan": "/uav1/scan"}`, or whole branches.

    A branch is given as `{"/uav1/**": "/uav2/**"}`. The longest branch counts. Raises `GraphError`
    for a branch without a new branch.
    """
    exact: dict[str, str] = {}
    branches: dict[str, str] = {}
    for old, new in names.items():
        if old.endswith("/**") != new.endswith("/**") or "*" in (old + new).replace("/**", ""):
            raise GraphError(f"cannot rename '{old}' to '{new}': give two names or two '/name/**'")
        if old.endswith("/**"):
            branches[old[:-2]] = new[:-2]
        else:
            exact[old] = new

    def rename(topic: str) -> str:
        if topic in exact:
            return exact[topic]
        for old in sorted(branches, key=len, reverse=True):
            if topic.startswith(old):
                return branches[old] + topic[len(old) :]
        return topic

    return rename


def _compiled(patterns: Iterable[str]) -> list[Pattern]:
    if isinstance(patterns, str):
        patterns = (patterns,)
    compiled = []
    for pattern in patterns:
        if len(pattern) > MAX_PATTERN_CHARACTERS:
            raise GraphError(f"a pattern has at most {MAX_PATTERN_CHARACTERS} characters")
        if _ALLOWED.fullmatch(pattern) is None:
            raise GraphError(
                f"'{pattern}' is not a topic pattern: use a leading / and letters, "
                "digits, _ and the wildcards * ? **"
            )
        compiled.append(_TOKENS.findall(pattern))
    return compiled


def _match(pattern: Pattern, name: str) -> bool:
    """Returns whether a pattern matches; the cost is at most its length times that of the name."""
    ends = {0}
    for token in pattern:
        ends = _ends_of(token, name, ends)
        if not ends:
            return False
    return len(name) in ends


def _ends_of(token: str, name: str, starts: set[int]) -> set[int]:
    """Returns where a token that begins at one of `starts` may end in `name`."""
    if token == "**":
        return set(range(min(starts), len(name) + 1))
    if token == "/**":  # matches nothing too: /a/**/b matches /a/b
        first = min((start for start in starts if name.startswith("/", start)), default=len(name))
        return starts | set(range(first + 1, len(name) + 1))
    if token == "?":
        return {start + 1 for start in starts if name[start : start + 1] not in ("", "/")}
    if token == "*":
        ends, inside = set(), False
        for index in range(len(name) + 1):
            inside = index in starts or (inside and name[index - 1] != "/")
            if inside:
                ends.add(index)
        return ends
    return {start + len(token) for start in starts if name.startswith(token, start)}
