"""A contest made ready: what ours does in a round, what the peer is asked, how it is checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Task:
    """One contest, from our side.

    ours: does one round. amount, peer_amount: rays or drone-steps in a round of ours and of the
    peer's. request: plain data for the peer's script. check: after the rounds, judges ours and the
    peer's facts (None without a peer); returns further figures, raises PeerError where the peer
    computes something else. close: lets go of what the contest holds. simulated_per_s: drone-steps
    in a second of simulated time; None where no time passes.
    """

    ours: Callable[[], object]
    amount: int
    peer_amount: int
    request: Mapping[str, Any]
    check: Callable[[Mapping[str, Any] | None], dict[str, float]]
    close: Callable[[], None]
    simulated_per_s: int | None = None
