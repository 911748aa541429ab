"""Serves the feature list of this simulator, by the standard."""

from __future__ import annotations

from collections.abc import Collection
from enum import IntEnum

import numpy as np

from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.runtime.services.results import filled

_SRV = "simulation_interfaces/srv/GetSimulatorFeatures"


class Feature(IntEnum):
    """Lists the supported values of `simulation_interfaces/msg/SimulatorFeatures`."""

    SPAWNING = 0
    DELETING = 1
    NAMED_POSES = 2
    POSE_BOUNDS = 3
    ENTITY_TAGS = 4
    ENTITY_BOUNDS = 5
    ENTITY_BOUNDS_BOX = 6
    ENTITY_CATEGORIES = 8
    ENTITY_STATE_GETTING = 10
    ENTITY_STATE_SETTING = 11
    ENTITY_INFO_GETTING = 12
    SPAWNABLES = 14
    SIMULATION_RESET = 20
    SIMULATION_RESET_TIME = 21
    SIMULATION_RESET_STATE = 22
    SIMULATION_RESET_SPAWNED = 23
    SIMULATION_STATE_GETTING = 24
    SIMULATION_STATE_SETTING = 25
    SIMULATION_STATE_PAUSE = 26
    STEP_SIMULATION_SINGLE = 31
    STEP_SIMULATION_MULTIPLE = 32
    STEP_SIMULATION_ACTION = 33
    WORLD_LOADING = 40
    WORLD_TAGS = 42
    WORLD_UNLOADING = 43
    WORLD_INFO_GETTING = 44
    AVAILABLE_WORLDS = 45
    SPAWNING_ENTITIES = 50


_ON_CONDITION = {Feature.WORLD_LOADING, Feature.WORLD_UNLOADING}


PLAYER_FEATURES = frozenset(
    {
        Feature.SIMULATION_STATE_GETTING,
        Feature.SIMULATION_STATE_SETTING,
        Feature.SIMULATION_STATE_PAUSE,
        Feature.STEP_SIMULATION_SINGLE,
        Feature.STEP_SIMULATION_MULTIPLE,
        Feature.WORLD_LOADING,
        Feature.WORLD_TAGS,
        Feature.WORLD_UNLOADING,
        Feature.WORLD_INFO_GETTING,
        Feature.AVAILABLE_WORLDS,
    }
)
"""Features that the playback of a log supports."""


def offer_features(
    graph: Graph, *, loads_worlds: bool, offered: Collection[Feature] = tuple(Feature)
) -> None:
    """Creates `/get_simulator_features`."""
    features = [f for f in Feature if f in offered and (f not in _ON_CONDITION or loads_worlds)]
    message = filled(
        "simulation_interfaces/msg/SimulatorFeatures",
        {
            "features": np.array(features, dtype=np.uint16),
            "custom_info": "Volery: entities are UAVs and actors, worlds are scenarios, "
            "/volery/* services extend the standard",
        },
    )
    response = message_type(f"{_SRV}_Response")
    graph.create_service(
        "/get_simulator_features", _SRV, lambda _request: response(features=message)
    )
