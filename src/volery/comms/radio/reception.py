"""Reception of frames: signal to noise, bit errors, packet errors, air time.

Noise is thermal at 290 K in the receiver's bandwidth plus its noise figure; jammers add theirs.
Bits are those of coherent BPSK without coding, with a bit error rate of erfc(sqrt(Eb/N0)) / 2
(J. G. Proakis, Digital Communications, 4th ed., eq. 5.2-11), Eb/N0 = SNR x bandwidth / bit rate; a
frame is lost with any of its bits.
"""

from __future__ import annotations

import math

import numpy as np

from volery.core.arrays import Array
from volery.scenario.radio import Radio

_THERMAL_DBM_HZ = 10.0 * math.log10(1.380649e-23 * 290.0 * 1e3)
"""k T0 in mW/Hz: -174 dBm/Hz."""
_OVERHEAD_BYTES = 64
"""IEEE 802.11 header and check (28), LLC/SNAP (8), IPv4 (20), UDP (8)."""
_PREAMBLE_S = 20e-6
"""Preamble and SIGNAL field of IEEE 802.11a."""


def snr_db(radio: Radio, loss_db: float) -> float:
    """Returns the signal-to-noise ratio, dB, at a receiver behind a path loss of `loss_db`."""
    received_dbm = radio.power_dbm + 2.0 * radio.antenna_gain_dbi - loss_db
    return received_dbm - _noise_dbm(radio)


def noise_rise_db(radio: Radio, jammed_mw: Array) -> Array:
    """Returns by how much jammers whose power (S,) mW receivers take in raise their noise, dB."""
    rise: Array = 10.0 * np.log10(1.0 + jammed_mw / 10.0 ** (0.1 * _noise_dbm(radio)))
    return rise


def packet_error_rate(radio: Radio, snr: float, payload_bytes: int) -> float:
    """Returns the fraction of frames of `payload_bytes` lost at an SNR of `snr` dB."""
    energy = 10.0 ** (snr / 10.0) * radio.bandwidth_mhz / radio.bit_rate_mbit_s
    bit_error = 0.5 * math.erfc(math.sqrt(energy))
    bits = 8 * (payload_bytes + _OVERHEAD_BYTES)
    return -math.expm1(bits * math.log1p(-bit_error))


def air_time_ns(radio: Radio, payload_bytes: int) -> int:
    """Returns the time, ns, for which a frame occupies the channel."""
    bits = 8 * (payload_bytes + _OVERHEAD_BYTES)
    return round(1e9 * (_PREAMBLE_S + bits / (radio.bit_rate_mbit_s * 1e6)))


def _noise_dbm(radio: Radio) -> float:
    """Returns the noise of a receiver, dBm."""
    bandwidth_hz = radio.bandwidth_mhz * 1e6
    return _THERMAL_DBM_HZ + 10.0 * math.log10(bandwidth_hz) + radio.noise_figure_db
