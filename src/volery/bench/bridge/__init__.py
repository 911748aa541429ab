"""The bench `bridge`: how long messages take through the doors, with clients in other processes."""

from volery.bench.bridge.measuring import measure

__all__ = ["measure"]
