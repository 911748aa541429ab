"""Order, sections and titles of the scenario cards, from `cards/gallery.toml`."""

from __future__ import annotations

import tomllib
from functools import cache
from typing import NamedTuple

from volery.server.cards import CARDS

OWN = "Yours"
"""Section of scenarios that are not shipped."""


class GalleryEntry(NamedTuple):
    """Rank of a shipped scenario among the cards."""

    section: str
    title: str
    """Name in words."""


@cache
def gallery() -> dict[str, GalleryEntry]:
    """Returns the shipped scenarios in the order of their cards, by name."""
    sections = tomllib.loads((CARDS / "gallery.toml").read_text(encoding="utf-8"))
    return {
        name: GalleryEntry(section, title)
        for section, titles in sections.items()
        for name, title in titles.items()
    }


def title_of(name: str) -> str:
    """Returns a scenario's name in words; one that is not shipped keeps its own name."""
    entry = gallery().get(name)
    return name if entry is None else entry.title
