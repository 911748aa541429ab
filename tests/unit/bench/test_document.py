"""The page of figures: several runs of a bench become their median and their span."""

import json
import re
import subprocess
import sys
from pathlib import Path

from volery_benchmarks.document import _HEAD, render
from volery_benchmarks.registry import BENCHES, Result


def run(rays, bench="lidar", machine="a"):
    return Result(bench, {"processor": machine}, {"rays_per_s_1_thread": rays})


def test_the_median_of_several_runs_is_judged_and_the_span_is_printed():
    page = render([run(4e6), run(7e6), run(5e6)])
    assert "median of 3 runs" in page
    row = "| `rays_per_s_1_thread` | 5e+06 (4e+06 .. 7e+06) | >= 6e+06 (missed) |"
    assert row in page
    assert page.count("## lidar") == 1


def test_a_single_run_stands_alone():
    assert "| `rays_per_s_1_thread` | 7e+06 | >= 6e+06 |" in render([run(7e6)])


def test_runs_of_two_machines_are_not_mixed():
    page = render([run(4e6), run(7e6, machine="b")])
    assert "## lidar (machine 1)" in page
    assert "## lidar (machine 2)" in page
    assert "median of" not in page


def test_benchmarks_page_has_the_columns_of_the_generator():
    """The committed page is what `make docs-benchmarks` writes, not edited by hand."""
    page = (Path(__file__).parents[3] / "docs/benchmarks.md").read_text()
    assert page.startswith(_HEAD)
    bounds = {bench.name: bench.bounds for bench in BENCHES.values()}
    for name, section in re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", page, re.DOTALL | re.MULTILINE):
        for figure, bound in re.findall(r"^\| `(\w+)` \| .* \| (.*) \|$", section, re.MULTILINE):
            limit = bounds[name].get(figure)
            assert bound.removesuffix(" (missed)") == str(limit or "reported"), (name, figure)


def generate(*files):
    command = [sys.executable, "-m", "volery_benchmarks.document", *map(str, files)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_generator_reads_the_document_of_all_benches(tmp_path):
    path = tmp_path / "bench.json"
    results = [run(7e6).as_dict(), run(2.0, "fleet").as_dict()]
    path.write_text(json.dumps({"build": {}, "date": "2026-11-23", "results": results}))
    done = generate(path)
    assert done.returncode == 0
    assert done.stdout == render([run(7e6), run(2.0, "fleet")])


def test_an_unreadable_document_ends_the_generator_with_one_line(tmp_path):
    path = tmp_path / "bench.json"
    for text in (None, "{", '{"results": [{"bench": 1}]}'):
        if text is not None:
            path.write_text(text)
        done = generate(path)
        assert done.returncode == 1
        assert done.stdout == ""
        assert re.fullmatch(rf"error: .*{path.name}.*\n", done.stderr)
