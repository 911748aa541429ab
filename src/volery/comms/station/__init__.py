"""Stations of the radio network: on the ground, for UAVs, and as a node."""
