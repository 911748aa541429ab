"""Models of real sensors over the scene and the fleet's state."""
