import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.core.errors import DataFileError
from volery.vehicle.airframe import (
    Airframe,
    airframe_names,
    allocation_matrix,
    hover_thrusts,
    load_airframe,
    wrench_matrix,
)


def write(tmp_path, edit):
    """A copy of the F450's file with a line changed by `edit`."""
    import volery.vehicle.airframe as module

    text = (module._AIRFRAMES / "f450.toml").read_text()
    path = tmp_path / "mine.toml"
    changed = edit(text)
    assert changed != text
    path.write_text(changed)
    return path


def test_f450_is_openuavs_but_for_its_drag():
    f450 = load_airframe("f450")
    assert airframe_names()[0] == "f450" or "f450" in airframe_names()
    assert f450.body.mass_kg == pytest.approx(2.0 + 0.045 + 0.02)
    assert f450.body.inertia_kg_m2 == (0.0337, 0.0337, 0.0185)
    assert f450.rotors.thrust_n_s2 == 8.54858e-6
    assert f450.rotors.drag_n_s2_m == 1.75e-4
    assert f450.rotors.max_speed_rad_s == 1100.0
    assert f450.max_rotor_thrust * 4 / f450.weight == pytest.approx(2.04, abs=0.01)
    assert np.sqrt(hover_thrusts(f450) / f450.rotors.thrust_n_s2) == pytest.approx(770, abs=1)


def test_own_file_beside_the_scenario(tmp_path):
    path = write(tmp_path, lambda t: t.replace('name = "f450"', 'name = "mine"'))
    assert load_airframe("mine.toml", tmp_path).name == "mine"
    assert load_airframe(path).name == "mine"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 2.065", "mass_kg = -2.0", ["body.mass_kg", "above 0"]),
        ("mass_kg = 2.065", "mass_kg = nan", ["body.mass_kg", "finite"]),
        ("mass_kg = 2.065", "mass = 2.065", ["mass_kg"]),
        ("mass_kg = 2.065", "mass_kg = 5.0", ["hover", "41.4 N", "weight"]),
        ("[0.0337, 0.0337, 0.0185]", "[0.01, 0.01, 0.03]", ["inertia", "sum of the other two"]),
        ("[0.0337, 0.0337, 0.0185]", "[0.0337, 0.0337]", ["inertia_kg_m2"]),
        ("fall_time_s = 0.025", "fall_time_s = 0.0", ["rotors.fall_time_s", "above 0"]),
        ("torque_m = 0.06", "torque_m = -0.06", ["rotors.torque_m"]),
        ('direction = "cw"', 'direction = "ccw"', ["cannot steer"]),
        ('direction = "cw"', 'direction = "left"', ["direction", "'ccw' or 'cw'"]),
        ("collision_radius_m = 0.37", "collision_radius_m = 0.2", ["collision_radius_m", "0.362"]),
        ("landing_m_s = 0.7", "landing_m_s = 3.0", ["landing_m_s", "below"]),
        ("[0.13, 0.13, -0.12], [-0.13, 0.13, -0.12]", "[0.13, 0.13, 0.12]", ["feet_m"]),
        ("friction = 0.8", "friction = 0.8\nglue = 1.0", ["glue", "friction"]),
        ("cells = 4", "cells = 0", ["battery.cells", "a number of at least 1"]),
        ("rated_v = 14.8", "rated_v = nan", ["battery.rated_v", "finite"]),
        ("rated_v = 14.8", "rated_v = 25.0", ["battery cannot sustain hover", "17.5 V", "sags to"]),
        ("resistance_ohm = 0.028 ", "resistance_ohm = 0.5 ", ["cannot give that power", "347 W"]),
        ("3.3, 3.61, 3.69", "3.7, 3.61, 3.69", ["battery", "open_circuit_v must not fall"]),
        (
            "efficiency = 0.75",
            "efficiency = 1.5",
            ["battery.efficiency", "a number of at most 1"],
        ),
        ("rated_v = 14.8", "rated_v = 14.8\nlow = 0.05", ["critical = 0.07 must be below low"]),
        (
            "rated_v = 14.8",
            "rated_v = 14.8\nemergency = 0.1",
            ["emergency = 0.1 must be below critical"],
        ),
        ("rated_v = 14.8", "rated_v = 14.8\nvolts = 3", ["battery.volts"]),
        ("[0.159, 0.159, 0.11]", "[0.159, nan, 0.11]", ["rotors.places", "finite"]),
        ("tilt_deg = 45.0", "tilt_deg = 95.0", ["limits.tilt_deg", "75"]),
    ],
)
def test_impossible_files_are_refused(tmp_path, old, new, words):
    path = write(tmp_path, lambda t: t.replace(old, new))
    with pytest.raises(DataFileError) as error:
        load_airframe(path)
    for word in [*words, "mine.toml"]:
        assert word in str(error.value), str(error.value)


def test_three_rotors_are_refused(tmp_path):
    path = write(
        tmp_path,
        lambda t: t.replace(
            '[[rotors.places]]\nposition_m = [-0.159, -0.159, 0.11]\ndirection = "cw"\n', ""
        ),
    )
    with pytest.raises(DataFileError, match=r"rotors\.places"):
        load_airframe(path)


def test_unknown_name_lists_the_known():
    with pytest.raises(DataFileError, match=r"f45.*f450"):
        load_airframe("f45")


def test_broken_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("name = ")
    with pytest.raises(DataFileError, match=r"mine\.toml"):
        load_airframe(path)


@given(
    count=st.integers(2, 6),
    radius=st.floats(0.15, 0.4),
    height=st.floats(-0.05, 0.1),
    lean=st.floats(-0.05, 0.05),
)
def test_allocation_gives_what_is_asked(count, radius, height, lean):
    """Any even ring of rotors: rotor thrusts of the allocation add up to thrust and torque."""
    data = load_airframe("f450").model_dump()
    data["body"]["collision_radius_m"] = 1.0
    angles = (np.arange(2 * count) + 0.5) * np.pi / count
    data["rotors"]["places"] = [
        {
            "position_m": [radius * np.cos(a), radius * np.sin(a), height],
            "direction": "ccw" if k % 2 else "cw",
            "axis": [lean * np.cos(a), lean * np.sin(a), 1.0],
        }
        for k, a in enumerate(angles)
    ]
    airframe = Airframe.model_validate(data)
    effect = wrench_matrix(airframe)[2:] @ allocation_matrix(airframe)
    np.testing.assert_allclose(effect, np.eye(4), atol=1e-9)
    np.testing.assert_allclose(hover_thrusts(airframe), airframe.weight / (2 * count), rtol=0.01)
