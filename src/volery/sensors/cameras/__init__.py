"""Cameras: lenses, shading, and images of a scene."""
