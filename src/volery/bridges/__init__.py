"""Carriers of messages in and out of the graph: here, log files."""
