"""Saves object state for snapshots."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, runtime_checkable


@runtime_checkable
class Stateful(Protocol):
    """An object whose state a snapshot can save."""

    def get_state(self) -> Any:
        """Returns everything that changes, as plain data."""

    def set_state(self, state: Any) -> None:
        """Restores a saved state."""


class SavedAttributes:
    """Saves the attributes that a subclass names; a `Stateful`."""

    STATE: ClassVar[tuple[str, ...]] = ()
    """Names of attributes that change. They are not copied: the caller copies them."""
    PARTS: ClassVar[tuple[str, ...]] = ()
    """Names of attributes that are `Stateful` and keep their identity."""

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        state = {name: getattr(self, name) for name in self.STATE}
        return state | {name: getattr(self, name).get_state() for name in self.PARTS}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores what `get_state` returned."""
        for name in self.PARTS:
            getattr(self, name).set_state(state[name])
        for name in self.STATE:
            setattr(self, name, state[name])
