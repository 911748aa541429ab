"""The air of a world: mean wind, gusts and turbulence, as data and as compiled parts.

`Weather` (`model`) says what blows, `table` turns it into what kernels read, and `air` adds it up
at a UAV: mean wind (`mean_wind`) + gusts (`gusts`) + turbulence (`dryden`).
"""

from volery.world.weather.dryden import W20_M_S
from volery.world.weather.model import CALM, Gust, LogProfile, PowerProfile, Weather
from volery.world.weather.wind_field import WindField

__all__ = ["CALM", "W20_M_S", "Gust", "LogProfile", "PowerProfile", "Weather", "WindField"]
