"""Maps the species of an inventory to shipped species.

Inventories of real forests name species that are not shipped. A map assigns shipped species to some
of them; all others use the scenario's default species, and one warning counts them.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache

from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss
from volery.core.plurals import counted
from volery.world.trees import species_names

_log = logging.getLogger(__name__)

_MAX_SHOWN = 5
"""Maximum number of species in a warning."""
_MAX_LETTERS = 40
"""Maximum length of a species' name in a warning."""


def shipped_species(
    names: Sequence[str], fallback: str, species_map: Mapping[str, str], where: str
) -> list[str]:
    """Returns the shipped species of each tree; `fallback` for those of unknown or no species.

    names: of the trees' species in the inventory; letter case does not matter, and spaces equal
    underscores. species_map: inventory's name to shipped species. where: names the inventory in
    the warning about unknown species. Raises `ScenarioError` if the map names a species that is
    not shipped.
    """
    known = {name: name for name in species_names()}
    chosen = {**known, **_checked(species_map)}
    keys = [_key(name) for name in names]
    unknown = Counter(
        name.strip() for name, key in zip(names, keys, strict=True) if key and key not in chosen
    )
    if unknown:
        _warn(f"{where}: {_listed(unknown)} become {fallback}; map them in {_TABLE}")
    present = set(keys)
    unused = sorted(name for name in species_map if _key(name) not in present)
    if unused:
        _warn(f"{where}: no tree is of the species {_shown(unused)} in {_TABLE}")
    return [chosen.get(key, fallback) for key in keys]


_TABLE = "[world.forest.species_map]"


def _checked(species_map: Mapping[str, str]) -> dict[str, str]:
    """Returns the map by comparable keys; raises `ScenarioError` for unknown target species."""
    allowed = species_names()
    for name, target in species_map.items():
        if target not in allowed:
            hint = near_miss(target, allowed)
            raise ScenarioError(
                f"species_map.{_plain(name)!r}: unknown tree species '{_plain(target)}'{hint} "
                f"Allowed: {', '.join(allowed)}"
            )
    return {_key(name): target for name, target in species_map.items()}


def _key(name: str) -> str:
    return "_".join(name.casefold().split())


def _listed(unknown: Counter[str]) -> str:
    names = [f"{_plain(name)} {count}" for name, count in unknown.most_common(_MAX_SHOWN)]
    rest = ", ..." if len(unknown) > _MAX_SHOWN else ""
    trees = counted(sum(unknown.values()), "tree")
    kinds = counted(len(unknown), "species", "species")
    return f"{trees} of {kinds} that are not known ({', '.join(names)}{rest})"


def _shown(names: Sequence[str]) -> str:
    rest = ", ..." if len(names) > _MAX_SHOWN else ""
    return ", ".join(_plain(name) for name in names[:_MAX_SHOWN]) + rest


def _plain(name: str) -> str:
    """Returns a name for terminals: short, and without control characters."""
    short = name if len(name) <= _MAX_LETTERS else f"{name[:_MAX_LETTERS]}..."
    return "".join(letter if letter.isprintable() else "?" for letter in short)


@lru_cache(maxsize=100)
def _warn(text: str) -> None:
    """Logs a warning once, however often the same forest is built."""
    _log.warning("%s", text)
