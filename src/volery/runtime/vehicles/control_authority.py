"""Who steers which UAV, where several pilots are there at once.

This is an agreement between people, not part of what is simulated: a reset or a snapshot leaves it
as it is. Programs of bridges, and nodes of the scenario, command UAVs without asking here; clients
of the page's server are held to it (`volery.server.access_policy`).
"""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection

from volery.core.errors import CommandError

MOST_CHARACTERS = 40
"""Of a pilot's name."""


def operator_name(text: str) -> str:
    """An operator's name in its normal form.

    Unicode NFKC, without control and format characters, without space at its ends, with single
    spaces inside. Names that differ in case alone are one operator (`same_operator`).
    """
    plain = unicodedata.normalize("NFKC", text)
    kept = (
        " " if c.isspace() else c for c in plain if c.isspace() or unicodedata.category(c)[0] != "C"
    )
    return " ".join("".join(kept).split())


def same_operator(one: str, other: str) -> bool:
    """Whether two names are those of one operator."""
    return operator_key(one) == operator_key(other)


def operator_key(name: str) -> str:
    """What is equal for all spellings of an operator's name."""
    return unicodedata.normalize("NFKC", operator_name(name).casefold())


class ControlAuthority:
    """The pilots of one simulation; `names` gives its UAVs.

    Any thread may ask; changes are made in the simulation's thread.
    """

    def __init__(self, names: Callable[[], Collection[str]]) -> None:
        self._names = names
        self._holders: dict[str, str] = {}

    def holder_of(self, uav: str) -> str:
        """Name of the pilot who holds a UAV; empty: nobody does."""
        return self._holders.get(uav, "")

    def held_by(self, pilot: str) -> tuple[str, ...]:
        """UAVs that a pilot holds."""
        return tuple(uav for uav, by in self._holders.items() if same_operator(by, pilot))

    def take(self, uav: str, pilot: str) -> None:
        """Let a pilot hold a UAV that nobody else holds; `CommandError` otherwise."""
        name = _checked_name(pilot)
        self._check_free(uav, name)
        self._holders[uav] = name

    def release(self, uav: str, pilot: str) -> None:
        """Let go of a UAV, or, where none is named, of all; `CommandError` if it is another's."""
        if not uav:
            self.leave(pilot)
            return
        self._check_held(uav, pilot)
        del self._holders[uav]

    def hand_over(self, uav: str, pilot: str, to: str) -> None:
        """Give a UAV that a pilot holds to another pilot; `CommandError` if he does not."""
        name = _checked_name(to)
        self._check_held(uav, pilot)
        self._holders[uav] = name

    def leave(self, pilot: str) -> None:
        """Let go of everything: the pilot has gone."""
        for uav in self.held_by(pilot):
            del self._holders[uav]

    def _check_free(self, uav: str, pilot: str) -> None:
        names = self._names()
        if uav not in names:
            raise CommandError(f"there is no UAV '{uav}'; known: {', '.join(names)}")
        holder = self.holder_of(uav)
        if holder and not same_operator(holder, pilot):
            raise CommandError(f"{uav} is held by {holder}, who can hand it over")

    def _check_held(self, uav: str, pilot: str) -> None:
        self._check_free(uav, pilot)
        if uav not in self._holders:
            raise CommandError(f"{pilot or 'who has no name'} does not hold {uav}; nobody does")


def _checked_name(pilot: str) -> str:
    name = operator_name(pilot)
    if not name or len(name) > MOST_CHARACTERS or len(pilot) > 4 * MOST_CHARACTERS:
        raise CommandError(
            f"a pilot needs a name of 1 to {MOST_CHARACTERS} printable characters, "
            f"not {pilot[:60]!r}"
        )
    return name
