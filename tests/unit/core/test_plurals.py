"""Tests counts with singular and plural."""

import pytest

from volery.core.plurals import counted


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((0, "scan"), "0 scans"),
        ((1, "scan"), "1 scan"),
        ((1600, "scan"), "1,600 scans"),
        ((1, "entry", "entries"), "1 entry"),
        ((2, "entry", "entries"), "2 entries"),
    ],
)
def test_one_is_singular(words, text):
    assert counted(*words) == text
