"""Logs of a run: written, read, mended, recorded by pattern, replayed."""
