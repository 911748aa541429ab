"""Simple recognisable shapes: a person, a car, a bird.

Frames are FLU. The origin of a person and of a car lies on the ground below the centre, that of a
bird in its centre. Parts are closed and a millimetre apart, so that an upward ray from inside a
part meets its own top first (see `Solid`). Sizes are everyday ones (modelling choices).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from volery.world.actors.primitives import box, ellipsoid, plate, wheel
from volery.world.materials import Material
from volery.world.mesh import concatenate
from volery.world.scene_content import BodyShape


def person() -> BodyShape:
    """Returns a person 1.75 m tall, in mid-stride, arms at the sides."""
    clothes = [
        box([0.05, 0.03, 0.0], [0.21, 0.17, 0.849]),  # left leg, ahead
        box([-0.21, -0.17, 0.0], [-0.05, -0.03, 0.849]),
        box([-0.13, -0.20, 0.85], [0.13, 0.20, 1.449]),
        box([-0.18, 0.22, 0.95], [-0.06, 0.32, 1.43]),  # left arm, behind
        box([0.06, -0.32, 0.95], [0.18, -0.22, 1.43]),
    ]
    skin = [
        ellipsoid([0.0, 0.0, 1.60], [0.10, 0.08, 0.15]),
        box([-0.17, 0.23, 0.80], [-0.07, 0.31, 0.949]),  # hands
        box([0.07, -0.31, 0.80], [0.17, -0.23, 0.949]),
    ]
    return BodyShape(((concatenate(clothes), Material.CLOTHES), (concatenate(skin), Material.SKIN)))


def car() -> BodyShape:
    """Returns a car 4.4 m long, 1.8 m wide, 1.45 m high, facing along x."""
    paint = [
        box([-2.2, -0.9, 0.45], [2.2, 0.9, 0.85]),
        box([-1.7, -0.6, 0.25], [1.7, 0.6, 0.449]),  # floor between the wheels
        box([-1.4, -0.75, 1.35], [0.6, 0.75, 1.45]),  # roof
    ]
    dark = [box([-1.6, -0.8, 0.851], [0.9, 0.8, 1.349])]  # windows all around
    dark += [wheel([x, y, 0.224], 0.224, 0.2) for x in (-1.35, 1.35) for y in (-0.75, 0.75)]
    return BodyShape(
        ((concatenate(paint), Material.CAR_PAINT), (concatenate(dark), Material.RUBBER))
    )


def bird() -> BodyShape:
    """Returns a large gull: 1.3 m of slightly raised wings, .6 m long, facing along x."""
    parts = [
        ellipsoid([0.0, 0.0, 0.0], [0.22, 0.07, 0.07]),
        ellipsoid([0.27, 0.0, 0.03], [0.06, 0.045, 0.045], sides=8, rings=6),
        plate(
            [[0.12, 0.08, 0.02], [0.02, 0.65, 0.14], [-0.08, 0.65, 0.14], [-0.10, 0.08, 0.02]], 0.02
        ),
        plate(
            [[-0.10, -0.08, 0.02], [-0.08, -0.65, 0.14], [0.02, -0.65, 0.14], [0.12, -0.08, 0.02]],
            0.02,
        ),
        plate(
            [[-0.23, 0.03, 0.0], [-0.38, 0.09, 0.0], [-0.38, -0.09, 0.0], [-0.23, -0.03, 0.0]], 0.02
        ),
    ]
    return BodyShape(((concatenate(parts), Material.PLUMAGE),))


SHAPES: Mapping[str, Callable[[], BodyShape]] = MappingProxyType(
    {"person": person, "car": car, "bird": bird}
)
