"""What a physics step can compute: the limit by theory, by the plant itself, and its errors."""

import numpy as np
import pytest

from volery.control.fleet import Fleet
from volery.control.stability import STABLE_BELOW, check_stability, terms_of
from volery.core.errors import DataFileError
from volery.vehicle.airframe import airframe_names, load_airframe
from volery.vehicle.identified import load_identified
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import RigidBody


def with_body(name, **body):
    airframe = load_airframe(name)
    return airframe.model_copy(update={"body": airframe.body.model_copy(update=body)})


@pytest.mark.parametrize("name", airframe_names())
def test_airframes_that_ship_are_far_from_the_limit(name):
    worst = terms_of(load_airframe(name), RigidBody(), 0.005, 70.0)[0]
    assert worst.fraction < 0.1 * STABLE_BELOW
    check_stability(load_airframe(name), RigidBody(), 0.005)


@pytest.mark.parametrize(("share", "stable"), [(0.97, True), (1.03, False)])
def test_the_limit_is_that_of_the_step(share, stable):
    """v' = -z/dt v, as the plant steps it: at mid-step, extrapolated from the last acceleration."""
    velocity, before = 1.0, 0.0
    for _ in range(3000):
        taken = -share * (velocity + 0.5 * before)
        velocity, before = velocity + taken, taken
    assert (abs(velocity) < 1.0) == stable


def test_a_stiff_airframe_is_refused_with_its_number():
    airframe = with_body("f450", drag_area_m2=(90.0, 90.0, 90.0))
    with pytest.raises(DataFileError, match=r"airframe 'f450': body.drag_area_m2.*physics.rate_hz"):
        Fleet([airframe], [[0.0, 0.0, 5.0]], [[0.0, 0.0, 0.0, 1.0]])


def test_a_stiff_identified_model_is_refused_with_its_number():
    model = load_identified("f450").model_copy(update={"drag_1_s": (1500.0, 1.0, 0.0)})
    with pytest.raises(DataFileError, match="identified model 'f450': drag_1_s"):
        check_stability(load_airframe("f450"), model, 1e-3)
    check_stability(load_airframe("f450"), model, 5e-4)


def test_kinematic_uavs_have_nothing_stiff():
    airframe = with_body("f450", drag_area_m2=(90.0, 90.0, 90.0))
    assert terms_of(airframe, Kinematic(), 1e-3, 70.0) == []
    fleet = Fleet([airframe], [[0.0, 0.0, 5.0]], [[0.0, 0.0, 0.0, 1.0]], plants=Kinematic())
    assert np.isfinite(fleet.state.position_map).all()
