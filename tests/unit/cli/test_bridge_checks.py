"""Doors that do not go together, and options that nothing heeds."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.cli.app import app
from volery.cli.bridge_checks import check_autopilots, check_doors, token_gaps
from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError
from volery.mavlink.scenario_setup import with_autopilots
from volery.scenario.load import load_scenario


@pytest.mark.parametrize(
    ("doors", "more", "text"),
    [
        (("mavlink", "px4"), {}, "--door mavlink and --door px4 would give each UAV two"),
        (("ardupilot=9100", "mavlink-tcp"), {}, "--door mavlink-tcp and --door ardupilot"),
        (("mavlink", "px4-serial=/dev/ttyACM0"), {}, "two autopilots"),
        (("px4", "ardupilot"), {}, "px4 serves all of them"),
        (("px4", "px4=4600"), {}, "px4 serves all of them"),
        (("rosbridge",), {"mavlink_key": Path("no_such_file")}, "--mavlink-key signs MAVLink"),
        (("rosbridge",), {"domain_id": 4}, "--domain-id 4: no door to ROS 2 is open"),
        (("mavlink",), {"drop_silent": True}, "--drop-silent are about autopilots outside"),
        (("mavlink",), {"autopilot_timeout_s": 3.0}, "--autopilot-timeout and"),
        (("ros2=7",), {"domain_id": 4}, "--domain-id 4: ros2=7 has its own"),
        (("ros2-zenoh",), {"interfaces": ("eth0",)}, "--ros2-interface is for ROS 2 over DDS"),
    ],
)
def test_what_does_not_go_together(doors, more, text):
    with pytest.raises(BridgeError, match=text):
        check_doors(RunOptions("hover", doors=doors, **more))


@pytest.mark.parametrize(
    ("doors", "more"),
    [
        ((), {}),
        (("mavlink", "mavlink-tcp", "mavlink=14600", "ros2"), {"mavlink_key": Path("k")}),
        (("px4-serial=/dev/ttyACM0", "px4-serial=/dev/ttyACM1"), {"drop_silent": True}),
        (("ros2", "ros2=7"), {"domain_id": 4, "interfaces": ("eth0",)}),
        (("ros2-zenoh=host:7447",), {"domain_id": 4}),
    ],
)
def test_what_goes_together(doors, more):
    check_doors(RunOptions("hover", doors=doors, **more))


@pytest.mark.parametrize(
    ("door", "remedy"),
    [
        ("ros-tcp", "--door rosbridge, which asks for it"),
        ("ros-tcp-2=10001", "SSH tunnel"),
        ("sensor-link", "--door rosbridge"),
        ("ros1", "SSH tunnel"),
        ("ros2", "SROS 2"),
        ("mavlink", "--mavlink-key"),
        ("mavlink-tcp", "--mavlink-key"),
        ("px4", "SSH tunnel"),
    ],
)
def test_bridges_that_cannot_ask_for_the_token_are_named(door, remedy):
    (gap,) = token_gaps(RunOptions("hover", doors=("rosbridge", door), token="secret"))
    assert gap.startswith(f"--door {door}: this bridge cannot ask for the --token")
    assert remedy in gap
    assert token_gaps(RunOptions("hover", doors=(door,))) == []


def test_signed_mavlink_needs_no_token():
    options = RunOptions("hover", doors=("mavlink",), token="secret", mavlink_key=Path("key"))
    assert token_gaps(options) == []
    assert token_gaps(RunOptions("hover", doors=("rosbridge", "comms"), token="secret")) == []


def test_a_scenario_with_autopilots_is_not_flown_by_others_too():
    scenario = with_autopilots(load_scenario("hover"))
    check_autopilots(scenario, RunOptions("hover", doors=("mavlink",)))
    with pytest.raises(BridgeError, match="has an autopilot of its own"):
        check_autopilots(scenario, RunOptions("hover", doors=("px4",)))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--door", "ros2", "--middleware", "zenoh"], "--middleware zenoh is of --ros2"),
        (["--domain-id", "4"], "no door to ROS 2 is open"),
        (["--door", "mavlink", "--door", "px4"], "two autopilots"),
    ],
)
def test_the_command_line_says_so_at_once(words, text):
    result = CliRunner().invoke(app, ["run", "hover", *words])
    assert result.exit_code == 2
    assert text in result.output
