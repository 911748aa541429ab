"""Pictures of the scenarios that ship, `NAME.jpg`; `volery.server.draw_cards` makes them."""

from pathlib import Path

CARDS = Path(__file__).parent
"""Where they lie."""
