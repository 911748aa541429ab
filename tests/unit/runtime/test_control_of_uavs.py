"""Who holds a UAV: one pilot at a time."""

import pytest

from volery.core.errors import CommandError
from volery.runtime.vehicles.control_authority import ControlAuthority


@pytest.fixture
def pilots():
    return ControlAuthority(lambda: ("uav1", "uav2"))


def test_taking_releasing_and_handing_over(pilots):
    assert pilots.holder_of("uav1") == ""
    pilots.take("uav1", "Anna")
    pilots.take("uav1", "Anna")
    assert pilots.holder_of("uav1") == "Anna"
    assert pilots.holder_of("uav2") == ""
    pilots.hand_over("uav1", "Anna", "Ben")
    assert pilots.holder_of("uav1") == "Ben"
    pilots.release("uav1", "Ben")
    assert pilots.holder_of("uav1") == ""


def test_what_another_holds_stays_his(pilots):
    pilots.take("uav1", "Anna")
    for attempt in (
        lambda: pilots.take("uav1", "Ben"),
        lambda: pilots.release("uav1", "Ben"),
        lambda: pilots.hand_over("uav1", "Ben", "Carl"),
    ):
        with pytest.raises(CommandError, match="uav1 is held by Anna"):
            attempt()
    with pytest.raises(CommandError, match="does not hold uav2"):
        pilots.release("uav2", "Ben")
    assert pilots.holder_of("uav1") == "Anna"


def test_who_leaves_lets_go_of_everything(pilots):
    pilots.take("uav1", "Anna")
    pilots.take("uav2", "Anna")
    assert pilots.held_by("Anna") == ("uav1", "uav2")
    pilots.leave("Anna")
    assert pilots.held_by("Anna") == ()
    pilots.take("uav2", "Ben")
    pilots.release("", "Anna")
    assert pilots.holder_of("uav2") == "Ben"


@pytest.mark.parametrize("name", ["", "  ", "x" * 41, "\u200b\n"])
def test_a_pilot_has_a_name(pilots, name):
    with pytest.raises(CommandError, match="a pilot needs a name"):
        pilots.take("uav1", name)


def test_there_must_be_such_a_uav(pilots):
    with pytest.raises(CommandError, match="no UAV 'uav9'; known: uav1, uav2"):
        pilots.take("uav9", "Anna")
