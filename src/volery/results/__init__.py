"""Results of flights in this process: trajectories as arrays, tables of pandas, maps.

`Simulation.record` and `Simulation.fly` make them; what is read from a file is in `volery.logs`.
"""

from volery.results.flight_result import FlightResult
from volery.results.flight_states import UavFlight

__all__ = ["FlightResult", "UavFlight"]
