"""Recorded flights: played back, flown again by their commands, mapped by a SLAM."""
