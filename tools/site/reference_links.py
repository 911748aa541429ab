"""Links from one page of the reference to another."""

from __future__ import annotations

from pathlib import Path

import volery

DEFINITIONS = Path(volery.__file__).parent / "graph" / "definitions"


def anchor(name: str) -> str:
    """Returns the anchor of a type in the reference of messages."""
    package, _, kind = name.split("/")
    return f"{package}-{kind}".lower()


def message_link(name: str) -> str:
    """Returns a type as a link to its definition, or as code if it is one of ROS's own."""
    package, form, kind = name.split("/")
    if (DEFINITIONS / package / form / f"{kind}.{form}").is_file():
        return f"[`{package}/{kind}`](messages.md#{anchor(name)})"
    return f"`{package}/{kind}`"
