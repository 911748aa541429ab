"""Saves object state for snapshots."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, runtime_checkable


def save_attributes(owner: object, names: Iterable[str]) -> dict[str, Any]:
    """Returns the attributes `names` of `owner`, not copied: the caller copies them."""
    return {name: getattr(owner, name) for name in names}


def restore_attributes(owner: object, state: dict[str, Any]) -> None:
    """Sets the attributes of `owner` to what `save_attributes` returned."""
    for name, value in state.items():
        setattr(owner, name, value)


@runtime_checkable
class Stateful(Protocol):
    """An object whose state a snapshot can save."""

    def get_state(self) -> Any:
        """Returns everything that changes, as plain data."""

    def set_state(self, state: Any) -> None:
        """Restores a saved state."""
