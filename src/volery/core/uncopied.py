"""Objects of a running simulation, of which there is one."""

from __future__ import annotations

from typing import Any, NoReturn, SupportsIndex

from volery.core.errors import CommandError


class Uncopied:
    """Refuses copies and pickles: a copy would share threads and memory with the original."""

    __slots__ = ()

    def __reduce_ex__(self, _protocol: SupportsIndex) -> NoReturn:
        """Raises `CommandError`."""
        name = type(self).__name__
        raise CommandError(
            f"a {name} is neither copied nor pickled, as part of a simulation; make another "
            "simulation of its scenario, or pickle the arrays of state() and fly()"
        )

    def __reduce__(self) -> Any:
        """Raises `CommandError`."""
        return self.__reduce_ex__(2)
