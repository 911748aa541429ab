"""Publishes sensor samples, states and events as messages on the graph."""
