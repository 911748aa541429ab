"""The bench `page`: how fast the page is, how honest, and what it costs the simulation."""

from volery.bench.page.measuring import measure

__all__ = ["measure"]
