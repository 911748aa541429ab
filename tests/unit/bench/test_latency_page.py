"""Tables and figure of the latencies, from figures that are known."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest
from bridge_figures import LATENCIES, result

from volery.core.errors import VoleryError
from volery_benchmarks.bridge import latency_page
from volery_benchmarks.bridge.latency_figures import (
    IMAGE_BYTES,
    end_point_figures,
    fit_line,
    one_way_latencies,
    size_figures,
)
from volery_benchmarks.document import render as render_benchmarks


def cells(text, first):
    """Cells of the one row that begins with `first`."""
    (row,) = [line for line in text.splitlines() if line.startswith(f"| {first} |")]
    return [cell.strip() for cell in row.strip("|").split("|")][1:]


def test_figures_by_size():
    figures = size_figures(LATENCIES)
    assert len(figures) == 3 * len(IMAGE_BYTES)
    assert figures["latency_1000_kb_median_ms"] == pytest.approx(3.0)
    assert figures["latency_1000_kb_mean_ms"] == pytest.approx(3.2)
    assert figures["latency_1000_kb_std_ms"] == pytest.approx(0.7583, abs=1e-4)
    assert figures["latency_0_kb_median_ms"] == pytest.approx(1.0)


def test_the_line_through_the_medians():
    alpha, beta = fit_line(LATENCIES)
    assert alpha == pytest.approx(0.002, rel=1e-3)
    assert beta == pytest.approx(0.001, rel=1e-3)


def test_end_points_are_means_of_trials():
    figures = end_point_figures("stop", [[0.001, 0.003], [0.003, 0.005]])
    assert figures == {
        "latency_stop_10x10_ms": pytest.approx(3.0),
        "latency_stop_10x10_std_ms": pytest.approx(2**0.5),
    }


def test_one_way_latency_matches_commands_by_their_number():
    applied = {0.1: 5_000_000, 0.2: 9_000_000}
    assert one_way_latencies([(0.2, 8_000_000), (0.1, 1_000_000)], applied) == [0.001, 0.004]


def test_the_tables_hold_all_three(tmp_path):
    text = latency_page.render([result(), result(processor="another")])
    assert cells(text, "1 MB") == ["3", "3.2", "0.758", "3.55", "40"]
    assert cells(text, "250 kB")[3:] == ["-", "13.8"]
    assert cells(text, "Volery") == ["0.002", "0.001"]
    assert cells(text, "the article") == ["0.035", "0.005"]
    assert cells(text, "round trip") == ["2 ± 0.5", "0.86", "6.65", "201"]
    assert cells(text, "one way") == ["1 ± 0.25", "-", "3.32", "92.6"]
    assert cells(text, "Volery, machine 2") == ["2", "1", "1.5"]
    assert cells(text, "the article's laptop") == ["201", "92.6", "409"]
    assert "- machine 2: processor another, numpy 2.0\n" in text


def test_the_page_and_its_image_are_written(tmp_path):
    measured = tmp_path / "bench.json"
    measured.write_text(json.dumps([{**result().as_dict(), "bench": "lidar"}, result().as_dict()]))
    results = latency_page.bridge_results([measured])
    latency_page.write(tmp_path, results)
    text = (tmp_path / "bridge_latency.md").read_text()
    assert "](pictures/bridge_latency.svg)" in text
    image = (tmp_path / "pictures/bridge_latency.svg").read_text()
    ET.fromstring(image)
    for name in ("Volery: L = 0.002", "the 2025 article", "ROS-TCP-Endpoint 0.7.0"):
        assert name in image
    latency_page.write(tmp_path, results)
    assert (tmp_path / "pictures/bridge_latency.svg").read_text() == image


def test_results_without_the_figures_are_reported(tmp_path):
    old = result()
    del old.figures["latency_stop_10x10_ms"]
    with pytest.raises(VoleryError, match=r"latency_stop_10x10_ms.*volery bench bridge"):
        latency_page.write(tmp_path, [old])
    assert not list(tmp_path.glob("*.md"))
    file = tmp_path / "other.json"
    file.write_text(json.dumps({**result().as_dict(), "bench": "lidar"}))
    with pytest.raises(VoleryError, match="no result"):
        latency_page.bridge_results([file])


def test_the_benchmarks_leave_them_to_that_page():
    text = render_benchmarks([result()])
    assert "latency_stop" not in text
    assert "ros_tcp_alpha_s_per_mb" in text
    assert "(bridge_latency.md)" in text
