"""The studies of `examples/studies` and of the documents: they load, and a shorter one flies."""

import re
import tomllib
from pathlib import Path

import pytest

from volery.cluster import load_study, run_study
from volery.scenario.toml_writer import toml_text

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")
ROOT = Path(__file__).parents[2]
STUDIES = sorted((ROOT / "examples" / "studies").glob("*.toml"))
PAGE = (ROOT / "docs" / "sweeps.md").read_text("utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_an_example_flies(path, tmp_path):
    data = tomllib.loads(path.read_text("utf-8"))
    data |= {"duration_s": 0.3, "repetitions": 1}
    for parameter in data["parameters"].values():
        if "steps" in parameter:
            parameter["steps"] = 2
    if "sampling" in data:
        data["sampling"]["samples"] = 2
    for metric in data["metrics"]:
        if isinstance(metric, dict):
            assert metric["function"].partition(":")[0] == "drift.py"
    (tmp_path / "drift.py").write_text((path.parent / "drift.py").read_text())
    study = tmp_path / path.name
    study.write_text(toml_text(data))
    table = run_study(study, tmp_path / "out", workers=0, trust=True)
    assert table.num_failed == 0, table["error"]
    assert len(table) in {2, 6}


def test_the_first_study_of_the_page_loads(tmp_path):
    first, *others = blocks("toml")
    path = tmp_path / "gusts.toml"
    path.write_text(first)
    assert len(load_study(path).points) == 3
    for block in others:
        tomllib.loads(block)


def test_the_metrics_of_the_page_are_those_of_the_example():
    (metrics, _) = blocks("python")
    example = (ROOT / "examples" / "studies" / "drift.py").read_text("utf-8")
    assert metrics.split("\n\n\n", 1)[1].strip() in example
