"""Twenty UAVs swap their positions across a circle, in eight environments at once, in wind."""

import numpy as np

from volery import VectorizedSimulation
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.orca import Orca
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario

ENVIRONMENTS, UAVS, RADIUS_M, SPEED_M_S, PERIOD_S = 8, 20, 15.0, 3.0, 0.05
SCENARIO = {
    "name": "swap",
    "world": {"wind": {"velocity_m_s": [2.0, 1.0, 0.0], "turbulence": "light"}},
    "types": {"scout": {"airframe": "f450"}},
    "uavs": [
        {"type": "scout", "position_m": [float(3 * k), 0.0, 10.0], "count": 1} for k in range(UAVS)
    ],
}

turn = 2.0 * np.pi * np.arange(UAVS) / UAVS
circle = RADIUS_M * np.stack([np.cos(turn), np.sin(turn)], axis=1)
start = np.concatenate([circle, np.full((UAVS, 1), 10.0)], axis=1)
apart = 1000.0 * np.arange(ENVIRONMENTS)[:, None, None]  # environments do not avoid each other
behaviour, around = Orca(), Surroundings()

with VectorizedSimulation(parse_scenario(SCENARIO), ENVIRONMENTS) as envs:
    envs.reset(start=EnvironmentStart(start))
    least = np.full(ENVIRONMENTS, np.inf)
    while envs.time_s < 60.0:
        state = envs.state()
        position, velocity = state.position_map[..., :2], state.velocity_map[..., :2]
        way = -circle - position
        distance = np.linalg.norm(way, axis=-1, keepdims=True)
        if distance.max() < 0.5:
            break
        preferred = way / distance * np.minimum(SPEED_M_S, 0.8 * distance)
        flock = flock_within(
            (position + apart).reshape(-1, 2), velocity.reshape(-1, 2), behaviour.radius_m
        )
        level = behaviour.velocities(flock, preferred.reshape(-1, 2), around)
        climb = 10.0 - state.position_map[..., 2:]
        envs.command_velocity_map(np.concatenate([level.reshape(way.shape), climb], axis=-1))
        envs.run(PERIOD_S)
        between = np.linalg.norm(position[:, :, None] - position[:, None], axis=-1)
        between[:, np.arange(UAVS), np.arange(UAVS)] = np.inf
        least = np.minimum(least, between.min(axis=(1, 2)))
    print(f"after {envs.time_s:.1f} s all but {(distance > 0.5).sum()} UAVs have arrived")
    print(f"least distances: {least.round(2)} m; {envs.state().crashed.sum()} UAVs crashed")
