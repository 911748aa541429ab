"""Measures the page's speed, the age of its data and its cost for the simulation."""

from volery_benchmarks.page.measuring import measure

__all__ = ["measure"]
