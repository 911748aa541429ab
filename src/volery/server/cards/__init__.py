"""Images of the shipped scenarios, `NAME.jpg`; `volery.server.card_renderer` renders them."""

from pathlib import Path

CARDS = Path(__file__).parent
"""Folder of the images."""
