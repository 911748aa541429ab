"""The radio model, a `comms.link_model.Link`: one shared channel between stations."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from volery.comms.addresses import is_station
from volery.comms.link_model import Delivery
from volery.comms.protocol import StationFrame
from volery.comms.radio.path_loss import Paths, loss_db
from volery.comms.radio.reception import air_time_ns, noise_rise_db, packet_error_rate, snr_db
from volery.core import rng
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.scenario.radio import Radio

Positions = Callable[[], Mapping[int, Array]]
"""Returns the stations' positions: address to (3,) m, map."""
Looks = Callable[[Array, Array], Paths]
"""Returns the obstacles between positions (P, 3) and (P, 3), m, map."""

_LOST = Delivery(lost=True)
_MAX_TRIES = 8


class _Sent(NamedTuple):
    """End of the last transmission of a station."""

    session: int
    sequence: int
    ends_ns: int


class Jammer(NamedTuple):
    """A transmitter of noise in the whole channel."""

    position_map: tuple[float, float, float]
    """m."""
    power_dbm: float


class RadioChannel(SavedAttributes):
    """Decides loss and delay of frames; call it in the order of time.

    seed: of the run. Each pair has random streams of its own, indexed by the frame's number, so
    that results do not depend on the other stations' traffic.
    """

    STATE = (
        *("_free_ns", "_sent", "_losses", "_looked_ns", "counts", "_seed"),
        *("_jammers", "_noise_rises"),
    )

    def __init__(self, radio: Radio, seed: int, positions: Positions, looks: Looks) -> None:
        self._radio = radio
        self._seed = seed
        self._positions = positions
        self._looks = looks
        self._free_ns = 0
        """Time at which the channel is free again, ns."""
        self._sent: dict[int, _Sent] = {}
        self._losses: dict[tuple[int, int], float] = {}
        self._looked_ns = -1
        self._jammers: list[Jammer] = []
        self._noise_rises: dict[int, float] = {}
        """By how much jammers raise the noise of each station, dB; empty without jammers."""
        self.counts: Counter[str] = Counter()
        """Frames `sent`, `received` and `faded` (once for each receiver), `crowded_out` by the
        queue limit.
        """

    def __call__(
        self, time_ns: int, source: int, destination: int, frame: StationFrame
    ) -> Delivery:
        """Returns loss and delay of a frame to one station."""
        before = self._sent.get(source)
        again = before is not None and before[:2] == (frame.session, frame.sequence)
        if not again and self._free_ns - time_ns > self._radio.queue_s * NS_PER_S:
            self.counts["crowded_out"] += 1
            return _LOST
        snr = self.snr_db(time_ns, source, destination)
        tries, received = self._try(source, destination, frame, snr)
        if again and before is not None:  # one transmission serves all receivers
            ends_ns = before.ends_ns
        else:
            self.counts["sent"] += 1
            took_ns = tries * air_time_ns(self._radio, len(frame.data))
            ends_ns = self._free_ns = max(self._free_ns, time_ns) + took_ns
            self._sent[source] = _Sent(frame.session, frame.sequence, ends_ns)
        self.counts["received" if received else "faded"] += 1
        if not received:
            return _LOST
        return Delivery(False, ends_ns - time_ns + round(self._radio.latency_s * NS_PER_S))

    def jam(self, jammer: Jammer) -> None:
        """Adds a jammer; it disturbs reception from the next frame on."""
        self._jammers.append(jammer)
        self._looked_ns = -1

    def end_jamming(self, jammer: Jammer) -> None:
        """Removes a jammer, if there is one like it."""
        if jammer in self._jammers:
            self._jammers.remove(jammer)
            self._looked_ns = -1

    def snr_db(self, time_ns: int, source: int, destination: int) -> float:
        """Returns the signal-to-noise ratio at a destination, dB; -inf without a position.

        The noise is that of the receiver and of all jammers.
        """
        pair = min(source, destination), max(source, destination)
        stale_ns = round(self._radio.update_s * NS_PER_S)
        if self._looked_ns < 0 or time_ns - self._looked_ns >= stale_ns or pair not in self._losses:
            self._look(time_ns)
        if pair not in self._losses:
            return -np.inf
        block = time_ns // round(self._radio.shadowing_s * NS_PER_S)
        key = rng.stream_key(self._seed, f"radio/{pair[0]}-{pair[1]}/shadowing")
        fading = self._radio.shadowing_db * float(rng.normal(key, block))
        rise = self._noise_rises.get(destination, 0.0)
        return snr_db(self._radio, self._losses[pair]) - fading - rise

    def reseed(self, seed: int) -> None:
        """Draws from other random streams."""
        self._seed = seed

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return copy.deepcopy(super().get_state())

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        super().set_state(copy.deepcopy(state))

    def _try(
        self, source: int, destination: int, frame: StationFrame, snr: float
    ) -> tuple[int, bool]:
        """Returns the number of transmissions, and whether the last one is received."""
        tries = 1 + (self._radio.retries if is_station(frame.destination) else 0)
        if not np.isfinite(snr):
            return tries, False
        lost = packet_error_rate(self._radio, snr, len(frame.data))
        key = rng.stream_key(self._seed, f"radio/{source}-{destination}/frames")
        for k in range(tries):
            if float(rng.uniform(key, _MAX_TRIES * frame.sequence + k)) >= lost:
                return k + 1, True
        return tries, False

    def _look(self, time_ns: int) -> None:
        """Updates the path loss between all stations, and the noise of jammers at each."""
        positions = self._positions()
        pairs = list(combinations(sorted(positions), 2))
        self._looked_ns, self._losses, self._noise_rises = time_ns, {}, {}
        if not pairs:
            return
        if self._jammers:
            rises = self._rises(np.array(list(positions.values())))
            self._noise_rises = dict(zip(positions, rises.tolist(), strict=True))
        starts = np.array([positions[one] for one, _ in pairs])
        ends = np.array([positions[other] for _, other in pairs])
        distance = np.linalg.norm(ends - starts, axis=1)
        losses = loss_db(self._radio, distance, self._looks(starts, ends))
        self._losses = dict(zip(pairs, losses.tolist(), strict=True))

    def _rises(self, positions: Array) -> Array:
        """Returns by how much all jammers raise the noise at positions (S, 3) m, map: (S,) dB."""
        received_mw = np.zeros(len(positions))
        for jammer in self._jammers:
            starts = np.tile(jammer.position_map, (len(positions), 1))
            distance = np.linalg.norm(positions - starts, axis=1)
            lost_db = loss_db(self._radio, distance, self._looks(starts, positions))
            received_dbm = jammer.power_dbm + self._radio.antenna_gain_dbi - lost_db
            received_mw += 10.0 ** (0.1 * received_dbm)
        return noise_rise_db(self._radio, received_mw)
