"""Builds a scenario's parts: world, fleet, sensors, estimators, nodes."""
