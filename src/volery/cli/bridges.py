"""Opens the bridges of a run's `RunOptions`."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from volery.cli.bridge_checks import BUILT_IN, check_autopilots
from volery.cli.flight import RunOptions
from volery.cli.terminal import echo_line
from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.bridges.bridge_factory import Bridge, BridgeOptions
    from volery.graph.session import Gateway
    from volery.mavlink.hil.px4_bridge import Px4Bridge
    from volery.mavlink.hil.px4_processes import Px4Instances
    from volery.runtime.vehicles.uav import Uav
    from volery.scenario.schema import Scenario

_START_TIMEOUT_S = 60.0
"""Wall time within which all PX4 instances must connect."""
_LOOK_S = 0.05


def fit_out(scenario: Scenario, options: RunOptions) -> Scenario:
    """Returns the scenario with the autopilots or sensors that the bridges of `options` need."""
    if options.px4_dir is not None:
        from volery.mavlink.hil.px4_processes import find_px4

        find_px4(options.px4_dir)  # reports a wrong folder before anything is built
    check_autopilots(scenario, options)
    names = {text.partition("=")[0] for text in options.bridges}
    if names & set(BUILT_IN):
        from volery.mavlink.scenario_setup import with_autopilots

        scenario = with_autopilots(scenario)
    if names & {"px4", "px4-serial"}:
        from volery.mavlink.scenario_setup import with_px4

        scenario = with_px4(scenario)
    if "ardupilot" in names:
        from volery.mavlink.scenario_setup import with_ardupilot

        scenario = with_ardupilot(scenario)
    return scenario


@contextmanager
def open_bridges(
    gateway: Gateway, options: RunOptions, uavs: Mapping[str, Uav] | None = None
) -> Iterator[None]:
    """Opens the bridges of `options`, prints their addresses and closes them on exit.

    uavs: the UAVs for which PX4s run if `options` has a PX4 folder.
    """
    if not options.bridges:
        yield
        return
    from volery.bridges.bridge_factory import make_bridge
    from volery.bridges.bridge_host import BridgeHost

    bridge_options = _bridge_options(options)
    wanted = [make_bridge(text, bridge_options) for text in options.bridges]
    with BridgeHost(gateway) as bridges:
        for bridge in wanted:
            bridges.open(bridge)
            echo_line(f"open    {bridge.name}", err=True)
        gateway.use_low_latency()
        with _px4_instances(uavs or {}, wanted, options):
            yield


def _bridge_options(options: RunOptions) -> BridgeOptions:
    from volery.bridges.bridge_factory import BridgeOptions

    return BridgeOptions(
        allow_remote=options.allow_remote,
        token=options.token,
        origins=options.origins,
        report=lambda text: echo_line(text, err=True),
        domain_id=options.domain_id,
        interfaces=options.interfaces,
        mavlink_key=options.mavlink_key,
        autopilot_timeout_s=options.autopilot_timeout_s,
        drop_on_timeout=options.drop_on_timeout,
        reports_missing_autopilots=options.px4_dir is None,  # else `_px4_instances` does
    )


@contextmanager
def _px4_instances(
    uavs: Mapping[str, Uav], bridges: list[Bridge], options: RunOptions
) -> Iterator[None]:
    """Runs a PX4 for each UAV if `options` has a PX4 folder; waits until all are connected."""
    if options.px4_dir is None or not uavs:
        yield
        return
    from volery.cli.px4 import parameters_for
    from volery.mavlink.hil.px4_bridge import Px4Bridge
    from volery.mavlink.hil.px4_processes import Px4Instances, find_px4

    build, count = find_px4(options.px4_dir), len(uavs)
    parameters = [parameters_for(uav.airframe) for uav in uavs.values()]
    bridge = next(bridge for bridge in bridges if isinstance(bridge, Px4Bridge))
    with Px4Instances(build, count, speed=options.speed, parameters=parameters) as instances:
        echo_line(f"started {build.binary}, instances 0 to {count - 1}", err=True)
        end_s = time.monotonic() + _START_TIMEOUT_S
        while len(bridge.connected) < count:
            if instances.wait(_LOOK_S) or time.monotonic() > end_s:
                raise BridgeError(instances.failure or _missing(uavs, bridge, instances))
        yield


def _missing(names: Iterable[str], bridge: Px4Bridge, instances: Px4Instances) -> str:
    """Returns an error text with the missing PX4s, their addresses and last output."""
    return "\n  ".join(
        f"{uav}: PX4 {number} has not connected to {bridge.address(number)} within "
        f"{_START_TIMEOUT_S:g} s; last output:{instances.output_of(number) or ' nothing'}"
        for number, uav in enumerate(names)
        if uav not in bridge.connected
    )
