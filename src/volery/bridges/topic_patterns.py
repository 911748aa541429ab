"""Choosing topics by patterns, as for file names.

`*` stands for any characters within one part of a name, `?` for one of them, `**` for any number of
parts: `/uav*/laser/**` matches `/uav1/laser/horizontal/scan`, `/**` matches all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from volery.core.errors import GraphError
from volery.core.patterns import MAX_PATTERN_CHARACTERS

_ALLOWED = re.compile(r"/(?:[\w*?]+(?:/[\w*?]+)*)?")
_TOKENS = re.compile(r"/\*\*(?=/|$)|\*\*|\*|\?|[^*?/]+|/")

Pattern = list[str]
"""Tokens: wildcards, and what stands between them."""


def topic_filter(topics: Iterable[str], exclude: Iterable[str] = ()) -> Callable[[str], bool]:
    """Whether a topic matches one of `topics` and none of `exclude`.

    The answer for each topic is worked out once. `GraphError` for what is no pattern.
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
    """New names of topics: `{"/scan": "/uav1/scan"}`, or whole branches `{"/uav1/**": "/uav2/**"}`.

    The longest branch counts. `GraphError` for a branch that is renamed to none.
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
                f"'{pattern}' is no pattern for topics: it begins with / and is made of letters, "
                "digits, _ and the wildcards * ? **"
            )
        compiled.append(_TOKENS.findall(pattern))
    return compiled


def _match(pattern: Pattern, name: str) -> bool:
    """Whether a pattern matches; no pattern takes longer than its length times that of the name."""
    ends = {0}
    for token in pattern:
        ends = _ends_of(token, name, ends)
        if not ends:
            return False
    return len(name) in ends


def _ends_of(token: str, name: str, starts: set[int]) -> set[int]:
    """Where a token may end in `name` that begins at one of `starts`."""
    if token == "**":
        return set(range(min(starts), len(name) + 1))
    if token == "/**":  # also nothing at all: /a/**/b matches /a/b
        first = min((start for start in starts if name.startswith("/", start)), default=len(name))
        return starts | set(range(first + 1, len(name) + 1))
    if token == "?":
        return {start + 1 for start in starts if name[start : start + 1] not in ("", "/")}
    if token == "*":
        ends, inside = set(), False
        for place in range(len(name) + 1):
            inside = place in starts or (inside and name[place - 1] != "/")
            if inside:
                ends.add(place)
        return ends
    return {start + len(token) for start in starts if name.startswith(token, start)}
