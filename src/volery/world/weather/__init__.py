"""The air of a world: wind, gusts, turbulence and what is in it, as data and as compiled parts.

`Weather` (`model`) says what blows, `table` turns it into what kernels read, and `air` adds it up
at a UAV: mean wind (`mean_wind`) + gusts (`gusts`) + turbulence (`dryden`). `particles` has rain,
snow, fog and dust, and how far one sees in them; `sun` the hour of day.
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
