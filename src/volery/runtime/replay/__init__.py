"""Replays recorded flights: playback, command replay, offline SLAM."""
