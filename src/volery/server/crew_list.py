"""Names of the pilots who are connected to the page's server, no two the same."""

from __future__ import annotations

from volery.core.errors import BridgeError
from volery.runtime.pilots import MOST_CHARACTERS


class CrewList:
    """Names that are in use; its methods belong to the server's thread."""

    def __init__(self) -> None:
        self._names: set[str] = set()

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def sign_in(self, wanted: str = "") -> str:
        """A name of one's own: the wanted one if it is free, else one with a number."""
        base = "".join(c for c in wanted if c.isprintable()).strip()[: MOST_CHARACTERS - 5]
        number, name = 1, base or "pilot 1"
        while name in self._names:
            number += 1
            name = f"{base or 'pilot'} {number}"
        self._names.add(name)
        return name

    def rename(self, old: str, new: str) -> None:
        """Call oneself otherwise. `BridgeError` where somebody else is called like that."""
        if new in self._names:
            raise BridgeError(f"another pilot is called {new}")
        self._names.discard(old)
        self._names.add(new)

    def sign_out(self, name: str) -> None:
        """Give a name back."""
        self._names.discard(name)
