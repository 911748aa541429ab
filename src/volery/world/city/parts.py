"""Parts of buildings: where they fill an outline, they stand for it.

As OpenStreetMap's Simple 3D Buildings has it, the outline of a building with parts is no solid of
its own; a solid of the outline would fill the space below parts that hang in the air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from volery.core.plurals import counted
from volery.world.city.outline import Outline

_FILLED = 0.9
"""Fraction of an outline that its parts cover at least (modelling choice)."""
_INSIDE = 0.9
"""Fraction of a part that lies in its outline at least (modelling choice)."""


def without_outlines_of_parts(
    outlines: Sequence[Outline],
) -> tuple[list[Outline], list[tuple[str, str]]]:
    """Removes outlines that their parts fill; returns the others, and the ids and reasons.

    A part without a height has that of its outline, if this has one.
    """
    import shapely

    numbers = [k for k, outline in enumerate(outlines) if outline.is_part]
    if not numbers:
        return list(outlines), []
    kept: list[Outline | None] = list(outlines)
    dropped = []
    tree = shapely.STRtree([outlines[k].footprint for k in numbers])
    for number, outline in enumerate(outlines):
        if outline.is_part:
            continue
        near = [numbers[k] for k in sorted(tree.query(outline.footprint).tolist())]
        inside = [k for k in near if _lies_in(outlines[k], outline)]
        walls = shapely.union_all([outlines[k].footprint for k in inside])
        if walls.intersection(outline.footprint).area < _FILLED * outline.footprint.area:
            continue
        kept[number] = None
        dropped.append((outline.id, f"{counted(len(inside), 'part')} of it stand for it"))
        for k in inside:
            part = outlines[k]
            if part.height.source == "default" and outline.height.source != "default":
                kept[k] = replace(part, height=replace(outline.height, fault=part.height.fault))
    return [outline for outline in kept if outline is not None], dropped


def _lies_in(part: Outline, outline: Outline) -> bool:
    common = part.footprint.intersection(outline.footprint).area
    return bool(common >= _INSIDE * part.footprint.area)
