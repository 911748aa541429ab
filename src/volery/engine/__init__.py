"""Advances the simulation in lock step on one integer clock, deterministically, in stages."""
