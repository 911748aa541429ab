"""Defines a prepared contest: Volery's round, the peer's request and the check."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Task:
    """Describes one contest from Volery's side.

    `ours` runs one round. `amount` and `peer_amount` are rays or drone-steps in a round of Volery
    and of the peer. `request` is plain data for the peer's script. `check` judges Volery and the
    peer's facts (None without a peer) after the rounds; it returns further figures and raises
    `PeerError` if the peer's results differ. `close` releases resources. `simulated_per_s` is the
    number of drone-steps per simulated second; None if no time passes.
    """

    ours: Callable[[], object]
    amount: int
    peer_amount: int
    request: Mapping[str, Any]
    check: Callable[[Mapping[str, Any] | None], dict[str, float]]
    close: Callable[[], None]
    simulated_per_s: int | None = None
