"""The air of a world: wind, gusts, turbulence and particles, as data and as compiled parts.

`Weather` (`model`) is the data, `table` converts it for kernels, and `air` computes the velocity
at a UAV: mean wind (`mean_wind`) + gusts + turbulence (`dryden`). `particles` has rain, snow, fog
and dust, and the visibility in them; `sun` the sun's angles by the hour.
"""

from volery.world.weather.dryden import W20_M_S
from volery.world.weather.model import CALM, Gust, LogProfile, PowerProfile, Weather
from volery.world.weather.particles import CLEAR_AIR, Particles
from volery.world.weather.wind_field import WindField

__all__ = [
    "CALM",
    "CLEAR_AIR",
    "W20_M_S",
    "Gust",
    "LogProfile",
    "Particles",
    "PowerProfile",
    "Weather",
    "WindField",
]
