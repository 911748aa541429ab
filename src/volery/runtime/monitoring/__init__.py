"""Publishes the state of a running simulation: poses, vehicles, progress, load."""
