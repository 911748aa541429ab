"""Conifers: pines with tufts of long needles, and spruces with flat hanging sprays."""

from __future__ import annotations

import numpy as np

from volery.world.trees.branches import Branches, across, concatenated, grow, turned, unit
from volery.world.trees.foliage import Blades
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

_WHORL = 5
"""Branches of a spruce that leave the stem at about one height."""


def pine(site: Site) -> Growth:
    """Grows one variant of a pine: few stout branches, tufts at the ends of twigs."""
    trunk = stem(site)
    limbs = _limbs(site, trunk, whorl=3, wobble=0.16)
    number = site.count(site.species.crown.twigs)
    rng, count = site.rng, len(limbs.points)
    fraction = np.linspace(0.4, 0.95, number) + rng.uniform(-0.05, 0.05, (count, number))
    base, tangent, thickness = limbs.at(fraction)
    angle = rng.normal(0.8, 0.15, fraction.shape)
    roll = np.where(np.arange(number) % 2 == 0, 0.0, np.pi) + rng.normal(0.0, 0.5, fraction.shape)
    length = (limbs.lengths[:, None] * rng.uniform(0.16, 0.34, fraction.shape)).ravel()
    length = np.maximum(length, 0.12)
    shoots = grow(
        rng,
        base.reshape(-1, 3),
        turned(tangent, angle, roll).reshape(-1, 3),
        length,
        np.minimum(0.8 * thickness.ravel(), 0.012 * length + 0.004),
        segments=3,
        lift=0.7,
        wobble=0.1,
        tip=0.6,
    )
    return Growth(trunk, [limbs, shoots], _tufts(site, trunk, limbs, shoots))


def _tufts(site: Site, trunk: Branches, limbs: Branches, shoots: Branches) -> Blades:
    """Grows needle blades in all directions from the ends of stem, limbs and shoots."""
    leaf, rng = site.species.leaf, site.rng
    assert leaf is not None
    ends = [b.points[:, -1] for b in (shoots, limbs, trunk)]
    heads = [unit(b.points[:, -1] - b.points[:, -2]) for b in (shoots, limbs, trunk)]
    # a second tuft a little behind each end makes the brush
    behind = 0.6 * leaf.length_m
    centres = np.concatenate([*ends, *(e - behind * h for e, h in zip(ends, heads, strict=True))])
    pointing = np.concatenate([*heads, *heads])
    order = np.argsort(np.arctan2(centres[:, 1], centres[:, 0]) + 7.0 * (centres[:, 2] // 1.0))
    centres, pointing = centres[order], pointing[order]
    count, area = leaf_count(site)
    tuft = (np.arange(count) * len(centres)) // count
    axis = unit(0.75 * pointing[tuft] + unit(rng.normal(0.0, 1.0, (count, 3))))
    axis = unit(axis - leaf.droop * np.array([0.0, 0.0, 1.0]))
    first, second = across(axis)
    spin = rng.uniform(0.0, np.pi, (count, 1))
    side = np.cos(spin) * first + np.sin(spin) * second
    length = leaf.length_m * rng.uniform(0.7, 1.2, count)
    middle = centres[tuft] + 0.5 * length[:, None] * axis
    width = leaf.width_m * np.ones(count)
    blades = Blades(middle, axis, side, length, width)
    # needles have one length at any age: the width provides the remaining area
    return Blades(middle, axis, side, length, width * area / blades.area)


def spruce(site: Site) -> Growth:
    """Grows one variant of a spruce: whorls down the stem, shoots in a plane, hanging sprays."""
    trunk = stem(site)
    limbs = _limbs(site, trunk, whorl=_WHORL, wobble=0.07)
    number = site.count(site.species.crown.twigs)
    rng, count = site.rng, len(limbs.points)
    fraction = np.linspace(0.25, 0.9, number) + rng.uniform(-0.05, 0.05, (count, number))
    base, tangent, thickness = limbs.at(fraction)
    angle = rng.normal(0.9, 0.12, fraction.shape)
    roll = np.where(np.arange(number) % 2 == 0, 0.0, np.pi) + rng.normal(0.0, 0.2, fraction.shape)
    taper = (0.5 - 0.38 * fraction) * rng.uniform(0.8, 1.2, fraction.shape)
    length = (limbs.lengths[:, None] * taper).ravel()
    shoots = grow(
        rng,
        base.reshape(-1, 3),
        turned(tangent, angle, roll).reshape(-1, 3),
        length,
        np.minimum(0.7 * thickness.ravel(), 0.01 * length + 0.002),
        segments=5,
        lift=-0.25,
        wobble=0.06,
    )
    bearing = concatenated([limbs, shoots])
    leaves, area = leaf_count(site)
    points, tangents = along(bearing, leaves, rng, start=0.12)
    blades = flat_leaves(points, tangents, site, forward=0.9, tilt=0.5).with_area(area)
    return Growth(trunk, [limbs, shoots], blades)


def _limbs(site: Site, trunk: Branches, *, whorl: int, wobble: float) -> Branches:
    """Grows branches in loose whorls of `whorl` down from the top."""
    crown, rng = site.species.crown, site.rng
    count = site.count(crown.branches)
    step = np.arange(count) // whorl
    fraction = (step + 0.5 + rng.uniform(-0.3, 0.3, count)) / (step[-1] + 1)
    depth = site.height - site.crown_base
    height = site.crown_base + 0.97 * depth * fraction
    base, thickness = on_stem(trunk, height)
    low, high = np.radians(crown.angle_deg)
    angle = low + (high - low) * fraction + rng.normal(0.0, 0.1, count)
    azimuth = 2.0 * np.pi / whorl * np.arange(count) + GOLDEN_ANGLE * step
    azimuth = azimuth + rng.normal(0.0, 0.25, count)
    upright = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
    spread = site.crown_radius * site.envelope(fraction) * rng.uniform(0.8, 1.05, count)
    length = np.maximum(spread / np.maximum(np.sin(angle - 0.3 * crown.lift), 0.6), 0.08)
    radius = np.minimum(0.5 * thickness, 0.012 * length + 0.005)
    return grow(
        rng,
        base,
        turned(upright, angle, azimuth),
        length,
        radius,
        segments=5,
        lift=crown.lift,
        wobble=wobble,
        tip=0.4,
    )
