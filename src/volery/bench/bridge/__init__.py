"""Measures message latencies through bridges, with clients in other processes."""

from volery.bench.bridge.measuring import measure

__all__ = ["measure"]
