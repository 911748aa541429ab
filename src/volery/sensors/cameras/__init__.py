"""Cameras: lenses, shading, and pictures of a scene."""
