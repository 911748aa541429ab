"""Pictures of the scenarios that ship, `NAME.jpg`; `volery.server.card_renderer` makes them."""

from pathlib import Path

CARDS = Path(__file__).parent
"""Where they lie."""
