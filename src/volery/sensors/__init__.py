"""What a UAV perceives: models of real sensors over the scene and the fleet's state."""
