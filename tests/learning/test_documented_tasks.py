"""The code of the documents on learning runs."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
BLOCKS = [
    (name, block)
    for name in ("learning", "learning_environments")
    for block in re.findall(
        r"^```python\n(.*?)^```",
        (DOCS / f"{name}.md").read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )
]


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_the_code_runs(number):
    name, block = BLOCKS[number]
    made = {}
    exec(compile(block, f"docs/{name}.md, block {number}", "exec"), made)
    assert made.keys() - {"__builtins__"}


def test_there_is_code():
    assert len(BLOCKS) >= 4
