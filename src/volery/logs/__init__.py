"""Logs as data: topics, times, arrays, tables and plots of recorded flights."""
