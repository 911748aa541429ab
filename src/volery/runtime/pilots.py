"""Who steers which UAV, where several pilots are there at once.

This is an agreement between people, not part of what is simulated: a reset or a snapshot leaves it
as it is. Programs of doors, and nodes of the scenario, command UAVs without asking here; clients of
the page's server are held to it (`volery.server.gate`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from volery.core.errors import CommandError

MOST_CHARACTERS = 40
"""Of a pilot's name."""


class Pilots:
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
        return tuple(uav for uav, holder in self._holders.items() if holder == pilot)

    def take(self, uav: str, pilot: str) -> None:
        """Let a pilot hold a UAV that nobody else holds; `CommandError` otherwise."""
        _check_name(pilot)
        self._check_free(uav, pilot)
        self._holders[uav] = pilot

    def release(self, uav: str, pilot: str) -> None:
        """Let go of a UAV, or, where none is named, of all; `CommandError` if it is another's."""
        if not uav:
            self.leave(pilot)
            return
        self._check_held(uav, pilot)
        del self._holders[uav]

    def hand_over(self, uav: str, pilot: str, to: str) -> None:
        """Give a UAV that a pilot holds to another pilot; `CommandError` if he does not."""
        _check_name(to)
        self._check_held(uav, pilot)
        self._holders[uav] = to

    def leave(self, pilot: str) -> None:
        """Let go of everything: the pilot has gone."""
        for uav in self.held_by(pilot):
            del self._holders[uav]

    def _check_free(self, uav: str, pilot: str) -> None:
        names = self._names()
        if uav not in names:
            raise CommandError(f"there is no UAV '{uav}'; known: {', '.join(names)}")
        holder = self.holder_of(uav)
        if holder not in ("", pilot):
            raise CommandError(f"{uav} is held by {holder}, who can hand it over")

    def _check_held(self, uav: str, pilot: str) -> None:
        self._check_free(uav, pilot)
        if uav not in self._holders:
            raise CommandError(f"{pilot or 'who has no name'} does not hold {uav}; nobody does")


def _check_name(pilot: str) -> None:
    if not pilot.strip() or len(pilot) > MOST_CHARACTERS or not pilot.isprintable():
        raise CommandError(
            f"a pilot needs a name of 1 to {MOST_CHARACTERS} printable characters, "
            f"not {pilot[:60]!r}"
        )
