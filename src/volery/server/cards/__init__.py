"""Images of the shipped scenarios, `NAME.jpg`; `tools/scenario_cards.py` renders them."""

from pathlib import Path

CARDS = Path(__file__).parent
"""Folder of the images."""
