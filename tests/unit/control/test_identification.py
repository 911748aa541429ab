"""Identification finds what it was given, and the shipped model fits the rigid body."""

import sys
import tomllib

import numpy as np
import pytest
from flights import F450

from volery.control import identification as identification
from volery.control.identification import identify, to_toml, validate
from volery.control.identification_flights import SAMPLE_S
from volery.core.errors import VoleryError
from volery.vehicle.identified import IdentifiedModel, SecondOrder, load_identified

SHIPPED = load_identified("f450")


def test_the_shipped_model_fits_on_held_out_flights():
    """Bounds a tenth above what was measured: 0.088 deg, 0.064 deg, 0.037 m/s^2, 0.050 m/s."""
    error = validate(SHIPPED, F450)
    assert error.attitude_deg < 0.097
    assert error.yaw_deg < 0.07
    assert error.vertical_acceleration_m_s2 < 0.041
    assert error.velocity_m_s < 0.055
    stated = SHIPPED.fit_error
    for name, value in error.model_dump().items():
        assert value == pytest.approx(getattr(stated, name), rel=0.05), name


def test_a_wrong_model_fits_worse():
    slow = SHIPPED.roll.model_copy(update={"natural_frequency_rad_s": 7.0})
    wrong = SHIPPED.model_copy(update={"roll": slow})
    assert validate(wrong, F450).attitude_deg > 3.0 * SHIPPED.fit_error.attitude_deg


def test_identification_gives_the_shipped_file_again():
    made = identify(F450)
    for loop in ("roll", "pitch", "yaw"):
        for name in ("natural_frequency_rad_s", "damping", "gain"):
            assert getattr(getattr(made, loop), name) == pytest.approx(
                getattr(getattr(SHIPPED, loop), name), rel=0.02
            )
    assert made.attitude_dead_time_s == pytest.approx(SHIPPED.attitude_dead_time_s, abs=1e-3)
    np.testing.assert_allclose(made.drag_1_s, SHIPPED.drag_1_s, atol=0.01)
    again = IdentifiedModel.model_validate(tomllib.loads(to_toml(made)))
    assert again == made


def test_the_answer_of_a_loop_is_that_of_its_equations():
    """A step through `_answer` against the closed form, dead time between samples included."""
    w, damping, dead = 9.0, 0.6, 0.0175
    loop = SecondOrder(kind="second_order", natural_frequency_rad_s=w, damping=damping, gain=0.9)
    t = SAMPLE_S * np.arange(500)
    s = np.maximum(t - dead, 0.0)
    wd = w * np.sqrt(1 - damping**2)
    exact = 0.9 * (
        1 - np.exp(-damping * w * s) * (np.cos(wd * s) + damping * w / wd * np.sin(wd * s))
    )
    answer = identification._answer(loop, dead, np.ones(500))
    np.testing.assert_allclose(answer, exact, atol=2e-4)


def test_without_scipy_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(VoleryError, match=r"volery\[identify\]"):
        identify(F450)
