"""The code of docs/learning.md runs."""

import re
from pathlib import Path

import pytest

TEXT = (Path(__file__).parents[2] / "docs" / "learning.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_the_code_runs(number):
    exec(compile(BLOCKS[number], f"docs/learning.md, block {number}", "exec"), {})


def test_there_is_code():
    assert len(BLOCKS) == 2
