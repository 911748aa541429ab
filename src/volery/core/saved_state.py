"""Keeping the state of plain objects for a snapshot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, runtime_checkable


def save_attributes(owner: object, names: Iterable[str]) -> dict[str, Any]:
    """The attributes `names` of `owner`, as they are: who keeps them copies them."""
    return {name: getattr(owner, name) for name in names}


def restore_attributes(owner: object, state: dict[str, Any]) -> None:
    """Set the attributes of `owner` to what `save_attributes` kept."""
    for name, value in state.items():
        setattr(owner, name, value)


@runtime_checkable
class Stateful(Protocol):
    """Whatever can be kept in a snapshot."""

    def get_state(self) -> Any:
        """Everything that changes, as plain data."""

    def set_state(self, state: Any) -> None:
        """Go back to a kept state."""
