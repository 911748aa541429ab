"""Terrain, trees, forests and cities of a map, and ray casting at them."""
