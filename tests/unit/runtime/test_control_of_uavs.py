"""Control authority over a UAV: one operator at a time."""

import pytest

from volery.core.errors import CommandError
from volery.runtime.vehicles.control_authority import ControlAuthority


@pytest.fixture
def operators():
    return ControlAuthority(lambda: ("uav1", "uav2"))


def test_taking_releasing_and_handing_over(operators):
    assert operators.operator_of("uav1") == ""
    operators.take("uav1", "Anna")
    operators.take("uav1", "Anna")
    assert operators.operator_of("uav1") == "Anna"
    assert operators.operator_of("uav2") == ""
    operators.hand_over("uav1", "Anna", "Ben")
    assert operators.operator_of("uav1") == "Ben"
    operators.release("uav1", "Ben")
    assert operators.operator_of("uav1") == ""


def test_what_another_holds_stays_his(operators):
    operators.take("uav1", "Anna")
    for attempt in (
        lambda: operators.take("uav1", "Ben"),
        lambda: operators.release("uav1", "Ben"),
        lambda: operators.hand_over("uav1", "Ben", "Carl"),
    ):
        with pytest.raises(CommandError, match="uav1 is held by Anna"):
            attempt()
    with pytest.raises(CommandError, match="does not hold uav2"):
        operators.release("uav2", "Ben")
    assert operators.operator_of("uav1") == "Anna"


def test_a_client_that_leaves_releases_everything(operators):
    operators.take("uav1", "Anna")
    operators.take("uav2", "Anna")
    assert operators.held_by("Anna") == ("uav1", "uav2")
    operators.leave("Anna")
    assert operators.held_by("Anna") == ()
    operators.take("uav2", "Ben")
    operators.release("", "Anna")
    assert operators.operator_of("uav2") == "Ben"


@pytest.mark.parametrize("name", ["", "  ", "x" * 41, "\u200b\n"])
def test_a_operator_has_a_name(operators, name):
    with pytest.raises(CommandError, match="an operator needs a name"):
        operators.take("uav1", name)


def test_there_must_be_such_a_uav(operators):
    with pytest.raises(CommandError, match="no UAV 'uav9'; known: uav1, uav2"):
        operators.take("uav9", "Anna")
