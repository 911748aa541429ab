"""Writes, reads, recovers, records and replays logs of a run."""
