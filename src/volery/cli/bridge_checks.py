"""Checks before a build which bridges exclude each other and which options need which bridge."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.scenario.schema import Scenario

BUILT_IN = ("mavlink", "mavlink-tcp", "mavlink-serial")
"""Bridges to Volery's built-in autopilot."""

_EXTERNAL_AUTOPILOTS = ("px4", "px4-serial", "ardupilot")
"""Bridges to external autopilots, which control the UAVs."""
_EVERY = ("px4", "ardupilot")
"""External autopilots that control all UAVs of a run."""

_ROS2 = ("ros2", "ros2-zenoh")

_BY_SIGNING = ("mavlink", "mavlink-tcp")
_WITHOUT_TOKEN = (
    *("ros-tcp", "ros-tcp-2", "ros1", "ros2", "ros2-zenoh", "sensor-link", "px4", "ardupilot"),
    *_BY_SIGNING,
)
"""Bridges that accept connections and whose protocols carry no token."""


def check_bridges(options: RunOptions) -> None:
    """Checks the bridges of a run's options.

    Raises `BridgeError` for bridges that exclude each other and for options without their bridge.
    """
    names = _names(options)
    _check_autopilots(names)
    if options.mavlink_key is not None and not set(names) & set(BUILT_IN):
        raise BridgeError(
            "--mavlink-key signs MAVLink, and no such bridge is open: --bridge mavlink"
        )
    heeds_silence = any(name in _EXTERNAL_AUTOPILOTS for name in names)
    waits_otherwise = options.autopilot_timeout_s != RunOptions.autopilot_timeout_s
    if (options.drop_on_timeout or waits_otherwise) and not heeds_silence:
        raise BridgeError(
            "--autopilot-timeout and --drop-on-timeout are for external autopilots; none of their "
            f"bridges is open: --bridge {', '.join(_EXTERNAL_AUTOPILOTS)}"
        )
    domains = [text for text in options.bridges if text.partition("=")[0] in _ROS2]
    if options.domain_id is not None and all(text.startswith("ros2=") for text in domains):
        rule = (
            f"{', '.join(domains)} has its own" if domains else "no bridge to ROS 2 is open: --ros2"
        )
        raise BridgeError(f"--domain-id {options.domain_id}: {rule}")
    if options.interfaces and "ros2" not in names:
        raise BridgeError(
            "--ros2-interface is for ROS 2 over DDS, and no such bridge is open: --ros2"
        )


def token_gaps(options: RunOptions) -> list[str]:
    """Returns a warning for each bridge whose protocol cannot ask for the token."""
    if options.token is None:
        return []
    return [
        f"--bridge {text}: its protocol carries no token. Every program that reaches its port "
        f"commands the UAVs: {_remedy(text.partition('=')[0])}"
        for text in options.bridges
        if text.partition("=")[0] in _WITHOUT_TOKEN
        and not (text.partition("=")[0] in _BY_SIGNING and options.mavlink_key is not None)
    ]


def _remedy(name: str) -> str:
    if name in _BY_SIGNING:
        return "sign its frames with --mavlink-key"
    if name in _ROS2:
        return "use --bridge rosbridge, or let ROS 2's own security (SROS 2) guard the domain"
    return (
        "use --bridge rosbridge, which asks for it, or keep the port on this machine and let "
        "remote programs in by an SSH tunnel"
    )


def check_autopilots(scenario: Scenario, options: RunOptions) -> None:
    """Raises `BridgeError` if both the scenario and a bridge give a UAV an autopilot."""
    from volery.mavlink.scenario_setup import NODE
    from volery.scenario.node_names import is_same_node

    external = [name for name in _names(options) if name in _EXTERNAL_AUTOPILOTS]
    used = {group.type for group in scenario.uavs}
    for name, uav_type in scenario.types.items():
        has_own = any(is_same_node(entry.node, NODE) for entry in uav_type.nodes)
        if external and name in used and has_own:
            raise BridgeError(
                f"scenario '{scenario.name}', type '{name}': has an autopilot of its own "
                f"({NODE}); --bridge {external[0]} would bring a second one"
            )


def _check_autopilots(names: list[str]) -> None:
    built_in = next((name for name in names if name in BUILT_IN), None)
    external = [name for name in names if name in _EXTERNAL_AUTOPILOTS]
    if built_in is not None and external:
        raise BridgeError(
            f"--bridge {built_in} and --bridge {external[0]} would give each UAV two autopilots; "
            f"the one at {external[0]} speaks MAVLink by itself, at its own ports"
        )
    every = next((name for name in external if name in _EVERY), None)
    if every is not None and len(external) > 1:
        raise BridgeError(
            f"--bridge {' and --bridge '.join(external)} would give UAVs two autopilots: "
            f"{every} serves all of them"
        )


def _names(options: RunOptions) -> list[str]:
    return [text.partition("=")[0] for text in options.bridges]
