"""Results of flights: trajectories as arrays, tables of pandas, maps for scripts and notebooks."""

from volery.results.flight_result import FlightResult, UavFlight

__all__ = ["FlightResult", "UavFlight"]
