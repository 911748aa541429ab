"""Shapes of the airframes for the page, written from their data files.

    python tools/typescript_airframes.py > web/src/scene/uavs/airframes.generated.ts

The page draws a UAV from its airframe's file: positions of rotors and feet, the body's box, and
colours, which are those that cameras see.
"""

from __future__ import annotations

import json
import sys

from volery.vehicle.airframe import Airframe, Colour, Colours, airframe_names, load_airframe
from volery.vehicle.body_shape import MATERIAL_OF
from volery.world.materials import PROPERTIES

_HEAD = """\
// Written by `python tools/typescript_airframes.py` from the airframes' data files.
// A test of the project fails when this file is older than they are.

/** Body axes: x forward, y left, z up; metres. */
export interface AirframeShape {
  title: string;
  /** Sides of the box between the rotors. */
  size: readonly [number, number, number];
  rotorRadius: number;
  /** x, y, z, axis x, y, z, and 1 for counter-clockwise seen from above, else -1. */
  rotors: readonly (readonly number[])[];
  feet: readonly (readonly number[])[];
  colours: AirframeColours;
}

export interface AirframeColours {
  front: string;
  back: string;
  plates: string;
  legs: string;
}

export const AIRFRAMES: Readonly<Record<string, AirframeShape>> = {
"""


def declarations() -> str:
    """Returns the whole file."""
    shapes = [_shape(load_airframe(name)) for name in airframe_names()]
    usual = _colours(Colours()).strip("{ }").replace(", ", ",\n  ")
    usual = (
        "\n/** Of an airframe without colours. */\n"
        f"export const USUAL_COLOURS: AirframeColours = {{\n  {usual},\n}};\n"
    )
    return _HEAD + "".join(shapes) + "};\n" + usual


def _shape(airframe: Airframe) -> str:
    rotors = airframe.rotors
    places = [
        [*place.position_m, *place.axis, 1 if place.direction == "ccw" else -1]
        for place in rotors.places
    ]
    lines = [
        f"  {airframe.name}: {{",
        f"    title: {json.dumps(airframe.title)},",
        f"    size: {_row(airframe.body.size_m)},",
        f"    rotorRadius: {rotors.radius_m:g},",
        "    rotors: [",
        *(f"      {_row(place)}," for place in places),
        "    ],",
        "    feet: [",
        *(f"      {_row(foot)}," for foot in airframe.ground.feet_m),
        "    ],",
        f"    colours: {_colours(airframe.colours)},",
        "  },",
    ]
    return "\n".join(lines) + "\n"


def _colours(colours: Colours) -> str:
    parts = ("front", "back", "plates", "legs")
    return "{ " + ", ".join(f'{part}: "{_hex(getattr(colours, part))}"' for part in parts) + " }"


def _hex(colour: Colour) -> str:
    """Returns a colour as `#rrggbb`, sRGB."""
    linear = PROPERTIES[MATERIAL_OF[colour]]["colours"][0]
    coded = [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]
    return "#" + "".join(f"{round(255 * c):02x}" for c in coded)


def _row(numbers: tuple[float, ...] | list[float]) -> str:
    return f"[{', '.join(f'{number:g}' for number in numbers)}]"


if __name__ == "__main__":
    sys.stdout.write(declarations())
