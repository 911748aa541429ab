"""Valid footprints in the map from features of a file, with a report of repairs.

A valid footprint consists of one or more polygons: simple rings, holes inside, no overlap.
Self-intersecting outlines are rebuilt from the areas that they enclose, open ones are closed;
outlines without area, duplicates, buildings hidden in a taller one and outlines whose parts are
mapped (see `parts`) are dropped. The report lists each by id. What is no building (see `selection`)
is left out and counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.core.plurals import counted
from volery.world.city.geojson import Feature, Ring, read_features
from volery.world.city.heights import HeightRule, height_of
from volery.world.city.outline import Outline
from volery.world.city.parts import without_outlines_of_parts
from volery.world.city.selection import is_part, reasons_in_words, select_buildings

Region = tuple[float, float, float, float]

MIN_AREA_M2 = 1.0
"""Minimum area; smaller footprints are mapping errors (modelling choice)."""
MAX_DISTANCE_M = 50_000.0
"""Maximum distance from the map's origin: beyond it a flat map is wrong by 200 m of height."""
_MAX_REPAIRED_CORNERS = 1000
"""Maximum corners of a self-intersecting outline: it may have this number squared of parts."""
_SAME = 0.999
"""Fraction of common area at which two footprints count as duplicates."""


@dataclass(frozen=True)
class Report:
    """Results of reading a file's outlines; pairs are an id and the action or reason."""

    file: str
    outlines: int
    buildings: int
    repaired: tuple[tuple[str, str], ...]
    dropped: tuple[tuple[str, str], ...]
    guessed: tuple[tuple[str, str], ...]
    """Heights that could not be parsed."""
    heights: tuple[int, int, int]
    """Buildings whose height came from `height`, from levels, from the default."""
    outside: int
    """Outlines beyond the requested region."""
    others: tuple[tuple[str, str], ...] = ()
    """Features that are no buildings."""

    def summary(self) -> str:
        """Returns a summary in one line."""
        buildings = counted(self.buildings, "building")
        text = f"{self.file}: {buildings} of {counted(self.outlines, 'outline')}"
        parts = [
            f"{count} {what}"
            for count, what in (
                (self.outside, "outside the region"),
                (len(self.repaired), "repaired"),
                (len(self.dropped), "dropped"),
                (len(self.guessed), "with a height not understood"),
            )
            if count
        ]
        text += ": " + ", ".join(parts) if parts else ""
        if self.others:
            text += f"; {len(self.others)} {_no_buildings(self.others)}"
        if self.heights[2]:
            one = self.heights[2] == 1
            text += f"; {self.heights[2]} {'has' if one else 'have'} no height and "
            text += f"{'gets' if one else 'get'} the default"
        return text

    def __str__(self) -> str:
        """Returns the summary, then a line for each repaired, dropped or guessed outline."""
        lines = [self.summary()]
        lines += [f"  repaired {own}: {what}" for own, what in self.repaired]
        lines += [f"  dropped {own}: {why}" for own, why in self.dropped]
        lines += [f"  default height for {own}: {why}" for own, why in self.guessed]
        return "\n".join(lines)


def _no_buildings(others: Sequence[tuple[str, str]]) -> str:
    what = "is no building" if len(others) == 1 else "are no buildings"
    return f"{what}: {reasons_in_words(others)}"


def read_outlines(
    path: str | Path, frame: LocalFrame, *, rule: HeightRule, region: Region | None = None
) -> tuple[tuple[Outline, ...], Report]:
    """Returns the valid outlines of a file around the map's origin, in the file's order.

    region: (x0, y0, x1, y1) in m; only buildings whose centre lies in it are used. None uses all.
    Raises `DataFileError` for an invalid file, or if the outlines are far from the map's origin.
    """
    features = read_features(path)
    selection = select_buildings(features)
    if features and not selection.buildings:
        raise DataFileError(
            f"{path}: it contains no outline of a building; all {len(features)} features "
            f"{_no_buildings(selection.others)}"
        )
    _check_position(path, selection.buildings, frame)
    repaired: list[tuple[str, str]] = []
    dropped: list[tuple[str, str]] = []
    outlines: list[Outline] = []
    outside = 0
    for feature in selection.buildings:
        footprint, mended, fault = _footprint(feature, frame)
        if fault:
            dropped.append((feature.id, fault))
            continue
        if region is not None and not _lies_in(footprint, region):
            outside += 1
            continue
        if mended:
            repaired.append((feature.id, mended))
        height = height_of(feature.tags, rule)
        outlines.append(Outline(feature.id, footprint, height, is_part(feature.tags)))
    outlines, filled = without_outlines_of_parts(outlines)
    kept, hidden = _without_hidden(outlines)
    return kept, Report(
        file=Path(path).name,
        outlines=len(features),
        buildings=len(kept),
        repaired=tuple(repaired),
        dropped=tuple(dropped + filled + hidden),
        guessed=tuple((o.id, o.height.fault) for o in kept if o.height.fault),
        heights=tuple(  # type: ignore[arg-type]  # three of them
            sum(o.height.source == source for o in kept)
            for source in ("height", "levels", "default")
        ),
        outside=outside,
        others=selection.others,
    )


def _check_position(path: str | Path, features: Sequence[Feature], frame: LocalFrame) -> None:
    rings = [ring for feature in features for polygon in feature.polygons for ring in polygon]
    corners = [ring for ring in rings if len(ring)]
    if not corners:
        raise DataFileError(f"{path}: it contains no outline of a building")
    middle = np.median(np.concatenate(corners), axis=0)
    away = float(np.linalg.norm(_in_map(middle[None], frame)))
    if away > MAX_DISTANCE_M:
        raise DataFileError(
            f"{path}: the outlines lie {away / 1000.0:.0f} km from the map's origin; they are "
            f"around latitude_deg = {middle[1]:.4f}, longitude_deg = {middle[0]:.4f} in "
            "[world.origin]"
        )


def _in_map(ring: Ring, frame: LocalFrame) -> Array:
    """Converts positions (n, 2) in degrees to x and y in the map, at the height of its origin."""
    longitude, latitude = np.radians(ring).T
    height = np.full(len(ring), frame.altitude_m)
    return frame.enu_from_geodetic(np.stack([latitude, longitude, height], axis=1))[:, :2]


def _footprint(feature: Feature, frame: LocalFrame) -> tuple[Any, str, str]:
    """Returns the footprint in the map, its repairs, or the reason for its absence."""
    import shapely

    if not feature.polygons:
        return None, "", f"{feature.shape} is no outline"
    mended: list[str] = []
    polygons = []
    for rings in feature.polygons:
        whole = [_closed(ring, mended) for ring in rings]
        sound = [_in_map(ring, frame) for ring in whole if len(ring) >= 4]
        if len(sound) < len(whole):
            mended.append("a ring of fewer than three corners left out")
        if sound and len(whole[0]) >= 4:
            polygons.append(shapely.Polygon(sound[0], sound[1:]))
    shape: Any = shapely.MultiPolygon(polygons)
    if not shape.is_valid:
        reason = shapely.is_valid_reason(shape).split("[")[0].lower()
        corners = shapely.get_num_coordinates(shape)
        if corners > _MAX_REPAIRED_CORNERS:
            return None, "", f"{reason}: {corners} corners are too many to be mended"
        mended.append(f"{reason}: rebuilt from the area it encloses")
        shape = shapely.make_valid(shape, method="structure", keep_collapsed=False)
    parts = [
        part
        for part in shapely.get_parts(shape)
        if part.geom_type == "Polygon" and part.area >= MIN_AREA_M2
    ]
    if not parts:
        return None, "", f"no area of {MIN_AREA_M2:g} m2"
    joined = shapely.orient_polygons(shapely.MultiPolygon(parts))
    return joined, "; ".join(dict.fromkeys(mended)), ""


def _closed(ring: Ring, mended: list[str]) -> Ring:
    """Returns the ring closed and without repeated corners."""
    if len(ring) and not np.array_equal(ring[0], ring[-1]):
        mended.append("open: closed")
        ring = np.concatenate([ring, ring[:1]])
    fresh = np.ones(len(ring), dtype=bool)
    fresh[1:] = (ring[1:] != ring[:-1]).any(axis=1)
    return ring[fresh]


def _lies_in(footprint: Any, region: Region) -> bool:
    x0, y0, x1, y1 = footprint.bounds
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    return bool(region[0] <= x < region[2] and region[1] <= y < region[3])


def _without_hidden(
    outlines: Sequence[Outline],
) -> tuple[tuple[Outline, ...], list[tuple[str, str]]]:
    """Removes duplicates, and buildings inside one at least as tall; keeps the first duplicate."""
    import shapely

    if not outlines:
        return (), []
    tree = shapely.STRtree([outline.footprint for outline in outlines])
    gone = _exact_twins(outlines)
    for inner, own in enumerate(outlines):
        if inner in gone:
            continue
        for outer in sorted(tree.query(own.footprint).tolist()):
            why = "" if outer in gone else _hidden(outlines, inner, outer)
            if why:
                gone[inner] = why
                break
    kept = tuple(outline for k, outline in enumerate(outlines) if k not in gone)
    return kept, [(outlines[k].id, why) for k, why in sorted(gone.items())]


def _exact_twins(outlines: Sequence[Outline]) -> dict[int, str]:
    """Finds exact duplicates of footprint and height: a file may contain a building many times."""
    first: dict[tuple[bytes, float, float], int] = {}
    gone = {}
    for k, outline in enumerate(outlines):
        height = outline.height
        same = first.setdefault((outline.footprint.wkb, height.height_m, height.base_m), k)
        if same != k:
            gone[k] = f"the same as {outlines[same].id}"
    return gone


def _hidden(outlines: Sequence[Outline], inner: int, outer: int) -> str:
    """Returns the reason why one building makes the other superfluous; empty if it does not."""
    a, b = outlines[inner], outlines[outer]
    if inner == outer or a.height.height_m > b.height.height_m:
        return ""
    if a.height.base_m < b.height.base_m:
        return ""
    size, other = a.footprint.area, b.footprint.area
    if size > other * (2.0 - _SAME):
        return ""
    as_high = (a.height.height_m, a.height.base_m) == (b.height.height_m, b.height.base_m)
    twins = size > _SAME * other and as_high
    if twins and inner < outer:  # the first one remains
        return ""
    if a.footprint.intersection(b.footprint).area < _SAME * size:
        return ""
    return f"the same as {b.id}" if twins else f"hidden inside {b.id}, which is as tall"
