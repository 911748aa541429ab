"""Builders of the autopilot's messages, and their streams."""
