"""Builds the map's geographic frame, magnetic field and GNSS denial of a scenario."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.geodesy import LocalFrame
from volery.scenario.navigation import DeniedBox, DeniedPolygon
from volery.scenario.schema import World
from volery.sensors.gnss_denial import GnssDenial, Prism
from volery.world.magnetic_field import angles_of_field, field_enu, field_of_angles


def local_frame(world: World) -> LocalFrame:
    """Returns the map as a local frame on the earth."""
    origin = world.origin
    return LocalFrame.from_degrees(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)


def magnetic_field_map(world: World) -> NDArray[np.float64]:
    """Returns the field in the map frame (3,), T: the scenario's, by default the earth's."""
    wanted = world.magnetic_field
    declination, inclination, strength = angles_of_field(field_enu(local_frame(world)))
    if wanted.declination_deg is not None:
        declination = math.radians(wanted.declination_deg)
    if wanted.inclination_deg is not None:
        inclination = math.radians(wanted.inclination_deg)
    if wanted.strength_ut is not None:
        strength = wanted.strength_ut * 1e-6
    return field_of_angles(declination, inclination, strength)


def denial(world: World) -> GnssDenial:
    """Returns the areas in which the scenario denies satellite signals."""
    return GnssDenial(world.gnss_denied, tuple(_prism(area) for area in world.gnss_denied_areas))


def _prism(area: DeniedBox | DeniedPolygon) -> Prism:
    return Prism(np.array(area.corners_m), *(area.height_m or ()))
