"""Defines the bridges of this package; `pyproject.toml` gives them their names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.graph.bridge_kind import Address, Bridge, BridgeKind, BridgeOptions

if TYPE_CHECKING:
    from volery.mavlink.hil.lock_step import TimeoutPolicy


def _mavlink(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.links.udp_bridge import MavlinkUdp

    return MavlinkUdp(*address, anywhere=options.allow_remote, key=_key_of(options))


def _mavlink_tcp(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.links.tcp_bridge import MavlinkTcp

    return MavlinkTcp(*address, anywhere=options.allow_remote, key=_key_of(options))


def _mavlink_serial(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.links.serial_bridge import MavlinkSerial

    return MavlinkSerial(*address, key=_key_of(options))


def _px4(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.hil.px4_bridge import Px4Bridge

    return Px4Bridge(
        *address,
        timeout_policy=_timeout_policy_of(options),
        anywhere=options.allow_remote,
        notice_s=_notice_of(options),
    )


def _px4_serial(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.hil.px4_serial_bridge import Px4SerialBridge

    return Px4SerialBridge(
        *address, timeout_policy=_timeout_policy_of(options), notice_s=_notice_of(options)
    )


def _ardupilot(address: Address, options: BridgeOptions) -> Bridge:
    from volery.mavlink.hil.ardupilot_bridge import ArdupilotBridge

    return ArdupilotBridge(
        *address,
        timeout_policy=_timeout_policy_of(options),
        anywhere=options.allow_remote,
        notice_s=_notice_of(options),
    )


def _timeout_policy_of(options: BridgeOptions) -> TimeoutPolicy:
    from volery.mavlink.hil.lock_step import TimeoutPolicy

    return TimeoutPolicy(options.autopilot_timeout_s, options.drop_on_timeout)


def _notice_of(options: BridgeOptions) -> float | None:
    from volery.mavlink.hil.connection_notice import NOTICE_S

    return NOTICE_S if options.reports_missing_autopilots else None


def _key_of(options: BridgeOptions) -> bytes | None:
    if options.mavlink_key is None:
        return None
    from volery.mavlink.links.signing import key_of

    return key_of(options.mavlink_key)


MAVLINK = BridgeKind(14540, _mavlink)
MAVLINK_TCP = BridgeKind(5760, _mavlink_tcp)
MAVLINK_SERIAL = BridgeKind(57600, _mavlink_serial, is_serial=True)
PX4 = BridgeKind(4560, _px4)
PX4_SERIAL = BridgeKind(921600, _px4_serial, is_serial=True)
ARDUPILOT = BridgeKind(9002, _ardupilot)
