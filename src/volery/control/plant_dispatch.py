"""One step of a UAV whose plant is not the rigid body."""

from __future__ import annotations

from typing import Any

from volery.control.estimated_state import believe_attitude, believe_position
from volery.control.flight_modes import guide
from volery.control.kinematic_flight import fly_kinematic
from volery.control.setpoints import ControlLevel
from volery.vehicle.compiled import apart_kernel
from volery.vehicle.contact import NO_TOUCH
from volery.vehicle.identified import accelerate_identified
from volery.vehicle.plant_types import KINEMATIC_MOTION
from volery.vehicle.rigid_body_kernels import carry, meet_ground, near_ground

_STOPPED = int(ControlLevel.STOPPED)


@apart_kernel
def fly_otherwise(
    body: Any,
    control_state: Any,
    belief: Any,
    model: Any,
    references: Any,
    i: int,
    now: int,
    paths: Any,
    grid: Any,
    steepest: float,
    bounce: bool,
    scratch: Any,
    step: int,
    guiding: bool,
    dt: float,
) -> int:
    """Computes control and motion of an identified or kinematic plant; returns its ground contact.

    model: a `fused_step.MODEL` row. references, i, now: see `vehicle.identified`.
    """
    plant, gains = model.plant, model.gains
    if model.kind == KINEMATIC_MOTION:
        kinematic = model.kinematic
        return fly_kinematic(
            body,
            control_state,
            belief,
            plant,
            kinematic,
            gains,
            paths,
            grid,
            steepest,
            step,
            guiding,
            dt,
        )
    if guiding:
        believe_position(belief, body)
        believe_attitude(belief, body, control_state.errs)
        guide(control_state, belief, gains, paths, step, dt)
    live = control_state.level != _STOPPED
    accelerate_identified(
        body, plant, model.identified, control_state, live, references, i, now, dt
    )
    touch = NO_TOUCH
    if near_ground(body, dt):
        touch = meet_ground(
            body, plant, control_state, grid, steepest, bounce, scratch, step + 1, dt
        )
    carry(body, dt)
    return touch
