"""Tables of constants in TOML files beside modules."""

from pathlib import Path

import pytest

import volery
from volery.core.data_tables import read_table

PACKAGE = Path(volery.__file__).parent


def test_a_table_lies_beside_its_module(tmp_path):
    (tmp_path / "units.toml").write_text("m = { factor = 1.0 }\nkm = { factor = 1e3 }\n")
    found = read_table(str(tmp_path / "units.py"), "units.toml")
    assert found == {"m": {"factor": 1.0}, "km": {"factor": 1000.0}}
    assert list(found) == ["m", "km"]


@pytest.mark.parametrize(
    "path",
    [p for p in PACKAGE.rglob("*.py") if "read_table(__file__" in p.read_text("utf-8")],
    ids=lambda path: path.stem,
)
def test_every_module_finds_its_table(path):
    text = path.read_text("utf-8")
    name = text.split('read_table(__file__, "', 1)[1].split('"', 1)[0]
    assert read_table(str(path), name)
