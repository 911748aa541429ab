"""The radio model against formulas written out here, and its draws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from volery.comms.addresses import ALL
from volery.comms.protocol import StationFrame, StationFrameKind, StationFrameParser, encode_frame
from volery.comms.radio.channel import Jammer, RadioChannel
from volery.comms.radio.path_loss import (
    Paths,
    distance_loss_db,
    foliage_loss_db,
    loss_db,
    woodland,
)
from volery.comms.radio.reception import air_time_ns, packet_error_rate, snr_db
from volery.scenario.radio import Radio

S = 1_000_000_000


def frame_of(number: int, *, source: int = 0, to: int = ALL, size: int = 100) -> StationFrame:
    data = encode_frame(StationFrameKind.SENSING, source, to, 1, number, 0, bytes(size))
    return next(iter(StationFrameParser().feed(data)))


def link_of(
    radio: Radio, positions: dict[int, tuple[float, ...]], foliage_m: float = 0.0
) -> RadioChannel:
    def looks(starts: np.ndarray, _ends: np.ndarray) -> Paths:
        return Paths.clear(len(starts))._replace(foliage_m=np.full(len(starts), foliage_m))

    return RadioChannel(radio, 1, lambda: {a: np.array(p) for a, p in positions.items()}, looks)


def test_free_space_is_that_of_friis() -> None:
    radio = Radio(frequency_mhz=2400.0)
    # the engineers' form of the same law: 32.45 + 20 lg(f MHz) + 20 lg(d km)
    expected = 32.45 + 20.0 * math.log10(2400.0) + 20.0 * math.log10(0.1)
    assert distance_loss_db(radio, np.array([100.0]))[0] == pytest.approx(expected, abs=0.01)
    steep = Radio(exponent=3.0)
    loss = distance_loss_db(steep, np.array([10.0, 100.0]))
    assert loss[1] - loss[0] == pytest.approx(30.0)


def test_foliage_by_weissberger_and_by_the_itu() -> None:
    weissberger = Radio(frequency_mhz=1000.0, vegetation="weissberger")
    found = foliage_loss_db(weissberger, np.array([0.0, 10.0, 100.0, 1000.0]))
    expected = [0.0, 4.5, 1.33 * 100.0**0.588, 1.33 * 400.0**0.588]
    np.testing.assert_allclose(found, expected)
    assert woodland(949.0) == pytest.approx((0.17, 26.5))
    per_m, max_db = woodland(2400.0)
    assert 0.34 < per_m < 0.40
    assert 34.1 < max_db < 37.0
    p833 = foliage_loss_db(Radio(frequency_mhz=949.0), np.array([1e-3, 20.0, 1e4]))
    assert p833[0] == pytest.approx(0.17e-3, rel=1e-4)
    assert p833[1] == pytest.approx(26.5 * (1.0 - math.exp(-20.0 * 0.17 / 26.5)))
    assert p833[2] == pytest.approx(26.5)
    assert not foliage_loss_db(Radio(vegetation="none"), np.array([50.0])).any()


def test_walls_trunks_and_ground_add_up() -> None:
    radio = Radio()
    paths = Paths(np.zeros(2), np.array([0, 2]), np.array([0, 1]), np.array([False, True]))
    clear, blocked = loss_db(radio, np.array([50.0, 50.0]), paths)
    extra = 2 * radio.trunk_loss_db + radio.wall_loss_db + radio.ground_loss_db
    assert blocked - clear == pytest.approx(extra)


def test_packets_are_lost_as_their_bits_are() -> None:
    radio = Radio(bandwidth_mhz=6.0, bit_rate_mbit_s=6.0)  # SNR is Eb/N0
    # BPSK at 9.6 dB: one bit in 100,000
    bits = 8 * (100 + 64)
    assert packet_error_rate(radio, 9.588, 100) == pytest.approx(bits * 1e-5, rel=0.02)
    assert packet_error_rate(radio, 30.0, 100) == 0.0
    assert packet_error_rate(radio, -10.0, 100) == pytest.approx(1.0)
    # -174 dBm/Hz + 67.8 dBHz + 6 dB
    assert snr_db(Radio(bandwidth_mhz=6.0), 24.0 + 100.2) == pytest.approx(0.0, abs=0.1)
    assert air_time_ns(radio, 100) == 20_000 + round(bits / 6e6 * 1e9)


def test_a_message_takes_its_time_on_the_air_and_waits_for_the_channel() -> None:
    radio = Radio(shadowing_db=0.0, latency_s=0.001)
    link = link_of(radio, {0: (0.0, 0.0, 5.0), 1: (20.0, 0.0, 5.0), 2: (0.0, 20.0, 5.0)})
    first, second = frame_of(1), frame_of(1, source=2)
    air = air_time_ns(radio, len(first.data))
    assert link(S, 0, 1, first) == (False, air + 1_000_000)
    assert link(S, 0, 2, first) == (False, air + 1_000_000)  # received by all at once
    assert link(S, 2, 0, second) == (False, 2 * air + 1_000_000)
    assert link.counts == {"sent": 2, "received": 3}


def test_a_crowded_channel_drops_what_would_wait_too_long() -> None:
    radio = Radio(bit_rate_mbit_s=0.1, queue_s=0.2)
    link = link_of(radio, {0: (0.0, 0.0, 5.0), 1: (20.0, 0.0, 5.0)})
    fates = [link(0, 0, 1, frame_of(k, size=1000)) for k in range(1, 9)]
    assert [fate.lost for fate in fates] == [False] * 3 + [True] * 5
    assert link.counts["crowded_out"] == 5


def test_frames_for_one_station_are_tried_again() -> None:
    """At the edge of the range one try in two fails; four tries in a row one time in sixteen."""
    radio = Radio(shadowing_db=0.0, retries=3)
    size = len(frame_of(1).data)
    snrs = np.linspace(-10.0, 10.0, 4001)
    edge = float(snrs[np.argmin([abs(packet_error_rate(radio, s, size) - 0.5) for s in snrs])])
    loss = snr_db(radio, 0.0) - edge
    distance = 10.0 ** ((loss - distance_loss_db(radio, np.array([1.0]))[0]) / 20.0)
    many, one = (
        link_of(radio, {0: (0.0, 0.0, 0.0), 1: (float(distance), 0.0, 0.0)}) for _ in range(2)
    )
    to_many = np.mean([many(k * S, 0, 1, frame_of(k)).lost for k in range(1, 1001)])
    to_one = np.mean([one(k * S, 0, 1, frame_of(k, to=1)).lost for k in range(1, 1001)])
    assert to_many == pytest.approx(0.5, abs=0.05)
    assert to_one == pytest.approx(1.0 / 16.0, abs=0.03)


def test_draws_do_not_depend_on_other_senders() -> None:
    radio = Radio(power_dbm=-22.0, queue_s=10.0)
    positions = {0: (0.0, 0.0, 5.0), 1: (60.0, 0.0, 5.0), 2: (0.0, 60.0, 5.0)}
    alone, busy = link_of(radio, positions), link_of(radio, positions)
    lost_alone = [alone(k * S, 0, 1, frame_of(k)).lost for k in range(1, 200)]
    lost_busy = []
    for k in range(1, 200):
        busy(k * S, 2, 1, frame_of(k, source=2))
        lost_busy.append(busy(k * S, 0, 1, frame_of(k)).lost)
    assert lost_alone == lost_busy
    assert 0 < sum(lost_alone) < len(lost_alone)


def test_foliage_shortens_the_range() -> None:
    positions = {0: (0.0, 0.0, 5.0), 1: (150.0, 0.0, 5.0)}
    clear, wood = link_of(Radio(), positions), link_of(Radio(), positions, foliage_m=60.0)
    loss = foliage_loss_db(Radio(), np.array([60.0]))[0]
    assert clear.snr_db(0, 0, 1) - wood.snr_db(0, 0, 1) == pytest.approx(loss)
    assert loss > 10.0
    assert clear.snr_db(0, 0, 7) == -math.inf


def test_a_jammer_adds_its_power_to_the_noise_of_each_receiver() -> None:
    """Two stations 60 m apart, a jammer 10 m from the second: it loses frames, the first none."""
    radio = Radio(shadowing_db=0.0)
    positions = {0: (0.0, 0.0, 5.0), 1: (60.0, 0.0, 5.0)}
    link = link_of(radio, positions)
    clear = link.snr_db(0, 0, 1)
    jammer = Jammer((70.0, 0.0, 5.0), 30.0)
    link.jam(jammer)

    def dbm(power: float, gains: float, distance: float) -> float:
        return power + gains - float(distance_loss_db(radio, np.array([distance]))[0])

    # far above the noise of the receiver, only the jammer's power counts: 20 dBm against 30
    expected = dbm(20.0, 4.0, 60.0) - dbm(30.0, 2.0, 10.0)
    assert link.snr_db(0, 0, 1) == pytest.approx(expected, abs=0.01)
    at_first = dbm(20.0, 4.0, 60.0) - dbm(30.0, 2.0, 70.0)
    assert link.snr_db(0, 1, 0) == pytest.approx(at_first, abs=0.01)
    assert link(0, 0, 1, frame_of(1)).lost
    link.jam(jammer)  # twice the power: 3 dB
    assert link.snr_db(0, 0, 1) == pytest.approx(expected - 3.01, abs=0.01)
    kept = link.get_state()
    link.end_jamming(jammer)
    link.end_jamming(jammer)
    link.end_jamming(jammer)  # no such one
    assert link.snr_db(0, 0, 1) == clear
    assert not link(0, 0, 1, frame_of(2)).lost
    link.set_state(kept)
    assert link.snr_db(0, 0, 1) == pytest.approx(expected - 3.01, abs=0.01)


def test_a_weak_or_distant_jammer_changes_little_and_foliage_shields_from_it() -> None:
    radio = Radio(shadowing_db=0.0)
    positions = {0: (0.0, 0.0, 5.0), 1: (60.0, 0.0, 5.0)}
    far, near, wood = (
        link_of(radio, positions),
        link_of(radio, positions),
        link_of(radio, positions, 60.0),
    )
    clear, clear_wood = near.snr_db(0, 0, 1), wood.snr_db(0, 0, 1)
    far.jam(Jammer((100_000.0, 0.0, 5.0), 0.0))
    assert clear - far.snr_db(0, 0, 1) == pytest.approx(0.0, abs=0.01)
    for link in (near, wood):
        link.jam(Jammer((80.0, 0.0, 5.0), 30.0))
    loss = foliage_loss_db(radio, np.array([60.0]))[0]
    lost, lost_in_wood = clear - near.snr_db(0, 0, 1), clear_wood - wood.snr_db(0, 0, 1)
    assert lost - lost_in_wood == pytest.approx(loss, abs=0.05)


def test_a_kept_state_is_not_touched_by_what_follows() -> None:
    positions = {0: (0.0, 0.0, 5.0), 1: (40.0, 0.0, 5.0)}
    link = link_of(Radio(bit_rate_mbit_s=0.1), positions)
    link(0, 0, 1, frame_of(1, size=1000))
    kept = link.get_state()
    after = [link(0, 0, 1, frame_of(k, size=1000)) for k in (2, 3, 4)]
    link.set_state(kept)
    assert [link(0, 0, 1, frame_of(k, size=1000)) for k in (2, 3, 4)] == after
    link.set_state(kept)
    assert link.counts == {"sent": 1, "received": 1}
