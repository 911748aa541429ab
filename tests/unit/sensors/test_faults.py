"""Broken sensors: dropped, stuck, biased, for any kind of samples."""

import numpy as np
import pytest

from volery.core.errors import CommandError
from volery.sensors.faults import FaultKind, FaultTable
from volery.sensors.samples import ImuSamples, RangeSamples, SensorId

SENSORS = tuple(SensorId(i, f"uav{i + 1}", "range") for i in range(3))


def ranges(k):
    """Reading k of three sonars: 10 k + row."""
    values = 10.0 * k + np.arange(3.0)
    values.flags.writeable = False
    return RangeSamples(SENSORS, k, values, 0.4, 0.2, 7.0, 1e-4)


def imus():
    zero = np.zeros((3, 3))
    return ImuSamples(SENSORS, 0, zero, zero + 9.0, 0.1, 0.2)


def table():
    return FaultTable(SENSORS, RangeSamples.MEASURED)


def test_without_faults_samples_pass_untouched():
    samples = ranges(1)
    assert table().apply(samples) is samples


def test_a_dropped_sensor_sends_nothing_and_others_keep_their_rows():
    faults = table()
    faults.set(1, "dropped")
    sent = faults.apply(ranges(2))
    assert sent.sensors == (SENSORS[0], SENSORS[2])
    np.testing.assert_array_equal(sent.ranges, [20.0, 22.0])
    assert not sent.ranges.flags.writeable
    faults.clear(1)
    assert faults.apply(ranges(3)).sensors == SENSORS


def test_a_stuck_sensor_repeats_its_last_measurement_with_new_stamps():
    faults = table()
    faults.apply(ranges(1))
    faults.set(2, FaultKind.STUCK)
    for k in (2, 3):
        sent = faults.apply(ranges(k))
        np.testing.assert_array_equal(sent.ranges, [10.0 * k, 10.0 * k + 1, 12.0])
        assert sent.stamp_ns == k
    faults.clear(2)
    np.testing.assert_array_equal(faults.apply(ranges(4)).ranges, [40.0, 41.0, 42.0])


def test_stuck_from_the_start_repeats_the_first():
    faults = table()
    faults.set(0, "stuck")
    assert [faults.apply(ranges(k)).ranges[0] for k in (5, 6, 7)] == [50.0] * 3


def test_a_bias_is_added_to_what_is_measured():
    faults = table()
    faults.set(0, "biased", 0.5)
    np.testing.assert_array_equal(faults.apply(ranges(1)).ranges, [10.5, 11.0, 12.0])
    faults.set(0, "biased", -0.5)
    np.testing.assert_array_equal(faults.apply(ranges(1)).ranges, [9.5, 11.0, 12.0])


def test_a_bias_of_several_quantities():
    faults = FaultTable(SENSORS, ImuSamples.MEASURED)
    faults.set(1, "biased", [0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    sent = faults.apply(imus())
    np.testing.assert_allclose(sent.angular_velocity, [[0] * 3, [0.1, 0.2, 0.3], [0] * 3])
    np.testing.assert_allclose(sent.specific_force, [[9] * 3, [10, 11, 12], [9] * 3])


def test_state_and_reset():
    faults, other = table(), table()
    faults.apply(ranges(1))
    faults.set(0, "stuck")
    faults.set(1, "biased", 2.0)
    other.set_state(faults.get_state())
    np.testing.assert_array_equal(other.apply(ranges(2)).ranges, [10.0, 23.0, 22.0])
    faults.reset(np.array([0]))
    assert (faults.kind(0), faults.kind(1)) == (FaultKind.NONE, FaultKind.BIASED)
    faults.set(0, "stuck")  # its past is forgotten: it sticks at the next measurement
    assert [faults.apply(ranges(k)).ranges[0] for k in (3, 4)] == [30.0, 30.0]


@pytest.mark.parametrize(
    ("row", "kind", "value", "said"),
    [
        (3, "stuck", None, "row 3"),
        (-1, "stuck", None, "row -1"),
        (0, "broken", None, "known: none, dropped, stuck, biased"),
        (0, "biased", None, "value belongs to biased"),
        (0, "stuck", 1.0, "value belongs to biased"),
        (0, "biased", [1.0, 2.0], "1 finite numbers for ranges"),
        (0, "biased", float("nan"), "finite"),
        (0, "biased", "much", "must be numbers"),
    ],
)
def test_wrong_faults_are_refused(row, kind, value, said):
    with pytest.raises(CommandError, match=said):
        table().set(row, kind, value)


def test_a_bias_of_an_imu_needs_all_its_numbers():
    with pytest.raises(CommandError, match="6 finite numbers"):
        FaultTable(SENSORS, ImuSamples.MEASURED).set(0, "biased", 0.1)


def test_who_has_worked_for_long_gets_stuck_and_is_mended_also_after_a_snapshot():
    faults = table()
    for k in range(3):
        faults.apply(ranges(k))
    kept = faults.get_state()
    last = ranges(2)
    faults.set(1, FaultKind.STUCK)
    stuck = faults.apply(ranges(3))
    assert stuck.ranges[1] == last.ranges[1]
    assert stuck.ranges[0] == ranges(3).ranges[0]
    faults.clear(1)
    assert faults.apply(ranges(4)).ranges.tolist() == ranges(4).ranges.tolist()
    faults.set_state(kept)
    faults.set(0, FaultKind.STUCK)
    assert faults.apply(ranges(5)).ranges[0] == last.ranges[0]
