"""Scenarios as data: the schema, the loader, the shipped scenarios.

The tables of a scenario are classes, for scenarios in Python:

    from volery.scenario import ImuSensor, Scenario, UavGroup, UavType, Wind, World

    scenario = Scenario(
        name="windy",
        world=World(wind=Wind(velocity_m_s=(4.0, 0.0, 0.0), turbulence="moderate")),
        types={"iris": UavType(airframe="iris", sensors=(ImuSensor(),))},
        uavs=(UavGroup(type="iris", position_m=(0.0, 0.0, 20.0)),),
    )

They are validated as TOML is, by the same code; `scenario.save("windy.toml")` writes the file.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.scenario.actors import (
        Actor,
        AprilTag,
        AttachedActor,
        CircleActor,
        ExternalActor,
        WaypointActor,
    )
    from volery.scenario.camera import CameraSensor, Daylight, Stereo
    from volery.scenario.city import City, Streets
    from volery.scenario.expectations import (
        AreaExpectation,
        ArrivalExpectation,
        BatteryExpectation,
        ClearanceExpectation,
        ContactFreeExpectation,
        CrashFreeExpectation,
        EstimateErrorExpectation,
        FormulaExpectation,
        LimitsExpectation,
        LogMessageExpectation,
        ModesExpectation,
        NeesExpectation,
        PredicateExpectation,
        RealTimeFactorExpectation,
        SeparationExpectation,
        SpeedExpectation,
        TopicRateExpectation,
        TopicValueExpectation,
    )
    from volery.scenario.faults import (
        DisplacementFault,
        GnssFault,
        GustFault,
        JammingFault,
        MotorFault,
        RadioFault,
        SensorFault,
    )
    from volery.scenario.formations import at_positions, circle, grid
    from volery.scenario.grid_map import GridMapFile, GridMapWorld
    from volery.scenario.load import list_scenarios, load_scenario, parse_scenario
    from volery.scenario.navigation import (
        BarometerSensor,
        DeniedBox,
        DeniedPolygon,
        GnssSensor,
        MagneticField,
        MagnetometerSensor,
        Origin,
    )
    from volery.scenario.radio import Radio, RelayedTopic
    from volery.scenario.schema import Physics, Scenario
    from volery.scenario.sensors import (
        BatterySensor,
        EstimateSensor,
        ExternalOdometrySource,
        GroundTruthSensor,
        ImuSensor,
        LidarSensor,
        Nodding,
        OdometrySensor,
        SonarSensor,
    )
    from volery.scenario.uavs import (
        Flight,
        KinematicMotion,
        NodeEntry,
        RotorWear,
        UavGroup,
        UavType,
    )
    from volery.scenario.user_mesh import UserMesh
    from volery.scenario.weather import Weather
    from volery.scenario.wind import Gust, LogProfile, PowerProfile, Wind
    from volery.scenario.world import (
        FlatTerrain,
        GridTerrain,
        InventoryForest,
        ProceduralForest,
        World,
    )

_NAMES = {
    "actors": (
        "Actor",
        "AprilTag",
        "AttachedActor",
        "CircleActor",
        "ExternalActor",
        "WaypointActor",
    ),
    "camera": ("CameraSensor", "Daylight", "Stereo"),
    "city": ("City", "Streets"),
    "expectations": (
        "AreaExpectation",
        "ArrivalExpectation",
        "BatteryExpectation",
        "ClearanceExpectation",
        "ContactFreeExpectation",
        "CrashFreeExpectation",
        "EstimateErrorExpectation",
        "FormulaExpectation",
        "LimitsExpectation",
        "LogMessageExpectation",
        "ModesExpectation",
        "NeesExpectation",
        "PredicateExpectation",
        "RealTimeFactorExpectation",
        "SeparationExpectation",
        "SpeedExpectation",
        "TopicRateExpectation",
        "TopicValueExpectation",
    ),
    "faults": (
        "DisplacementFault",
        "GnssFault",
        "GustFault",
        "JammingFault",
        "MotorFault",
        "RadioFault",
        "SensorFault",
    ),
    "formations": ("at_positions", "circle", "grid"),
    "grid_map": ("GridMapFile", "GridMapWorld"),
    "load": ("list_scenarios", "load_scenario", "parse_scenario"),
    "navigation": (
        "BarometerSensor",
        "DeniedBox",
        "DeniedPolygon",
        "GnssSensor",
        "MagneticField",
        "MagnetometerSensor",
        "Origin",
    ),
    "radio": ("Radio", "RelayedTopic"),
    "schema": ("Physics", "Scenario"),
    "sensors": (
        "BatterySensor",
        "EstimateSensor",
        "ExternalOdometrySource",
        "GroundTruthSensor",
        "ImuSensor",
        "LidarSensor",
        "Nodding",
        "OdometrySensor",
        "SonarSensor",
    ),
    "uavs": ("Flight", "KinematicMotion", "NodeEntry", "RotorWear", "UavGroup", "UavType"),
    "user_mesh": ("UserMesh",),
    "weather": ("Weather",),
    "wind": ("Gust", "LogProfile", "PowerProfile", "Wind"),
    "world": ("FlatTerrain", "GridTerrain", "InventoryForest", "ProceduralForest", "World"),
}
_MODULES = {name: f"volery.scenario.{module}" for module, names in _NAMES.items() for name in names}

__all__ = [
    "Actor",
    "AprilTag",
    "AreaExpectation",
    "ArrivalExpectation",
    "AttachedActor",
    "BarometerSensor",
    "BatteryExpectation",
    "BatterySensor",
    "CameraSensor",
    "CircleActor",
    "City",
    "ClearanceExpectation",
    "ContactFreeExpectation",
    "CrashFreeExpectation",
    "Daylight",
    "DeniedBox",
    "DeniedPolygon",
    "DisplacementFault",
    "EstimateErrorExpectation",
    "EstimateSensor",
    "ExternalActor",
    "ExternalOdometrySource",
    "FlatTerrain",
    "Flight",
    "FormulaExpectation",
    "GnssFault",
    "GnssSensor",
    "GridMapFile",
    "GridMapWorld",
    "GridTerrain",
    "GroundTruthSensor",
    "Gust",
    "GustFault",
    "ImuSensor",
    "InventoryForest",
    "JammingFault",
    "KinematicMotion",
    "LidarSensor",
    "LimitsExpectation",
    "LogMessageExpectation",
    "LogProfile",
    "MagneticField",
    "MagnetometerSensor",
    "ModesExpectation",
    "MotorFault",
    "NeesExpectation",
    "Nodding",
    "NodeEntry",
    "OdometrySensor",
    "Origin",
    "Physics",
    "PowerProfile",
    "PredicateExpectation",
    "ProceduralForest",
    "Radio",
    "RadioFault",
    "RealTimeFactorExpectation",
    "RelayedTopic",
    "RotorWear",
    "Scenario",
    "SensorFault",
    "SeparationExpectation",
    "SonarSensor",
    "SpeedExpectation",
    "Stereo",
    "Streets",
    "TopicRateExpectation",
    "TopicValueExpectation",
    "UavGroup",
    "UavType",
    "UserMesh",
    "WaypointActor",
    "Weather",
    "Wind",
    "World",
    "at_positions",
    "circle",
    "grid",
    "list_scenarios",
    "load_scenario",
    "parse_scenario",
]


def __getattr__(name: str) -> Any:
    """Imports a name when it is used."""
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'volery.scenario' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
