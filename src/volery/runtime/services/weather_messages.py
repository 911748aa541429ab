"""Converts the weather to messages, and messages and requests to a weather."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import Published, Vector3, header, message_type
from volery.runtime.construction.worlds import sun_in
from volery.scenario.schema import World
from volery.world.weather import Gust, LogProfile, Weather

_TYPE = "volery_interfaces/msg/Weather"
_SETTABLE = ("wind", "w20", "rain", "snow", "fog_visibility", "dust_visibility", "hour_of_day")
_PARTICLES = {
    "rain": "rain_mm_h",
    "snow": "snow_mm_h",
    "fog_visibility": "fog_visibility_m",
    "dust_visibility": "dust_visibility_m",
}


class WeatherTopics:
    """Publishes the weather on `/weather`, latched; subscribes to `/weather_command`.

    The message holds everything that can be set while running: a log's `/weather`, played back
    into `/weather_command`, sets the same weather at the same times. Invalid commands are refused
    (`Graph.refuse`).
    """

    def __init__(
        self,
        graph: Graph,
        world: World,
        present: Callable[[], Weather],
        set_weather: Callable[[Weather], None],
    ) -> None:
        self._graph = graph
        self._world = world
        self._weather = graph.advertise("/weather", _TYPE, latched=True)

        def take(published: Published) -> None:
            message = published.message
            try:
                gusts = tuple(_gust_of(gust) for gust in message.gusts)
                weather = replace(changed(present(), message), gusts=gusts)
            except CommandError as error:
                graph.refuse(published.topic, str(error))
                return
            if message.hour_of_day == 0.0:
                weather = replace(weather, hour_of_day=None)
            set_weather(weather)

        graph.subscribe("/weather_command", take, _TYPE)

    def publish(self, weather: Weather) -> None:
        """Publishes the weather."""
        gusts = [_gust_message(gust) for gust in weather.gusts]
        fields = {**fields_of(self._world, weather), "gusts": gusts}
        stamp = header(self._graph.now_ns(), "map")
        self._weather.publish(message_type(_TYPE)(header=stamp, **fields))


def fields_of(world: World, weather: Weather) -> dict[str, Any]:
    """Returns all fields of the weather message except the gusts."""
    elevation, azimuth = sun_in(world, weather)
    particles = weather.particles
    fading = 1.0 / world.light.visibility_m + 1.0 / particles.visibility_m
    return {
        "wind": Vector3(*weather.velocity_map),
        "w20": weather.w20_m_s,
        "profile": _profile_name(weather),
        "rain": particles.rain_mm_h,
        "snow": particles.snow_mm_h,
        "fog_visibility": _zero_for_none(particles.fog_visibility_m),
        "dust_visibility": _zero_for_none(particles.dust_visibility_m),
        "hour_of_day": _hour_of(weather),
        "visibility": 1.0 / fading,
        "sun_elevation": math.radians(elevation),
        "sun_azimuth": math.radians(azimuth),
    }


def changed(weather: Weather, message: Any, only: Collection[str] = ()) -> Weather:
    """Returns the weather with the fields `only` of a message, or all fields if `only` is empty.

    Raises `CommandError` for unknown names and invalid values.
    """
    for name in only:
        if name not in _SETTABLE:
            raise CommandError(f"only = '{name}'; known: {', '.join(_SETTABLE)}")
    names = set(only or _SETTABLE)
    values: dict[str, Any] = {}
    if "wind" in names:
        values["velocity_map"] = (message.wind.x, message.wind.y, message.wind.z)
    if "w20" in names:
        values["w20_m_s"] = message.w20
    if "hour_of_day" in names and message.hour_of_day != 0.0:
        values["hour_of_day"] = message.hour_of_day
    particles = {key: getattr(message, name) for name, key in _PARTICLES.items() if name in names}
    for key, value in particles.items():
        if key.endswith("visibility_m") and value == 0.0:
            particles[key] = math.inf
    values["particles"] = replace(weather.particles, **particles)
    return replace(weather, **values)


def _hour_of(weather: Weather) -> float:
    """Returns the hour as messages count it: midnight is 24, and 0 means none."""
    return 0.0 if weather.hour_of_day is None else weather.hour_of_day or 24.0


def _zero_for_none(visibility_m: float) -> float:
    return 0.0 if math.isinf(visibility_m) else visibility_m


def _gust_message(gust: Gust) -> Any:
    return message_type("volery_interfaces/msg/Gust")(
        amplitude=Vector3(*gust.amplitude_map),
        start=gust.start_s,
        rise=gust.rise_s,
        end=_zero_for_none(gust.end_s),
        front=Vector3(*gust.front_velocity_map),
    )


def _gust_of(message: Any) -> Gust:
    amplitude, front = message.amplitude, message.front
    return Gust(
        (amplitude.x, amplitude.y, amplitude.z),
        message.start,
        message.rise,
        message.end or math.inf,
        (front.x, front.y, front.z),
    )


def _profile_name(weather: Weather) -> str:
    if weather.field is not None:
        return "field"
    if weather.profile is None:
        return "uniform"
    return "log" if isinstance(weather.profile, LogProfile) else "power"
