"""Broken sensors: dropped, stuck, biased, noisy, for any kind of samples."""

import numpy as np
import pytest

from volery.core.errors import CommandError
from volery.sensors.faults import FaultKind, FaultTable
from volery.sensors.samples import ImuSamples, RangeSamples, SensorId

SENSORS = tuple(SensorId(i, f"uav{i + 1}", "range") for i in range(3))
KEYS = np.arange(1, 4, dtype=np.uint64)


def ranges(k):
    """Reading k of three sonars: 10 k + row."""
    values = 10.0 * k + np.arange(3.0)
    values.flags.writeable = False
    return RangeSamples(SENSORS, k, values, 0.4, 0.2, 7.0, 1e-4)


def imus():
    zero = np.zeros((3, 3))
    return ImuSamples(SENSORS, 0, zero, zero + 9.0, 0.1, 0.2)


def table():
    return FaultTable(SENSORS, RangeSamples.MEASURED, KEYS)


def test_without_faults_samples_pass_untouched():
    samples = ranges(1)
    assert table().apply(samples, 1) is samples


def test_a_dropped_sensor_sends_nothing_and_others_keep_their_rows():
    faults = table()
    faults.set(1, "dropped")
    sent = faults.apply(ranges(2), 2)
    assert sent.sensors == (SENSORS[0], SENSORS[2])
    np.testing.assert_array_equal(sent.ranges, [20.0, 22.0])
    assert not sent.ranges.flags.writeable
    faults.clear(1)
    assert faults.apply(ranges(3), 3).sensors == SENSORS


def test_a_stuck_sensor_repeats_its_last_measurement_with_new_stamps():
    faults = table()
    faults.apply(ranges(1), 1)
    faults.set(2, FaultKind.STUCK)
    for k in (2, 3):
        sent = faults.apply(ranges(k), k)
        np.testing.assert_array_equal(sent.ranges, [10.0 * k, 10.0 * k + 1, 12.0])
        assert sent.stamp_ns == k
    faults.clear(2)
    np.testing.assert_array_equal(faults.apply(ranges(4), 4).ranges, [40.0, 41.0, 42.0])


def test_stuck_from_the_start_repeats_the_first():
    faults = table()
    faults.set(0, "stuck")
    assert [faults.apply(ranges(k), k).ranges[0] for k in (5, 6, 7)] == [50.0] * 3


def test_a_bias_is_added_to_what_is_measured():
    faults = table()
    faults.set(0, "biased", 0.5)
    np.testing.assert_array_equal(faults.apply(ranges(1), 1).ranges, [10.5, 11.0, 12.0])
    faults.set(0, "biased", -0.5)
    np.testing.assert_array_equal(faults.apply(ranges(1), 1).ranges, [9.5, 11.0, 12.0])


def test_a_bias_of_several_quantities():
    faults = FaultTable(SENSORS, ImuSamples.MEASURED, KEYS)
    faults.set(1, "biased", [0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    sent = faults.apply(imus(), 0)
    np.testing.assert_allclose(sent.angular_velocity, [[0] * 3, [0.1, 0.2, 0.3], [0] * 3])
    np.testing.assert_allclose(sent.specific_force, [[9] * 3, [10, 11, 12], [9] * 3])


def noise_of(faults, first, last):
    """Noise (K, 3) of measurements first..last - 1 of three sonars."""
    found = [faults.apply(ranges(k), k).ranges - ranges(k).ranges for k in range(first, last)]
    return np.array(found)


def test_noise_is_gaussian_and_white_and_of_the_sensor_alone():
    faults = table()
    faults.set(1, "noisy", 0.5)
    noise = noise_of(faults, 0, 4000)
    assert not noise[:, [0, 2]].any()
    assert noise[:, 1].std() == pytest.approx(0.5, rel=0.05)
    assert abs(noise[:, 1].mean()) < 0.03
    assert abs(np.corrcoef(noise[1:, 1], noise[:-1, 1])[0, 1]) < 0.05
    assert np.mean(np.abs(noise[:, 1]) < 0.5) == pytest.approx(0.683, abs=0.03)


def test_noise_of_several_sensors_and_components_differs():
    faults = FaultTable(SENSORS, ImuSamples.MEASURED, KEYS)
    faults.set(0, "noisy", [0.1] * 3 + [2.0] * 3)
    faults.set(1, "noisy", [0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    sent = faults.apply(imus(), 0)
    drawn = np.concatenate([sent.angular_velocity[0] / 0.1, (sent.specific_force[0] - 9.0) / 2.0])
    assert len(np.unique(drawn)) == 6
    assert np.flatnonzero(sent.angular_velocity[1]).tolist() == [1]
    np.testing.assert_array_equal(sent.specific_force[1:], 9.0)
    assert sent.angular_velocity[1, 1] != sent.angular_velocity[0, 1]


def test_noise_follows_from_stream_and_number_of_the_measurement():
    whole, late = table(), table()
    whole.set(1, "noisy", 0.5)
    expected = noise_of(whole, 0, 8)
    late.set(1, "noisy", 0.5)
    late.set(2, "biased", 1.0)
    np.testing.assert_array_equal(noise_of(late, 5, 8)[:, 1], expected[5:, 1])
    other = table()
    other.set_state(late.get_state())
    np.testing.assert_array_equal(noise_of(other, 2, 5)[:, 1], expected[2:5, 1])
    late.reset(np.array([1]), np.array([7], np.uint64))
    late.set(1, "noisy", 0.5)
    assert (noise_of(late, 5, 8)[:, 1] != expected[5:, 1]).all()


def test_state_and_reset():
    faults, other = table(), table()
    faults.apply(ranges(1), 1)
    faults.set(0, "stuck")
    faults.set(1, "biased", 2.0)
    other.set_state(faults.get_state())
    np.testing.assert_array_equal(other.apply(ranges(2), 2).ranges, [10.0, 23.0, 22.0])
    faults.reset(np.array([0]))
    assert (faults.kind(0), faults.kind(1)) == (FaultKind.NONE, FaultKind.BIASED)
    faults.set(0, "stuck")  # its past is forgotten: it sticks at the next measurement
    assert [faults.apply(ranges(k), k).ranges[0] for k in (3, 4)] == [30.0, 30.0]


@pytest.mark.parametrize(
    ("row", "kind", "value", "message"),
    [
        (3, "stuck", None, "row 3"),
        (-1, "stuck", None, "row -1"),
        (0, "broken", None, "known: none, dropped, stuck, biased, noisy"),
        (0, "biased", None, "value belongs to biased and noisy"),
        (0, "stuck", 1.0, "value belongs to biased and noisy"),
        (0, "biased", [1.0, 2.0], "1 finite numbers for ranges"),
        (0, "biased", float("nan"), "finite"),
        (0, "biased", "much", "must be numbers"),
        (0, "noisy", None, "value belongs to biased and noisy"),
        (0, "noisy", -0.1, "sigma must not be negative"),
        (0, "noisy", [1.0, 2.0], "the sigma must be 1 finite numbers for ranges"),
    ],
)
def test_wrong_faults_are_refused(row, kind, value, message):
    with pytest.raises(CommandError, match=message):
        table().set(row, kind, value)


def test_a_bias_of_an_imu_needs_all_its_numbers():
    with pytest.raises(CommandError, match="6 finite numbers"):
        FaultTable(SENSORS, ImuSamples.MEASURED, KEYS).set(0, "biased", 0.1)


def test_a_sensor_that_has_worked_for_long_gets_stuck_and_is_repaired_also_after_a_snapshot():
    faults = table()
    for k in range(3):
        faults.apply(ranges(k), k)
    kept = faults.get_state()
    last = ranges(2)
    faults.set(1, FaultKind.STUCK)
    stuck = faults.apply(ranges(3), 3)
    assert stuck.ranges[1] == last.ranges[1]
    assert stuck.ranges[0] == ranges(3).ranges[0]
    faults.clear(1)
    assert faults.apply(ranges(4), 4).ranges.tolist() == ranges(4).ranges.tolist()
    faults.set_state(kept)
    faults.set(0, FaultKind.STUCK)
    assert faults.apply(ranges(5), 5).ranges[0] == last.ranges[0]
