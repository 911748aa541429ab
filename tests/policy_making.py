"""Makes small policies with random weights for tests."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from volery.autonomy.policy.policy_file import Policy, make_policy

Arrays = dict[str, Any]


def mlp(name: str, sizes: list[int], rng: np.random.Generator) -> Arrays:
    """Returns the arrays of a network of these layer sizes."""
    arrays: Arrays = {}
    for k, (size, out) in enumerate(pairwise(sizes)):
        arrays[f"{name}.{k}.weight"] = rng.normal(0.0, size**-0.5, (out, size))
        arrays[f"{name}.{k}.bias"] = rng.normal(0.0, 0.1, out)
    return arrays


def description(**changes: Any) -> dict[str, Any]:
    """Returns the description of a policy that observes goal and velocity."""
    return {
        "format": 1,
        "task": "homing",
        "airframe": "f450",
        "observation": [
            {"name": "goal_heading", "size": 3, "unit": "m", "scale": 3.0},
            {"name": "velocity_heading", "size": 3, "unit": "m/s"},
        ],
        "action": {
            "kind": "velocity",
            "size": 4,
            "parameters": {"speed_m_s": 3.0, "yaw_rate_rad_s": 1.0},
        },
        "decision_rate_hz": 5.0,
        **changes,
    }


def small_policy(seed: int = 0, **changes: Any) -> Policy:
    """Returns a policy with 6 inputs, 4 outputs and a value, changed by keys of its description."""
    rng = np.random.default_rng(seed)
    return make_policy(
        description(**changes), mlp("policy", [6, 8, 4], rng) | mlp("value", [6, 8, 1], rng)
    )


def image_arrays(rng: np.random.Generator) -> Arrays:
    """Returns two convolutions of a part `depth` of 2 channels, 12 x 16 pixels."""
    return {
        "image.depth.0.weight": rng.normal(0.0, 0.2, (4, 2, 4, 5)),
        "image.depth.0.bias": rng.normal(0.0, 0.1, 4),
        "image.depth.1.weight": rng.normal(0.0, 0.2, (3, 4, 2, 3)),
        "image.depth.1.bias": rng.normal(0.0, 0.1, 3),
    }


def image_policy(seed: int = 0) -> Policy:
    """Returns a policy that observes 3 numbers, an image (2, 12, 16) and 2 numbers."""
    rng = np.random.default_rng(seed)
    parts = [("goal_heading", 3), ("depth", 2 * 12 * 16), ("tail", 2)]
    described = description(
        observation=[{"name": name, "size": size} for name, size in parts],
        network={"images": [{"part": "depth", "shape": [2, 12, 16], "strides": [2, 1]}]},
    )
    return make_policy(described, image_arrays(rng) | mlp("policy", [5 + 3 * 4 * 4, 8, 4], rng))


def chasing_policy(**changes: Any) -> Policy:
    """Returns a policy of the homing task, without training.

    It flies along the axis of the largest distance to the goal, less a part of the velocity.
    """
    weight = np.zeros((7, 6))
    for axis in range(3):
        for sign, row in ((1.0, 1 + 2 * axis), (-1.0, 2 + 2 * axis)):
            weight[row, axis], weight[row, 3 + axis] = 3.0 * sign, -0.5 * sign
    bias = np.array([0.15, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    described = description(
        action={
            "kind": "discrete_velocity",
            "size": 1,
            "choices": 7,
            "parameters": {"speed_m_s": 1.0},
        },
        network={"output": "argmax"},
        **changes,
    )
    return make_policy(described, {"policy.0.weight": weight, "policy.0.bias": bias})


def low_level_policy(kind: str, *, output: float = 0.5) -> Policy:
    """Returns a policy of constant output that commands attitudes, rates or rotors."""
    parameters = {
        "attitude_thrust": {"tilt_rad": 0.5, "yaw_rate_rad_s": 1.0, "hover_thrust_fraction": 0.4},
        "rates_thrust": {"rate_rad_s": 4.0, "hover_thrust_fraction": 0.4},
        "rotor_speeds": {"hover_speed_fractions": [0.6, 0.6, 0.7, 0.7]},
    }[kind]
    described = description(action={"kind": kind, "size": 4, "parameters": parameters})
    zeros = {"policy.0.weight": np.zeros((4, 6)), "policy.0.bias": np.full(4, output)}
    return make_policy(described, zeros)
