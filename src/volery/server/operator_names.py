"""Names of the operators who are connected to the page's server, no two the same."""

from __future__ import annotations

from volery.core.errors import BridgeError
from volery.runtime.vehicles.control_authority import MOST_CHARACTERS, operator_key, operator_name


class OperatorNames:
    """Names that are in use, however they are spelled; its methods belong to the server's thread.

    See `operator_name`: `Anna`, `anna` and `Anna ` are one name.
    """

    def __init__(self) -> None:
        self._names: set[str] = set()

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and operator_key(name) in self._names

    def sign_in(self, wanted: str = "") -> str:
        """A name of one's own: the wanted one if it is free, else one with a number."""
        base = operator_name(wanted[: 4 * MOST_CHARACTERS])[: MOST_CHARACTERS - 5].strip()
        number, name = 1, base or "operator 1"
        while name in self:
            number += 1
            name = f"{base or 'operator'} {number}"
        self._names.add(operator_key(name))
        return name

    def rename(self, old: str, new: str) -> None:
        """Call oneself otherwise. `BridgeError` where another operator is called like that."""
        if new in self and operator_key(new) != operator_key(old):
            raise BridgeError(f"another operator is called {new}")
        self._names.discard(operator_key(old))
        self._names.add(operator_key(new))

    def sign_out(self, name: str) -> None:
        """Give a name back."""
        self._names.discard(operator_key(name))
