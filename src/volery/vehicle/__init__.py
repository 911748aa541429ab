"""UAVs: airframes, their state and their dynamics."""
