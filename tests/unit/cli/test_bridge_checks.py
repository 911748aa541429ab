"""Bridges that do not go together, and options that nothing heeds."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli.app import app
from volery.cli.bridge_checks import check_autopilots, check_bridges, token_gaps
from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError
from volery.mavlink.scenario_setup import with_autopilots
from volery.scenario.load import load_scenario


@pytest.mark.parametrize(
    ("bridges", "more", "text"),
    [
        (("mavlink", "px4"), {}, "--bridge mavlink and --bridge px4 would give each UAV two"),
        (("ardupilot=9100", "mavlink-tcp"), {}, "--bridge mavlink-tcp and --bridge ardupilot"),
        (("mavlink", "px4-serial=/dev/ttyACM0"), {}, "two autopilots"),
        (("px4", "ardupilot"), {}, "px4 serves all of them"),
        (("px4", "px4=4600"), {}, "px4 serves all of them"),
        (("rosbridge",), {"mavlink_key": Path("no_such_file")}, "--mavlink-key signs MAVLink"),
        (("rosbridge",), {"domain_id": 4}, "--domain-id 4: no bridge to ROS 2 is open"),
        (("mavlink",), {"drop_on_timeout": True}, "--drop-on-timeout are for external autopilots"),
        (("mavlink",), {"autopilot_timeout_s": 3.0}, "--autopilot-timeout and"),
        (("ros2=7",), {"domain_id": 4}, "--domain-id 4: ros2=7 has its own"),
        (("ros2-zenoh",), {"interfaces": ("eth0",)}, "--ros2-interface is for ROS 2 over DDS"),
    ],
)
def test_what_does_not_go_together(bridges, more, text):
    with pytest.raises(BridgeError, match=text):
        check_bridges(RunOptions("hover", bridges=bridges, **more))


@pytest.mark.parametrize(
    ("bridges", "more"),
    [
        ((), {}),
        (("mavlink", "mavlink-tcp", "mavlink=14600", "ros2"), {"mavlink_key": Path("k")}),
        (("px4-serial=/dev/ttyACM0", "px4-serial=/dev/ttyACM1"), {"drop_on_timeout": True}),
        (("ros2", "ros2=7"), {"domain_id": 4, "interfaces": ("eth0",)}),
        (("ros2-zenoh=host:7447",), {"domain_id": 4}),
    ],
)
def test_what_goes_together(bridges, more):
    try:
        check_bridges(RunOptions("hover", bridges=bridges, **more))
    except BridgeError as error:
        pytest.fail(str(error))


@pytest.mark.parametrize(
    ("bridge", "remedy"),
    [
        ("ros-tcp", "--bridge rosbridge, which asks for it"),
        ("ros-tcp-2=10001", "SSH tunnel"),
        ("sensor-link", "--bridge rosbridge"),
        ("ros1", "SSH tunnel"),
        ("ros2", "SROS 2"),
        ("mavlink", "--mavlink-key"),
        ("mavlink-tcp", "--mavlink-key"),
        ("px4", "SSH tunnel"),
    ],
)
def test_bridges_that_cannot_ask_for_the_token_are_named(bridge, remedy):
    (gap,) = token_gaps(RunOptions("hover", bridges=("rosbridge", bridge), token="secret"))
    assert gap.startswith(f"--bridge {bridge}: its protocol carries no token")
    assert remedy in gap
    assert token_gaps(RunOptions("hover", bridges=(bridge,))) == []


def test_signed_mavlink_needs_no_token():
    options = RunOptions("hover", bridges=("mavlink",), token="secret", mavlink_key=Path("key"))
    assert token_gaps(options) == []
    assert token_gaps(RunOptions("hover", bridges=("rosbridge", "comms"), token="secret")) == []


def test_a_scenario_with_autopilots_is_not_flown_by_others_too():
    scenario = with_autopilots(load_scenario("hover"))
    check_autopilots(scenario, RunOptions("hover", bridges=("mavlink",)))
    with pytest.raises(BridgeError, match="has an autopilot of its own"):
        check_autopilots(scenario, RunOptions("hover", bridges=("px4",)))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--bridge", "ros2", "--middleware", "zenoh"], "--middleware zenoh needs --ros2"),
        (["--domain-id", "4"], "no bridge to ROS 2 is open"),
        (["--bridge", "mavlink", "--bridge", "px4"], "two autopilots"),
    ],
)
def test_the_command_line_says_so_at_once(words, text):
    result = CliRunner().invoke(app, ["run", "hover", *words])
    assert result.exit_code == 2
    assert text in result.output
