"""Broad-leaved trees: a leading stem, limbs, shoots and twigs with leaves in two rows."""

from __future__ import annotations

import numpy as np

from volery.world.trees.branches import Branches, concatenated, grow, turned
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

_TWIGS_FROM = 0.2
"""Minimum maturity at which shoots carry twigs of their own."""


def broadleaf(site: Site) -> Growth:
    """Grows one variant."""
    trunk = stem(site)
    limbs = _limbs(site, trunk)
    shoots = _side_shoots(site, limbs, site.count(site.species.crown.twigs), 0.25, 0.52)
    branch_orders = [limbs, shoots]
    if site.maturity >= _TWIGS_FROM:
        branch_orders.append(_side_shoots(site, shoots, 4, 0.2, 0.55))
    bearing = concatenated([b.decimated(2) for b in branch_orders[1:]])
    count, area = leaf_count(site)
    points, tangents = along(bearing, count, site.rng)
    blades = flat_leaves(points, tangents, site, forward=0.7, tilt=0.35).with_area(area)
    return Growth(trunk, branch_orders, blades)


def _limbs(site: Site, trunk: Branches) -> Branches:
    """Grows limbs on the stem, up to the crown's envelope."""
    crown, rng = site.species.crown, site.rng
    count = site.count(crown.branches)
    height_fraction = (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    depth = site.height - site.crown_base
    # limbs crowd towards the crown's base, where they are largest
    height = site.crown_base + 0.93 * depth * height_fraction**1.15
    base, thickness = on_stem(trunk, height)
    low, high = np.radians(crown.angle_deg)
    angle = low + (high - low) * height_fraction + rng.normal(0.0, 0.12, count)
    azimuth = GOLDEN_ANGLE * np.arange(count) + rng.normal(0.0, 0.4, count)
    upright = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 3))
    direction = turned(upright, angle, azimuth)
    mean_angle = np.clip(angle - 0.45 * crown.lift, 0.25, 1.5)
    spread = site.crown_radius * site.envelope(height_fraction) * rng.uniform(0.75, 1.05, count)
    length = spread / np.maximum(np.sin(mean_angle), 0.5)
    room = (site.height - height) / np.maximum(np.cos(mean_angle), 0.15)
    length = np.minimum(length, np.maximum(room, 0.15 * site.crown_radius))
    radius = np.minimum(0.62 * thickness, 0.016 * length + 0.004)
    return grow(
        rng, base, direction, length, radius, segments=5, lift=crown.lift, wobble=0.13, tip=0.35
    )


def _side_shoots(
    site: Site, parents: Branches, number: int, first: float, fraction_of_length: float
) -> Branches:
    """Grows `number` shoots on each parent, alternating left and right, and one continuation."""
    rng, count = site.rng, len(parents.points)
    fraction = np.linspace(first, 0.96, number) + rng.uniform(-0.06, 0.04, (count, number))
    fraction = np.concatenate([fraction, np.full((count, 1), 1.0)], axis=1)
    base, tangent, thickness = parents.at(fraction)
    angle = np.concatenate(
        [rng.normal(0.85, 0.2, (count, number)), rng.normal(0.0, 0.15, (count, 1))], axis=1
    )
    row = np.where(np.arange(number + 1) % 2 == 0, 0.0, np.pi)
    roll = row + rng.normal(0.0, 0.55, (count, number + 1))
    direction = turned(tangent, angle, roll)
    taper = fraction_of_length * (1.15 - 0.6 * fraction) * rng.uniform(0.7, 1.25, fraction.shape)
    length = (parents.lengths[:, None] * taper).ravel()
    radius = np.minimum(0.7 * thickness.ravel(), 0.012 * length + 0.0015)
    return grow(
        rng,
        base.reshape(-1, 3),
        direction.reshape(-1, 3),
        length,
        radius,
        segments=4,
        lift=0.12,
        wobble=0.12,
    )
