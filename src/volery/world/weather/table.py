"""A weather for kernels: one record, with the nodes of its field as an array."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.scenario.wind import MAX_GUSTS
from volery.world.weather.mean_wind import FIELD, LOG, POWER, UNIFORM
from volery.world.weather.model import Gust, LogProfile, PowerProfile, Weather
from volery.world.weather.particles import rain_speed

AIR = np.dtype(
    [
        ("kind", "i8"),  # of the mean wind
        ("steady", "i8"),  # uniform and constant wind
        ("velocity", "f8", 3),
        ("profile_shape", "f8"),
        ("profile_scale", "f8"),
        ("field_origin", "f8", 3),
        ("field_inverse_spacing", "f8", 3),
        ("w20", "f8"),
        ("rain_water", "f8"),  # kg of falling water in a m^3 of air
        ("rain_speed", "f8"),  # fall speed of rain
        ("gusts", "i8"),
        ("gust_amplitude", "f8", (MAX_GUSTS, 3)),
        ("gust_slowness", "f8", (MAX_GUSTS, 3)),  # delay per distance along x, y, z, s/m
        ("gust_start", "f8", MAX_GUSTS),
        ("gust_length", "f8", MAX_GUSTS),  # s from start to end
        ("gust_inverse_rise", "f8", MAX_GUSTS),  # 1/s
    ],
    align=True,
)
"""One weather: SI, map."""


def air_of(weather: Weather) -> NDArray[np.void]:
    """Returns the (1,) `AIR` row of a weather."""
    row = np.zeros(1, AIR)
    row["kind"] = UNIFORM
    row["velocity"] = weather.velocity_map
    row["w20"] = weather.w20_m_s
    row["gusts"] = len(weather.gusts)
    rain = weather.particles.rain_mm_h
    if rain > 0.0:
        row["rain_speed"] = rain_speed(rain)
        row["rain_water"] = rain / 3600.0 / row["rain_speed"]  # 1 mm is 1 kg/m^2
    for g, gust in enumerate(weather.gusts):
        _write_gust(row, g, gust)
    profile, field = weather.profile, weather.field
    if isinstance(profile, LogProfile):
        row["kind"] = LOG
        row["profile_shape"] = profile.roughness_m
        row["profile_scale"] = 1.0 / math.log(profile.reference_height_m / profile.roughness_m)
    elif isinstance(profile, PowerProfile):
        row["kind"] = POWER
        row["profile_shape"] = profile.exponent
        row["profile_scale"] = 1.0 / profile.reference_height_m
    elif field is not None:
        row["kind"] = FIELD
        row["field_origin"] = field.origin_map
        row["field_inverse_spacing"] = 1.0 / np.array(field.spacing_m)
    row["steady"] = row["kind"] == UNIFORM and not weather.gusts and weather.w20_m_s == 0.0
    return row


def _write_gust(row: NDArray[np.void], g: int, gust: Gust) -> None:
    row["gust_amplitude"][0, g] = gust.amplitude_map
    row["gust_start"][0, g] = gust.start_s
    row["gust_length"][0, g] = gust.end_s - gust.start_s
    row["gust_inverse_rise"][0, g] = 1.0 / gust.rise_s
    if gust.has_front:
        front = np.array(gust.front_velocity_map)
        row["gust_slowness"][0, g] = front / (front @ front)
