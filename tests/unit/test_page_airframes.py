"""The page draws airframes as their data files are now."""

from pathlib import Path
from runpy import run_path

import pytest

from volery.vehicle.airframe import airframe_names, load_airframe

ROOT = Path(__file__).parents[2]
WRITTEN = ROOT / "web/src/scene/uavs/airframes.generated.ts"
declarations = run_path(str(ROOT / "tools" / "typescript_airframes.py"))["declarations"]


@pytest.mark.skipif(not WRITTEN.parent.is_dir(), reason="the page's sources are not here")
def test_the_pages_airframes_are_those_of_the_data_files():
    assert WRITTEN.read_text() == declarations(), (
        "run python tools/typescript_airframes.py > web/src/scene/uavs/airframes.generated.ts"
    )


def test_every_airframe_is_exported_with_all_its_rotors():
    text = declarations()
    for name in airframe_names():
        shape = text[text.index(f"  {name}: {{") :]
        rotors = shape[shape.index("rotors: [") : shape.index("feet: [")]
        assert rotors.count("],") - 1 == len(load_airframe(name).rotors.places)
