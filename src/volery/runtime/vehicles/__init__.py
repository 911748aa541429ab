"""Manages the UAVs of a running simulation: handles, commands, spawning, control authority."""
