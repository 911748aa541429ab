"""Tests limits of quantities: by the unit in a key, with the likely other unit in the message."""

import math

import pytest

from volery.core.quantities import Quantity, fault_in, quantity_of


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("mass_kg", "kg"),
        ("drag_area_m2", "m2"),
        ("speed_m_s", "m/s"),
        ("acceleration_m_s2", "m/s^2"),
        ("max_speed_rad_s", "rad/s"),
        ("position_m", "m"),
        ("drag_1_s", "1/s"),
        ("rate_hz", "Hz"),
        ("torque_m", "m"),
    ],
)
def test_the_end_of_a_key_names_the_quantity(key, unit):
    assert quantity_of(key).unit == unit


def test_a_key_without_a_unit_has_none():
    assert quantity_of("gain") is None
    assert quantity_of("route") is None


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("drag_area_m2", 20000.0, "20000 m2 is beyond 0 to 100 m2; given in mm2?"),
        ("mass_kg", 2065.0, "given in g?"),
        ("rise_time_s", 1e9, "1e+09 s is beyond"),
        ("capacity_ah", 52000.0, "given in mAh?"),
        ("mass_kg", 1e-300, "beyond"),
        ("route", [[1.0, 1e308]], "entry [0][1]: 1e+308"),
        ("mount", [0.0, math.nan, 0.0], "entry [1]: nan is not finite"),
        ("px4", {"a": {"b": [math.inf]}}, "entry a.b[0]: inf is not finite"),
        ("height_m", 10**400, "bits"),
        ("gain", 10**400, "bits"),
        ("gain", -math.inf, "-inf is not finite"),
        ("seed", -5, "-5 is beyond 0 to"),
        ("timeout_s", -0.1, "-0.1 s is beyond 0 to"),
        ("safe_radius_m", -1.0, "-1 m is beyond 0 to"),
        ("fraction", 1.5, "1.5 is beyond 0 to 1"),
    ],
)
def test_what_is_beyond_is_reported(key, value, words):
    assert words in fault_in(key, value, low=0.0, positive=key == "mass_kg")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("mass_kg", 0.027),
        ("mass_kg", 100.0),
        ("region_m", [-5000.0, -5000.0, 5000.0, 5000.0]),
        ("seed", 2**63 - 1),
        ("team", ["uav1", "uav2"]),
        ("use_map_tf", True),
        ("gain", 0.0),
    ],
)
def test_what_is_real_is_within(key, value):
    assert fault_in(key, value, positive=isinstance(value, float) and value > 0.0) is None


def test_a_kind_of_data_may_have_bounds_of_its_own():
    special = {"m": Quantity("m", 10.0)}
    assert fault_in("position_m", [0.0, 11.0, 0.0], special=special)
    assert fault_in("position_m", [0.0, 11.0, 0.0]) is None
