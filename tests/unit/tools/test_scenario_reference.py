"""The reference of scenarios' keys is complete, and refuses keys without an example."""

import importlib.util
from pathlib import Path

import pytest

from volery.scenario.json_schema import models

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "tools" / "site" / "scenario_reference.py"


@pytest.fixture(scope="module")
def reference():
    spec = importlib.util.spec_from_file_location("scenario_reference", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_key_has_a_row(reference):
    head, *parts = reference.page().split("\n## ")
    assert head.startswith("# Keys of scenarios\n")
    sections = dict(part.split("\n", 1) for part in parts)
    assert list(sections) == [model.__name__ for model in models()]
    for model in models():
        rows = sections[model.__name__].split("|---|---|---|---|\n")[1].strip().split("\n")
        assert [row.split("`")[1] for row in rows] == list(model.model_fields)
        assert all(row.replace("\\|", "").count("|") == 5 for row in rows)


def test_rows_show_type_unit_default_and_example(reference):
    text = reference.page()
    assert "| `at_s` | number (≥ 0, ≤ 1e+08), in s | `0.0` | Simulated time" in text
    assert '| `on_contact` | `"crash"`, `"bounce"` | `"crash"` |' in text
    assert "| Number of UAVs.<br>Example: `count = 3` |" in text
    assert "| `world` | [World](#world) | its defaults | Ground, trees, buildings" in text
    assert "In a file: `[[nodes]]`, `[[types.NAME.nodes]]`" in text


def test_a_key_without_an_example_is_reported(reference, monkeypatch):
    monkeypatch.delitem(reference.EXAMPLES, "Gust.rise_m")
    with pytest.raises(SystemExit, match=r"Gust\.rise_m has no example; add one to EXAMPLES"):
        reference.page()


def test_an_example_that_does_not_fit_is_rejected(reference, monkeypatch):
    monkeypatch.setitem(reference.EXAMPLES, "Gust.rise_m", "long")
    with pytest.raises(ValueError, match="valid number"):
        reference.page()


def test_examples_belong_to_keys(reference):
    keys = {f"{model.__name__}.{key}" for model in models() for key in model.model_fields}
    assert set(reference.EXAMPLES) <= keys
