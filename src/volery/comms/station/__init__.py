"""Stations of the radio network: on the ground, beside UAVs, and as a node."""
