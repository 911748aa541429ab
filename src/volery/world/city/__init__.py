"""Cities from building outlines.

geojson.py     a file's features                tags.py       what is mapped of them
selection.py   the buildings among them         heights.py    heights of buildings
outlines.py    valid footprints, and a report   outline.py    one building
parts.py       outlines and parts               buildings.py  walls and roofs
streets.py     pavement and asphalt             furniture.py  lamps and street trees
city.py        all of it together
"""

from volery.world.city.buildings import Building, extruded
from volery.world.city.city import City, build_city
from volery.world.city.furniture import FurnitureRule
from volery.world.city.heights import HeightRule
from volery.world.city.outlines import Report, read_outlines
from volery.world.city.streets import StreetRule

__all__ = [
    "Building",
    "City",
    "FurnitureRule",
    "HeightRule",
    "Report",
    "StreetRule",
    "build_city",
    "extruded",
    "read_outlines",
]
