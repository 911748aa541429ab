"""What every kind of sensor keeps to. A new kind joins by one line in KINDS."""

import copy
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

from volery.core.clock import Schedule
from volery.graph.typestore import typestore
from volery.runtime.construction.sensor_suites import RESULT_OF, noise_key
from volery.sensors import model as sensor_models

NS = 1_000_000_000
STEP_NS = 1_000_000
MODELS = Path(sensor_models.__file__).parent / "models"
DOCS = Path(__file__).parents[2] / "docs"


class Kind(NamedTuple):
    """A kind of sensor: its entry in a scenario, its topics, and what it promises."""

    kind: str
    topics: tuple[str, ...]
    """Below /uavN/; the first carries every measurement."""
    rate_hz: float
    title: str
    """How docs/models.md calls it."""
    model: str | None = None
    """The data file of the default model."""
    lag_ns: int = 0
    stamps_instant: bool = False
    """Whether the stamp is the nominal instant, not the physics step that comes next."""
    noisy_at_rest: bool = True
    entry: Mapping[str, Any] = MappingProxyType({})
    """What a scenario's entry needs beyond the kind, such as a view of the ground."""


DOWN_AHEAD = {"position_m": [0.3, 0.0, 0.3], "rpy_deg": [0.0, 60.0, 0.0]}
LEANT = {"name": "horizontal", "position_m": [0.0, 0.0, 0.2], "rpy_deg": [0.0, 20.0, 0.0]}
KINDS = [
    Kind("imu", ("imu",), 200.0, "IMU", "adis16448"),
    Kind("sonar", ("range",), 10.0, "Sonar", "downward_sonar", entry=DOWN_AHEAD),
    Kind("odometry", ("odom",), 50.0, "Odometry", "visual_inertial"),
    Kind("ground_truth", ("ground_truth/odom",), 50.0, "Ground truth", noisy_at_rest=False),
    Kind("gnss", ("fix", "fix_velocity"), 5.0, "GNSS", "gnss_m8", 120_000_000, True),
    Kind("barometer", ("pressure", "pressure/temperature"), 50.0, "Barometer", "barometer_px4"),
    Kind("magnetometer", ("mag",), 100.0, "Magnetometer", "magnetometer_px4"),
    Kind("battery", ("battery",), 20.0, "Battery", noisy_at_rest=False,
         entry={"rate_hz": 20.0}),
    Kind("lidar", ("laser/horizontal/scan",), 40.0, "Hokuyo", "utm_30lx", 18_750_000, True,
         entry=LEANT),
    Kind("camera", ("camera/depth", "camera/image_raw", "camera/camera_info",
                    "camera/labels/instance", "camera/labels/material",
                    "camera/image_raw/compressed", "camera/depth/compressedDepth",
                    "camera/points"),
         10.0, "Camera", "pinhole",
         entry={**DOWN_AHEAD, "width": 24, "height": 17, "points": "xyzrgb"}),
]  # fmt: skip

every_kind = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)


def scenario(kind, *, uavs=1, seed=1, **changes):
    """UAVs at rest on level ground beyond each other's range, each with the sensor alone."""
    entry = {"kind": kind.kind, **kind.entry, **changes}
    return {
        "name": "conformance",
        "seed": seed,
        "types": {"f450": {"sensors": [entry]}},
        "uavs": [{"type": "f450", "position_m": [100.0 * i, 0.0]} for i in range(uavs)],
    }


def record(simulation, kind, seconds=0.5, slices=(500,), uav="uav1"):
    """Everything that a UAV's sensor sends."""
    got = []
    for topic in kind.topics:
        simulation.graph.subscribe(f"/{uav}/{topic}", got.append)
    left, turn = round(seconds * 1000), 0
    while left > 0:
        steps = min(left, slices[turn % len(slices)])
        simulation.step(steps)
        left, turn = left - steps, turn + 1
    return got


def as_bytes(published):
    return [(m.topic, m.time_ns, m.cdr) for m in published]


def arrays_of(samples):
    return {n: v for n, v in vars(samples).items() if isinstance(v, np.ndarray)}


def assert_same(samples, others, rows=slice(None), other_rows=slice(None)):
    ours, theirs = arrays_of(samples), arrays_of(others)
    assert ours
    for name, array in ours.items():
        np.testing.assert_array_equal(array[rows], theirs[name][other_rows], err_msg=name)


def differs(samples, others, rows=slice(None)):
    ours, theirs = arrays_of(samples), arrays_of(others)
    return not all(np.array_equal(ours[n][rows], theirs[n][rows], equal_nan=True) for n in ours)


class Measuring:
    """A bank over a fleet at rest, sampled row by row."""

    def __init__(self, simulate, data):
        self.simulation = simulate(data)
        self.simulation.step(300)  # the history of poses is full
        (self.bank,) = self.simulation._engine.banks

    def __call__(self, k):
        """Measurement k, as if made at the same age of the simulation each time."""
        time_ns = self.simulation.time_ns - self.bank.lag_ns
        return self.bank.sample(k, time_ns, self.simulation._engine.fleet)


def test_every_kind_of_the_scenario_is_listed():
    made_of_others = {"estimate"}  # see tests/e2e/test_estimates.py
    assert {kind.kind for kind in KINDS} == set(RESULT_OF) - made_of_others


@every_kind
def test_rate_and_phase(simulate, kind):
    phase_ns = 12_300_000
    published = record(simulate(scenario(kind, phase_s=phase_ns / NS)), kind)
    messages = [m for m in published if m.topic.endswith("/" + kind.topics[0])]
    schedule = Schedule.from_hz(kind.rate_hz, phase_ns)
    due = [schedule.instant_ns(k) for k in range(len(messages) + 1)]
    steps = [-(-(instant + kind.lag_ns) // STEP_NS) * STEP_NS for instant in due]
    assert [m.time_ns for m in messages] == steps[:-1]
    assert steps[-1] > 500 * STEP_NS
    stamps = [m.message.header.stamp.sec * NS + m.message.header.stamp.nanosec for m in messages]
    assert stamps == (due if kind.stamps_instant else steps)[:-1]
    assert len(messages) >= 2


@every_kind
def test_same_seed_same_bytes_however_sliced_and_whatever_else_flies(simulate, kind):
    alone = as_bytes(record(simulate(scenario(kind)), kind))
    assert alone
    assert as_bytes(record(simulate(scenario(kind)), kind, slices=(1, 7, 33))) == alone
    assert as_bytes(record(simulate(scenario(kind, uavs=3)), kind)) == alone
    other_seed = as_bytes(record(simulate(scenario(kind, seed=2)), kind))
    assert (other_seed != alone) == kind.noisy_at_rest


@every_kind
def test_instances_share_no_state(simulate, kind):
    alone = as_bytes(record(simulate(scenario(kind)), kind))
    one, other = simulate(scenario(kind)), simulate(scenario(kind, seed=5))
    got = []
    for topic in kind.topics:
        one.graph.subscribe(f"/uav1/{topic}", got.append)
    for _ in range(10):
        one.step(50)
        other.step(70)
    assert as_bytes(got) == alone


@every_kind
def test_messages_are_valid(simulate, kind):
    published = record(simulate(scenario(kind)), kind)
    assert {m.topic for m in published} == {f"/uav1/{topic}" for topic in kind.topics}
    for m in published[:20]:
        back = typestore().deserialize_cdr(m.cdr, m.msgtype)
        again = bytes(typestore().serialize_cdr(back, m.msgtype))
        assert again == m.cdr
        frame = m.message.header.frame_id
        assert frame == "map" or frame.startswith("uav1/")
        for value in vars(m.message).values():
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable


@every_kind
def test_noise_is_documented_and_can_be_switched_off(simulate, kind):
    text = (DOCS / "models.md").read_text(encoding="utf-8")
    assert f"**{kind.title}" in text[text.index("## Sensors") :]
    if kind.model is None:
        return
    source = (MODELS / f"{kind.model}.toml").read_text(encoding="utf-8")
    assert source.startswith("#"), "a model file begins with its source"
    noisy = as_bytes(record(simulate(scenario(kind)), kind))
    exact = as_bytes(record(simulate(scenario(kind, noise=False)), kind))
    assert noisy != exact
    assert exact == as_bytes(record(simulate(scenario(kind, noise=False, seed=9)), kind))


def is_plain(state):
    if isinstance(state, dict):
        return all(isinstance(k, str) and is_plain(v) for k, v in state.items())
    return isinstance(state, np.ndarray | bool | int | float | str) and (
        not isinstance(state, np.ndarray) or state.dtype != object
    )


@every_kind
def test_state_can_be_kept_and_given_to_another_instance(simulate, kind):
    measure, other = (Measuring(simulate, scenario(kind, uavs=2)) for _ in range(2))
    for k in range(3):
        measure(k)
    kept = measure.bank.get_state()
    assert is_plain(kept)
    frozen = copy.deepcopy(kept)
    expected = [measure(k) for k in range(3, 6)]
    np.testing.assert_equal(kept, frozen)  # a copy, not a view of what goes on changing
    for instance in (measure, other):
        instance.bank.set_state(kept)
        for samples, k in zip(expected, range(3, 6), strict=True):
            assert_same(instance(k), samples)


def reset(measure, kind, uavs, keys, k):
    measure.bank.reset(uavs, keys, measure.simulation.time_ns, k)


@every_kind
def test_reset_rows_start_afresh_and_others_go_on(simulate, kind):
    """Row 1 measures from k = 5 as a fresh bank of another seed does from k = 0."""
    measure, undisturbed = (Measuring(simulate, scenario(kind, uavs=3)) for _ in range(2))
    fresh = Measuring(simulate, scenario(kind, uavs=3, seed=77))
    reset(fresh, kind, None, None, 0)  # odometry begins where the UAVs have settled
    for k in range(5):
        measure(k), undisturbed(k)
    keys = np.array([noise_key(77, kind.kind, measure.bank.sensors[1])])
    reset(measure, kind, np.array([1]), keys, 5)
    for k in range(5, 10):
        samples, expected, plain = measure(k), fresh(k - 5), undisturbed(k)
        assert_same(samples, expected, 1, 1)
        assert_same(samples, plain, [0, 2], [0, 2])
    if kind.noisy_at_rest:
        assert differs(samples, plain, [1])


@every_kind
def test_reset_of_all_keeps_streams_without_new_keys(simulate, kind):
    measure, fresh = (Measuring(simulate, scenario(kind, uavs=2)) for _ in range(2))
    for k in range(4):
        measure(k)
    for instance, k in ((measure, 4), (fresh, 0)):
        reset(instance, kind, None, None, k)
    for k in range(3):
        assert_same(measure(4 + k), fresh(k))


@every_kind
def test_faults(simulate, kind):
    measure, sound = (Measuring(simulate, scenario(kind, uavs=3)) for _ in range(2))
    first = measure(0)
    sound(0)
    numbers = sum(type(first).MEASURED.values())
    faults = measure.bank.faults
    faults.set(0, "dropped")
    faults.set(1, "stuck")
    faults.set(2, "biased", np.arange(1.0, 1.0 + numbers))
    samples, expected = measure(1), sound(1)
    assert samples.sensors == expected.sensors[1:]
    assert_same(samples, first, 0, 1)
    at = 0
    for name, count in type(samples).MEASURED.items():
        bias = np.arange(1.0 + at, 1.0 + at + count)
        with np.errstate(invalid="ignore"):
            moved = getattr(samples, name)[1] - getattr(expected, name)[2]
        moved = moved[np.isfinite(moved)]
        assert moved.size
        np.testing.assert_allclose(moved, np.resize(bias, moved.shape), rtol=1e-5)
        at += count
    for row in range(3):
        faults.clear(row)
    assert_same(measure(2), sound(2))  # a fault changes no later noise


@every_kind
def test_noise_of_a_fault(simulate, kind):
    """Every measured number has its own; the draws of other sensors and later ones stay."""
    measure, sound = (Measuring(simulate, scenario(kind, uavs=2)) for _ in range(2))
    first = measure(0)
    sound(0)
    measured = type(first).MEASURED
    faults = measure.bank.faults
    faults.set(1, "noisy", [1e-3] * sum(measured.values()))
    samples, expected = measure(1), sound(1)
    assert_same(samples, expected, 0, 0)
    for name in measured:
        with np.errstate(invalid="ignore"):
            moved = (getattr(samples, name)[1] - getattr(expected, name)[1]).ravel()
        moved = moved[np.isfinite(moved)]
        assert moved.size
        assert (np.abs(moved) < 0.01).all()
        assert len(np.unique(moved)) > 0.5 * moved.size
        assert moved.any()
    faults.clear(1)
    assert_same(measure(2), sound(2))


@every_kind
def test_a_dropped_sensor_is_silent_on_the_graph(simulate, kind):
    simulation = simulate(scenario(kind, uavs=2))
    (bank,) = simulation._engine.banks
    bank.faults.set(0, "dropped")
    silent = record(simulation, kind)
    assert not silent
    bank.faults.clear(0)
    speaking = partial(record, simulation, kind)
    assert speaking()
