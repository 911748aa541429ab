"""`volery px4`: runs PX4s for a simulation elsewhere until Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from volery.cli.interrupt import StopSignals
from volery.cli.terminal import echo_line
from volery.core.errors import BridgeError
from volery.mavlink.hil.px4_parameters import Px4Airframe, Px4Rotor, px4_parameters
from volery.mavlink.hil.px4_processes import Px4Instances, find_px4

if TYPE_CHECKING:
    from volery.vehicle.airframe import Airframe

_LOOK_S = 0.5


def run_px4(
    px4_dir: Path,
    count: int,
    *,
    first: int,
    host: str,
    folder: Path | None,
    speed: float | None,
    airframe: str | None = None,
) -> None:
    """Runs instances until a signal; raises `BridgeError` if an instance cannot start or exits.

    airframe: name or file of the airframe of all instances; None: PX4's Iris.
    """
    ended = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        if ended.is_set():
            raise KeyboardInterrupt
        ended.set()

    build = find_px4(px4_dir)
    parameters = [] if airframe is None else [_parameters_of(airframe)] * count
    with (
        StopSignals(end),
        Px4Instances(
            build,
            count,
            first=first,
            host=host,
            folder=folder,
            speed=speed,
            parameters=parameters,
        ) as instances,
    ):
        last = first + count - 1
        echo_line(f"started {build.binary}, instances {first} to {last}; Ctrl-C ends them")
        while not ended.is_set() and not instances.wait(_LOOK_S):
            pass
        if instances.failure is not None:
            raise BridgeError(instances.failure)


def parameters_for(airframe: Airframe) -> Mapping[str, float]:
    """Returns PX4's parameters for an airframe.

    Raises `BridgeError` if PX4 cannot fly the airframe.
    """
    import numpy as np

    from volery.vehicle.airframe import hover_thrusts

    rotors = airframe.rotors
    speeds = np.sqrt(hover_thrusts(airframe) / rotors.thrust_n_s2)
    return px4_parameters(
        Px4Airframe(
            [Px4Rotor(rotor.position_m, rotor.axis, rotor.direction) for rotor in rotors.places],
            rotors.torque_m,
            float(speeds.mean()) / rotors.max_speed_rad_s,
            airframe.limits.tilt_deg,
        )
    )


def _parameters_of(name: str) -> Mapping[str, float]:
    from volery.vehicle.airframe import load_airframe

    return parameters_for(load_airframe(name))
