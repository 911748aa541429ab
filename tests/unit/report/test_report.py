from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from report_sample import sample_flight

from volery.cli.output_paths import check_report
from volery.core.errors import VoleryError
from volery.figures import charts, maps
from volery.figures.flight_data import FlightData, Ground
from volery.report.page import ReportError, page, write_report
from volery.report.voxels import VoxelSet
from volery.verdicts import Outcome, Verdict

PNG = b"\x89PNG\r\n\x1a\n"
VOID = {"meta", "img", "br", "hr", "link"}


class Balance(HTMLParser):
    """Checks that every element is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def flight() -> FlightData:
    return sample_flight(seconds=40.0)


@pytest.fixture(scope="module")
def light(flight: FlightData) -> FlightData:
    """The same without what takes long to draw."""
    ground = Ground(np.zeros((2, 2)), (0.0, 0.0), 500.0)
    return replace(flight, trees=None, lidar=None, ground=ground)


def test_page_is_one_wellformed_selfcontained_file(tmp_path: Path, flight: FlightData) -> None:
    path = write_report(flight, tmp_path / "deep" / "report")
    assert path == tmp_path / "deep" / "report" / "index.html"
    text = path.read_text(encoding="utf-8")
    balance = Balance()
    balance.feed(text)
    assert balance.open == []
    assert balance.seen.count("figure") == 7
    assert balance.seen.count("img") == 3
    assert "prefers-color-scheme: dark" in text
    # nothing is fetched from elsewhere
    assert not re.search(r'(?:src|href)="(?!data:|#)', text)
    assert not re.search(r"url\((?!#)", text)
    for word in ("uav1", "uav3", "8c1f8c1f", "forest_survey.mcap", "hit tree 812", "Figure 7."):
        assert word in text
    assert path.stat().st_size < 4_000_000


def test_names_within_the_drawings_are_unique(light: FlightData) -> None:
    text = page(light)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(ids)


def test_text_from_outside_is_escaped(light: FlightData) -> None:
    text = page(replace(light, description="<script>alert(1)</script>", scenario="a&b"))
    assert "<script>" not in text
    assert "a&amp;b" in text


def test_same_flight_gives_the_same_page(light: FlightData) -> None:
    assert page(light) == page(light)


@pytest.mark.parametrize(
    "draw",
    [charts.height_chart, charts.speed_chart, charts.clearance_chart, charts.load_chart],
)
def test_charts_take_the_pages_colours(flight: FlightData, draw: object) -> None:
    svg = draw(flight)  # type: ignore[operator]
    ElementTree.fromstring(svg)
    assert "var(--ink)" in svg or "var(--faint)" in svg
    assert "#0102" not in svg
    assert re.match(r"<svg[^>]*viewBox", svg)
    assert not re.match(r"<svg[^>]*\swidth=", svg)


def test_verdicts_come_before_the_figures(light: FlightData) -> None:
    calm = Verdict("calm", "speed", Outcome.PASSED, "2.10 m/s", 0.9, "m/s", 3.25, "uav2")
    near = Verdict("<near>", "separation", Outcome.FAILED, "none", math.nan)
    text = page(light, [calm, near])
    assert text.index("Expectations: 1 of 2 passed") < text.index("flown by")
    assert "&lt;near&gt;" in text
    cells = "".join(f"<td>{c}</td>" for c in ("passed", "calm", "2.10 m/s", "0.9 m/s", "uav2"))
    assert f'<tr class="passed">{cells}<td>3.25 s</td>' in text
    assert "Expectations" not in page(light)


def test_interrupted_flight_says_so(light: FlightData) -> None:
    text = page(replace(light, interrupted="stopped by the user", planned_s=300.0))
    assert "stopped by the user: this report shows the 40.0 s flown of 300 s." in text


def test_bare_flight_still_gives_a_page() -> None:
    """No trees, no LIDAR, flat ground, a UAV without a single sample."""
    full = sample_flight(seconds=2.0)
    empty = replace(
        full.uavs[0],
        time_s=np.zeros(0),
        position_map=np.zeros((0, 3)),
        speed_m_s=np.zeros(0),
        height_m=np.zeros(0),
        clearance_m=np.zeros(0),
    )
    flight = replace(
        full,
        uavs=(empty,),
        ground=Ground(np.zeros((2, 2)), (0.0, 0.0), 500.0),
        trees=None,
        lidar=None,
        events=(),
        stage_seconds={},
        simulated_s=0.0,
        wall_s=0.0,
    )
    text = page(flight)
    assert "LIDARs saw" not in text
    assert "> 10 m" in text.replace("&gt;", ">")


def test_hovering_in_place_gives_maps() -> None:
    full = sample_flight(uavs=1, seconds=2.0)
    track = full.uavs[0]
    still = replace(track, position_map=np.tile(track.position_map[:1], (len(track.time_s), 1)))
    flight = replace(full, uavs=(still,))
    assert maps.top_view(flight).startswith(PNG)
    assert (maps.aslant_view(flight) or b"").startswith(PNG)


def test_fifty_uavs() -> None:
    text = page(replace(sample_flight(uavs=50, seconds=3.0), lidar=None))
    assert "uav50" in text


def test_numbers() -> None:
    flight = sample_flight(seconds=20.0)
    track = flight.uavs[0]
    assert track.distance_m == pytest.approx(
        sum(
            math.dist(a, b)
            for a, b in zip(track.position_map, track.position_map[1:], strict=False)
        )
    )
    assert flight.contacts == 1
    assert flight.real_time_factor == pytest.approx(20.0 / 21.7)


def test_folder_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "report").write_text("")
    with pytest.raises(VoleryError, match="report is not a folder"):
        check_report(tmp_path / "report", overwrite=False)
    with pytest.raises(ReportError, match="report is not a folder"):
        write_report(sample_flight(seconds=2.0), tmp_path / "report")
    with pytest.raises(ReportError, match="Not a directory"):
        write_report(sample_flight(seconds=2.0), tmp_path / "report" / "inner")


def test_voxels_keep_one_point_each_and_stay_bounded() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-20.0, 20.0, (20_000, 3))
    voxels = VoxelSet(0.5)
    for part in np.array_split(points, 7):
        voxels.add(part)
    centers = voxels.centers()
    assert len(centers) == len(np.unique(np.floor(points / 0.5), axis=0))
    assert np.abs(np.mod(centers, 0.5) - 0.25).max() < 1e-4
    small = VoxelSet(0.5, limit=3000)
    small.add(points)
    assert 0 < len(small.centers()) <= 3000
    assert small.voxel_m == 2.0 or small.voxel_m == 4.0
