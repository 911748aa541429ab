"""Carries messages between the graph and other programs or log files."""
