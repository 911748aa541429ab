"""Cooperative search: colour detection, positions on the ground, separation, agreement."""
