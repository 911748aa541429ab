"""Who steers which UAV, where several operators are there at once.

This is an agreement between people, not part of what is simulated: a reset or a snapshot leaves it
as it is. Programs of bridges, and nodes of the scenario, command UAVs without asking here; clients
of the page's server are held to it (`volery.server.access_policy`).
"""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection

from volery.core.errors import CommandError

MOST_CHARACTERS = 40
"""Of an operator's name."""


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
    """The operators of one simulation; `names` gives its UAVs.

    Any thread may ask; changes are made in the simulation's thread.
    """

    def __init__(self, names: Callable[[], Collection[str]]) -> None:
        self._names = names
        self._holders: dict[str, str] = {}

    def holder_of(self, uav: str) -> str:
        """Name of the operator who holds a UAV; empty: nobody does."""
        return self._holders.get(uav, "")

    def held_by(self, operator: str) -> tuple[str, ...]:
        """UAVs that an operator holds."""
        return tuple(uav for uav, by in self._holders.items() if same_operator(by, operator))

    def take(self, uav: str, operator: str) -> None:
        """Let an operator hold a UAV that nobody else holds; `CommandError` otherwise."""
        name = _checked_name(operator)
        self._check_free(uav, name)
        self._holders[uav] = name

    def release(self, uav: str, operator: str) -> None:
        """Let go of a UAV, or, where none is named, of all; `CommandError` if it is another's."""
        if not uav:
            self.leave(operator)
            return
        self._check_held(uav, operator)
        del self._holders[uav]

    def hand_over(self, uav: str, operator: str, to: str) -> None:
        """Give a UAV that an operator holds to another operator; `CommandError` if he does not."""
        name = _checked_name(to)
        self._check_held(uav, operator)
        self._holders[uav] = name

    def leave(self, operator: str) -> None:
        """Let go of everything: the operator has gone."""
        for uav in self.held_by(operator):
            del self._holders[uav]

    def _check_free(self, uav: str, operator: str) -> None:
        names = self._names()
        if uav not in names:
            raise CommandError(f"there is no UAV '{uav}'; known: {', '.join(names)}")
        holder = self.holder_of(uav)
        if holder and not same_operator(holder, operator):
            raise CommandError(f"{uav} is held by {holder}, who can hand it over")

    def _check_held(self, uav: str, operator: str) -> None:
        self._check_free(uav, operator)
        if uav not in self._holders:
            raise CommandError(f"{operator or 'who has no name'} does not hold {uav}; nobody does")


def _checked_name(operator: str) -> str:
    name = operator_name(operator)
    if not name or len(name) > MOST_CHARACTERS or len(operator) > 4 * MOST_CHARACTERS:
        raise CommandError(
            f"an operator needs a name of 1 to {MOST_CHARACTERS} printable characters, "
            f"not {operator[:60]!r}"
        )
    return name
