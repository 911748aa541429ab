"""Text for terminals: what a client or a log gave as a name must not act on the terminal."""

from __future__ import annotations

import unicodedata

_ACTIVE = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of Unicode: control characters, invisible format characters (such as those that turn
the direction of writing), parts of surrogate pairs, ends of lines and paragraphs."""


def plain(text: str, keep: str = "") -> str:
    r"""Returns a text in which characters that act on a terminal are spelled out, such as `\x1b`.

    keep: characters that stay, such as the new lines of a text of several lines.
    """
    if text.isprintable():
        return text
    return "".join(letter if letter in keep else _spelled(letter) for letter in text)


def plain_message(text: str) -> str:
    """Returns a message as plain text; its further lines are indented.

    Other new lines are spelled out: a foreign name cannot begin a line like another message.
    """
    first, *others = text.split("\n")
    parts = [plain(first)]
    for line in others:
        parts.append(("\n" if line.startswith(" ") else _spelled("\n")) + plain(line))
    return "".join(parts)


def _spelled(letter: str) -> str:
    if unicodedata.category(letter) not in _ACTIVE:
        return letter
    return letter.encode("unicode_escape").decode("ascii")
