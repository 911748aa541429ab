"""The report as one HTML file with everything inside, for light and dark screens and for paper."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from volery.core.errors import VoleryError, reason_of
from volery.core.plurals import counted
from volery.core.whole_files import write_whole
from volery.figures import charts, maps
from volery.figures.flight_data import FlightData, UavTrack
from volery.figures.palette import uav_color
from volery.verdicts.verdict import Verdict

_EVENTS_SHOWN = 60
_STYLE = Path(__file__).with_name("report.css")


class ReportError(VoleryError):
    """Raised if the report cannot be written."""


def check_target(folder: Path, *, overwrite: bool = False) -> None:
    """Raises `ReportError` if `folder` holds a report already, unless `overwrite` is set."""
    path = folder / "index.html"
    if os.path.lexists(path) and not overwrite:
        raise ReportError(f"{path} exists; --overwrite replaces it")


def write_report(
    flight: FlightData,
    folder: str | Path,
    *,
    verdicts: Sequence[Verdict] = (),
    overwrite: bool = False,
) -> Path:
    """Writes `index.html` into `folder` (created if missing) and returns its path.

    verdicts: on the expectations of the scenario; they come first. The page appears whole or not at
    all. Raises `ReportError` if it cannot be written, or exists and `overwrite` is not set.
    """
    return write_page(page(flight, verdicts), Path(folder), overwrite=overwrite)


def write_page(text: str, folder: Path, *, overwrite: bool) -> Path:
    """Writes a page as `index.html` into a folder; see `write_report`."""
    path = folder / "index.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(path, text, overwrite=overwrite)
    except FileExistsError:
        check_target(folder, overwrite=overwrite)
        raise ReportError(f"{folder} is not a folder") from None
    except OSError as error:
        raise ReportError(f"{path}: cannot write the report: {reason_of(error)}") from None
    return path


def page(flight: FlightData, verdicts: Sequence[Verdict] = ()) -> str:
    """Returns the whole page as text."""
    title = escape(flight.scenario)
    count = len(flight.uavs)
    fleet = counted(count, "UAV")
    return html_page(
        flight.scenario,
        [
            '<header><p class="kicker">Volery flight report</p>',
            f"<h1>{title}</h1>",
            f'<p class="lead">{escape(flight.description)}</p>' if flight.description else "",
            f'<p class="note">{escape(_ending(flight))}</p>' if flight.interrupted else "",
            "</header>",
            _expectations(verdicts),
            _tiles(flight, fleet),
            *_figures(flight),
            _uav_table(flight),
            _events(flight),
            _details(flight),
        ],
    )


def html_page(
    title: str, parts: Iterable[str], more_style: str = "", *, kind: str = "flight report"
) -> str:
    """Returns an HTML file of a report from its parts; empty ones are left out.

    kind: what follows the title in the browser's tab.
    """
    style = f"\n{_STYLE.read_text(encoding='utf-8')}{more_style}"
    head = (
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        f"<title>{escape(title)} · {escape(kind)}</title>",
        f"<style>{style}</style></head><body><main>",
    )
    return "\n".join(part for part in (*head, *parts, "</main></body></html>") if part) + "\n"


def chart_figure(svg: str, caption: str) -> str:
    """Returns a chart with its <figcaption>."""
    return f'<figure class="chart">{svg}{caption}</figure>'


def _ending(flight: FlightData) -> str:
    return (
        f"{flight.interrupted}: this report shows the {flight.simulated_s:.1f} s flown "
        f"of {flight.planned_s:g} s."
    )


def _expectations(verdicts: Sequence[Verdict]) -> str:
    """Returns a table of the verdicts; empty without any."""
    rows = []
    for verdict in verdicts:
        moment = f"{verdict.time_s:.2f} s" if math.isfinite(verdict.time_s) else ""
        margin = f"{verdict.margin:.3g} {verdict.unit}" if math.isfinite(verdict.margin) else ""
        texts = (verdict.outcome, verdict.name, verdict.text, margin, verdict.uav, moment)
        cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
        rows.append(f'<tr class="{verdict.outcome}">{cells}</tr>')
    if not rows:
        return ""
    passed = sum(verdict.is_passed for verdict in verdicts)
    head = "".join(
        f"<th>{word}</th>" for word in ("verdict", "expectation", "measured", "margin", "UAV", "at")
    )
    return (
        f"<h2>Expectations: {passed} of {len(verdicts)} passed</h2>"
        f'<div class="scroll"><table class="verdicts"><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _tiles(flight: FlightData, fleet: str) -> str:
    nearest = min((u.minimum_clearance_m for u in flight.uavs), default=math.inf)
    flown = sum(u.distance_m for u in flight.uavs)
    fastest = max((float(u.speed_m_s.max(initial=0.0)) for u in flight.uavs), default=0.0)
    tiles = [
        (f"{flight.simulated_s:.1f} s", f"flown by {fleet}"),
        (_length(flown), "distance in all"),
        (f"{fastest:.1f} m/s", "greatest speed"),
        (_clearance(nearest, flight), "closest to an obstacle"),
        (str(flight.contacts), "contact" if flight.contacts == 1 else "contacts"),
        (f"{flight.real_time_factor:.1f} ×", "real time"),
    ]
    cells = "".join(
        f"<div><dd>{escape(value)}</dd><dt>{escape(name)}</dt></div>" for value, name in tiles
    )
    return f'<dl class="tiles">{cells}</dl>'


def _figures(flight: FlightData) -> list[str]:
    number = 0
    found: list[str] = []

    def caption(text: str) -> str:
        nonlocal number
        number += 1
        return f"<figcaption><b>Figure {number}.</b> {text}</figcaption>"

    def figure(data: bytes, alternative: str, text: str) -> str:
        source = base64.b64encode(data).decode()
        image = f'<img alt="{escape(alternative)}" src="data:image/png;base64,{source}">'
        return f'<figure class="map">{image}{caption(text)}</figure>'

    def chart(svg: str, text: str) -> str:
        return chart_figure(svg, caption(text))

    trees = "Circles are tree crowns, the dots in them trunks, to scale. " if flight.trees else ""
    crosses = "Red crosses mark contacts. " if flight.contacts else ""
    found.append("<h2>The flight</h2>")
    found.append(
        figure(
            maps.top_view(flight),
            "Map of the world with the paths flown",
            f"The flight from above. {trees}A ring is where a UAV started, a disc where it was "
            f"at the end. {crosses}North is up.",
        )
    )
    aslant, above = maps.aslant_view(flight), maps.lidar_view(flight)
    if flight.lidar is not None and aslant is not None and above is not None:
        found.append("<h2>What the LIDARs saw</h2>")
        numbers = (
            f"{counted(len(flight.lidar.points_map), 'point')}, one a voxel of "
            f"{flight.lidar.voxel_m:g} m, from {counted(flight.lidar.scans, 'scan')}"
        )
        found.append(
            figure(
                aslant,
                "LIDAR points seen aslant",
                f"The LIDAR map seen from the south, {numbers}. Each beam is placed by the true "
                "pose that the UAV had at its instant.",
            )
        )
        found.append(
            figure(
                above,
                "LIDAR points from above",
                "The same map from above, coloured by height above the ground; the ground itself "
                "is grey.",
            )
        )
    found.append("<h2>Height, clearance, speed</h2>")
    found.append('<div class="pair">')
    found.append(chart(charts.height_chart(flight), "Height above the ground straight below."))
    found.append(
        chart(
            charts.clearance_chart(flight),
            "Distance from the UAV's middle to the nearest obstacle, exact to the leaf; searched "
            f"up to {flight.max_clearance_m:g} m, where the line stays if there is none.",
        )
    )
    found.append(chart(charts.speed_chart(flight), "Speed over the ground and upward together."))
    if flight.stage_seconds:
        found.append(
            chart(
                charts.load_chart(flight),
                "Computing time of each stage: its share of the wall time, and what it would take "
                f"of one real-time second. The run took {flight.wall_s:.1f} s for "
                f"{flight.simulated_s:.1f} simulated seconds.",
            )
        )
    found.append("</div>")
    return found


def _uav_table(flight: FlightData) -> str:
    head = ("UAV", "distance", "mean speed", "max speed", "mean height", "closest to an obstacle")
    rows = "".join(_uav_row(k, uav, flight) for k, uav in enumerate(flight.uavs))
    names = "".join(f"<th>{name}</th>" for name in head)
    return (
        '<h2>The fleet</h2><div class="scroll"><table class="numbers">'
        f"<thead><tr>{names}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _uav_row(number: int, uav: UavTrack, flight: FlightData) -> str:
    samples = len(uav.time_s) > 0
    seconds = float(uav.time_s[-1] - uav.time_s[0]) if samples else 0.0
    mean = uav.distance_m / seconds if seconds > 0.0 else 0.0
    cells = (
        _length(uav.distance_m),
        f"{mean:.2f} m/s",
        f"{float(uav.speed_m_s.max(initial=0.0)):.2f} m/s",
        f"{float(uav.height_m.mean()):.2f} m" if samples else "none",
        _clearance(uav.minimum_clearance_m, flight),
    )
    swatch = f'<i style="background:{uav_color(number)}"></i>'
    values = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
    return f"<tr><th>{swatch}{escape(uav.name)}</th>{values}</tr>"


def _events(flight: FlightData) -> str:
    if not flight.events:
        return ""
    shown = flight.events[:_EVENTS_SHOWN]
    lines = "".join(
        f"<li{' class=contact' if event.is_contact else ''}>{escape(event.text)}</li>"
        for event in shown
    )
    more = len(flight.events) - len(shown)
    rest = f"<p>and {more} more; the log holds them all.</p>" if more > 0 else ""
    return f'<h2>Events</h2><ol class="events">{lines}</ol>{rest}'


def _details(flight: FlightData) -> str:
    rows: list[tuple[str, str]] = [
        ("scenario", flight.scenario),
        ("seed", str(flight.seed)),
        ("simulated time", f"{flight.simulated_s:.3f} s"),
        ("wall time", f"{flight.wall_s:.2f} s"),
        ("real-time factor", f"{flight.real_time_factor:.2f}"),
    ]
    if flight.log_path is not None:
        rows.append(("log", f"{flight.log_path} ({counted(flight.log_messages, 'message')})"))
    if flight.digest:
        rows.append(("digest (SHA-256)", flight.digest))
    rows += list(flight.machine.items())
    rows += [(f"{name} version", version) for name, version in flight.versions.items()]
    return f"<h2>How it was made</h2>{_definition_table(rows)}"


def _definition_table(rows: Iterable[tuple[str, str]]) -> str:
    lines = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
    return f'<div class="scroll"><table class="facts"><tbody>{lines}</tbody></table></div>'


def _length(metres: float) -> str:
    return f"{metres / 1000.0:.2f} km" if metres >= 1000.0 else f"{metres:.1f} m"


def _clearance(metres: float, flight: FlightData) -> str:
    if math.isinf(metres):
        return f"> {flight.max_clearance_m:g} m"
    return f"{metres:.2f} m"
