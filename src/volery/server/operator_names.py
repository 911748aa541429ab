"""Unique names of the operators on the page's server."""

from __future__ import annotations

from volery.core.errors import BridgeError
from volery.runtime.vehicles.control_authority import MAX_CHARACTERS, operator_key, operator_name


class OperatorNames:
    """Holds the names in use; call its methods in the server's thread.

    Case and spaces do not count, see `operator_name`: `Anna`, `anna` and `Anna ` are one name.
    """

    def __init__(self) -> None:
        self._names: set[str] = set()

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and operator_key(name) in self._names

    def sign_in(self, wanted: str = "") -> str:
        """Reserves and returns a name: the wanted one if it is free, else one with a number."""
        base = operator_name(wanted[: 4 * MAX_CHARACTERS])[: MAX_CHARACTERS - 5].strip()
        number, name = 1, base or "operator 1"
        while name in self:
            number += 1
            name = f"{base or 'operator'} {number}"
        self._names.add(operator_key(name))
        return name

    def rename(self, old: str, new: str) -> None:
        """Renames an operator. Raises BridgeError if another operator has the new name."""
        if new in self and operator_key(new) != operator_key(old):
            raise BridgeError(f"another operator is called {new}")
        self._names.discard(operator_key(old))
        self._names.add(operator_key(new))

    def sign_out(self, name: str) -> None:
        """Releases a name."""
        self._names.discard(operator_key(name))
