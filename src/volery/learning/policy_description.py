"""Describes the policies of a task, for their files."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from volery.autonomy.policy.description import (
    ActionPart,
    NetworkDescription,
    ObservationPart,
    PolicyDescription,
    TrainingRecord,
)
from volery.learning.actions import Action
from volery.learning.task import Task
from volery.vehicle.airframe import Airframe, hover_thrusts, load_airframe

_LEVELS_BELOW_VELOCITY = ("attitude_thrust", "rates_thrust", "rotor_speeds")


def describe(
    task: Task,
    network: NetworkDescription | None = None,
    training: TrainingRecord | None = None,
) -> PolicyDescription:
    """Returns the description of a policy of `task`.

    network: by default an MLP with tanh, whose output fits the action.
    """
    scenario = task.scenario()
    airframe = load_airframe(scenario.types[scenario.uavs[0].type].airframe)
    if network is None:
        is_continuous = task.action.choices is None
        network = NetworkDescription(output="clip" if is_continuous else "argmax")
    return PolicyDescription(
        task=task.name,
        airframe=airframe.name,
        observation=tuple(
            ObservationPart(
                name=part.name,
                size=part.size,
                history=part.history,
                unit=part.unit,
                scale=part.scale,
                limit=part.limit,
                parameters=dict(part.parameters),
            )
            for part in task.observations
        ),
        action=_action(task.action, airframe),
        decision_rate_hz=task.decision_rate_hz,
        action_latency_s=float(np.max(task.action_latency_s)),
        network=network,
        training=training or TrainingRecord(),
    )


def _action(action: Action, airframe: Airframe) -> ActionPart:
    parameters: dict[str, Any] = asdict(action)  # type: ignore[call-overload]  # a dataclass
    if action.kind in _LEVELS_BELOW_VELOCITY:
        fractions = hover_thrusts(airframe) / airframe.max_rotor_thrust
        max_thrust = len(fractions) * airframe.max_rotor_thrust
        parameters["hover_thrust_fraction"] = airframe.weight / max_thrust
        parameters["hover_speed_fractions"] = np.sqrt(fractions).tolist()
    return ActionPart(
        kind=action.kind, size=action.size, choices=action.choices, parameters=parameters
    )
