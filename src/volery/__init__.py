"""Volery: many UAVs with LIDARs in lock step."""
