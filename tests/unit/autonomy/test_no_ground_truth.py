"""Autonomy flies on sensor data alone: none of its modules so much as names the truth."""

from pathlib import Path

import volery.autonomy


def test_autonomy_does_not_name_the_truth():
    folder = Path(volery.autonomy.__file__).parent
    sources = list(folder.rglob("*.py"))
    assert len(sources) > 10
    naming = [p.name for p in sources if "ground_truth" in p.read_text(encoding="utf-8")]
    assert naming == []
