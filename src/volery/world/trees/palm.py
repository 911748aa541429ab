"""Palms: one slender stem and a head of arching feather fronds."""

from __future__ import annotations

import numpy as np

from volery.world.trees.branches import grow, turned
from volery.world.trees.growth import (
    GOLDEN_ANGLE,
    Growth,
    Site,
    along,
    flat_leaves,
    leaf_count,
    on_stem,
    stem,
)


def palm(site: Site) -> Growth:
    """Grows one variant."""
    crown, rng = site.species.crown, site.rng
    frond = 1.25 * site.crown_radius
    top = max(site.height - 0.7 * frond, 0.45 * site.height)
    trunk = stem(site, top=top)
    count = site.count(crown.branches)
    age = (np.arange(count) + rng.uniform(0.0, 1.0, count)) / count
    base, thickness = on_stem(trunk, top - 0.25 * (1.0 - age))
    low, high = np.radians(crown.angle_deg)
    angle = low + (high - low) * age + rng.normal(0.0, 0.08, count)
    azimuth = GOLDEN_ANGLE * np.arange(count) + rng.normal(0.0, 0.15, count)
    upright = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
    length = frond * rng.uniform(0.85, 1.1, count)
    fronds = grow(
        rng,
        base,
        turned(upright, angle, azimuth),
        length,
        np.minimum(0.5 * thickness, 0.03),
        segments=8,
        lift=crown.lift,
        wobble=0.03,
        tip=0.15,
    )
    leaves, area = leaf_count(site)
    start = 0.14
    points, tangents = along(fronds, leaves, rng, start=start)
    # leaflets are longest in the middle of a frond
    phase = (np.arange(leaves) * count / leaves) % 1.0
    grown = 0.45 + 0.65 * np.sin(np.pi * np.clip(phase + 0.08, 0.0, 1.0))
    blades = flat_leaves(points, tangents, site, forward=0.55, tilt=0.3, grown=grown)
    return Growth(trunk, [fronds], blades.with_area(area))
