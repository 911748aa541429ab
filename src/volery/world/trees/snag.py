"""Dead trees: a broken trunk with splinters and a few broken limbs."""

from __future__ import annotations

import numpy as np

from volery.world.trees.branches import Branches, concatenated, grow, turned
from volery.world.trees.growth import GOLDEN_ANGLE, Growth, Site, on_stem, stem


def snag(site: Site) -> Growth:
    """Grows one variant."""
    rng = site.rng
    splinter = float(np.clip(1.6 * site.dbh, 0.1, 0.8))
    top = site.height - 0.8 * splinter
    trunk = stem(site, top=top, broken=0.35)
    return Growth(
        trunk,
        [concatenated([_limbs(site, trunk, rng), _splinters(trunk, splinter, rng)])],
        capped=True,
    )


def _limbs(site: Site, trunk: Branches, rng: np.random.Generator) -> Branches:
    crown = site.species.crown
    count = site.count(crown.branches)
    fraction = (np.arange(count) + rng.random(count)) / count
    height = site.crown_base + 0.9 * (site.height - site.crown_base) * fraction * 0.95
    base, thickness = on_stem(trunk, height)
    low, high = np.radians(crown.angle_deg)
    angle = low + (high - low) * fraction + rng.normal(0.0, 0.15, count)
    azimuth = GOLDEN_ANGLE * np.arange(count) + rng.normal(0.0, 0.5, count)
    upright = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
    # most limbs broke close to the trunk, a few are whole
    length = site.crown_radius * (0.15 + 0.95 * rng.random(count) ** 1.4)
    return grow(
        rng,
        base,
        turned(upright, angle, azimuth),
        length,
        np.minimum(0.4 * thickness, 0.03 * length + 0.012),
        segments=4,
        lift=crown.lift,
        wobble=0.2,
        tip=0.45,
    )


def _splinters(trunk: Branches, length: float, rng: np.random.Generator) -> Branches:
    count = 4
    turn = 2.0 * np.pi * (np.arange(count) + rng.random(count) * 0.6) / count
    end, radius = trunk.points[0, -1], trunk.radii[0, -1]
    out = np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    base = end + 0.55 * radius * out - np.array([0.0, 0.0, 0.15 * length])
    lengths = length * rng.uniform(0.5, 1.0, count)
    direction = np.array([0.0, 0.0, 1.0]) + 0.12 * out
    return grow(
        rng,
        base,
        direction,
        lengths,
        np.full(count, 0.42 * radius),
        segments=4,
        tip=0.08,
        wobble=0.03,
    )
