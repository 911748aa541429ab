"""Measures message latencies through bridges, with clients in other processes."""

from volery_benchmarks.bridge.measuring import measure

__all__ = ["measure"]
