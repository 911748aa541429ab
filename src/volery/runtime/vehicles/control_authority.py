"""Manages which operator controls which UAV, where several operators share a simulation.

Control authority is an agreement between operators, not simulated: resets and snapshots leave it
unchanged. Nodes, and programs of bridges, command UAVs without it; it binds clients of the page's
server (`volery.server.access_policy`).
"""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection

from volery.core.errors import CommandError

MAX_CHARACTERS = 40
"""Max length of an operator's name."""


def operator_name(text: str) -> str:
    """Returns an operator's name in its normal form.

    The form is Unicode NFKC without control and format characters, without space at its ends,
    with single spaces inside. Names that differ in case alone are equal (`same_operator`).
    """
    plain = unicodedata.normalize("NFKC", text)
    characters = (
        " " if c.isspace() else c for c in plain if c.isspace() or unicodedata.category(c)[0] != "C"
    )
    return " ".join("".join(characters).split())


def same_operator(one: str, other: str) -> bool:
    """Returns whether two names denote one operator."""
    return operator_key(one) == operator_key(other)


def operator_key(name: str) -> str:
    """Returns a key that is equal for all spellings of an operator's name."""
    return unicodedata.normalize("NFKC", operator_name(name).casefold())


class ControlAuthority:
    """Holds the control authority of one simulation; `names` returns its UAVs.

    `moved_by` returns the UAVs that a topic, service or action moves, by its absolute name, beside
    those that the name contains: the server of the requests declares them (`graph.moved_uavs`).
    Any thread may query it; only the simulation's thread changes it.
    """

    def __init__(
        self,
        names: Callable[[], Collection[str]],
        moved_by: Callable[[str], Collection[str]] = lambda _name: (),
    ) -> None:
        self._names = names
        self.moved_by = moved_by
        self._operators: dict[str, str] = {}

    def operator_of(self, uav: str) -> str:
        """Returns the name of the operator in control of a UAV; empty: none."""
        return self._operators.get(uav, "")

    def held_by(self, operator: str) -> tuple[str, ...]:
        """Returns the UAVs that an operator controls."""
        return tuple(uav for uav, by in self._operators.items() if same_operator(by, operator))

    def take(self, uav: str, operator: str) -> None:
        """Gives control of a UAV to an operator. Raises `CommandError` if another one has it."""
        name = _checked_name(operator)
        self._check_free(uav, name)
        self._operators[uav] = name

    def release(self, uav: str, operator: str) -> None:
        """Releases a UAV, or all if none is named. Raises `CommandError` if another one has it."""
        if not uav:
            self.leave(operator)
            return
        self._check_held(uav, operator)
        del self._operators[uav]

    def hand_over(self, uav: str, operator: str, to: str) -> None:
        """Hands a UAV over to another operator. Raises `CommandError` if `operator` lacks it."""
        name = _checked_name(to)
        self._check_held(uav, operator)
        self._operators[uav] = name

    def leave(self, operator: str) -> None:
        """Releases all UAVs of an operator who has left."""
        for uav in self.held_by(operator):
            del self._operators[uav]

    def _check_free(self, uav: str, operator: str) -> None:
        names = self._names()
        if uav not in names:
            raise CommandError(f"there is no UAV '{uav}'; known: {', '.join(names)}")
        present = self.operator_of(uav)
        if present and not same_operator(present, operator):
            raise CommandError(f"{uav} is held by {present}, who can hand it over")

    def _check_held(self, uav: str, operator: str) -> None:
        self._check_free(uav, operator)
        if uav not in self._operators:
            raise CommandError(
                f"{operator or 'an operator without a name'} does not hold {uav}; take it first"
            )


def _checked_name(operator: str) -> str:
    name = operator_name(operator)
    if not name or len(name) > MAX_CHARACTERS or len(operator) > 4 * MAX_CHARACTERS:
        raise CommandError(
            f"an operator needs a name of 1 to {MAX_CHARACTERS} printable characters, "
            f"not {operator[:60]!r}"
        )
    return name
