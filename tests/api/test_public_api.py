"""What is public is listed and documented; a change of the list is deliberate."""

import re
from pathlib import Path

import pytest

from volery.core.quantities import quantity_of

ROOT = Path(__file__).parents[2]
DIMENSION = r"(?:\.\.\.|`?[A-Z][\w.]*`?|`?\w+\.\w+`?|n|\d+(?: to \w+)?)"
SHAPE = re.compile(rf"\({DIMENSION}(?:,|(?:, {DIMENSION})+)\)")
"""A shape such as (3,), (K, n, 3) or (N, MAX_ROTORS)."""
UNIT = re.compile(
    r"\b(m|m/s|m/s\^2|rad|rad/s|rad/s\^2|degrees|s|ns|Hz|N|V|A|W|T|Pa|kg|quaternions?|x y z w"
    r"|fraction|factor|mask|numbers|whether|`vehicle\.battery\.BatteryLevel`|over)\b"
)
"""A unit, or a word for something without one."""
ARRAY = re.compile(r"\b(Array|ArrayLike|NDArray)\b")
FLOAT = re.compile(r": float( \||  ?\[| =|$)")


@pytest.fixture(scope="module")
def entries(public_api):
    return public_api.entries()


def test_the_list_is_up_to_date(public_api):
    found = "\n".join(public_api.differences())
    remedy = "see docs/api_stability.md, then run: python tools/public_api.py"
    assert not found, f"the public API has changed; {remedy}\n{found}"


def test_all_is_documented(entries):
    missing = [entry.name for entry in entries if not entry.doc.strip()]
    assert not missing, f"{len(missing)} of {len(entries)} public names lack a docstring: {missing}"


def test_arrays_have_shapes_and_units(entries):
    arrays = [entry for entry in entries if ARRAY.search(entry.declaration)]
    assert len(arrays) > 40
    without_shape = [entry.name for entry in arrays if not SHAPE.search(entry.doc)]
    without_unit = [entry.name for entry in arrays if not UNIT.search(entry.doc)]
    assert (without_shape, without_unit) == ([], [])


def test_numbers_have_units_in_their_names_or_docstrings(entries):
    missing = [
        entry.name
        for entry in entries
        if FLOAT.search(entry.declaration)
        and quantity_of(entry.name.rsplit(".", 1)[-1]) is None
        and not UNIT.search(entry.doc)
    ]
    assert missing == []


def test_the_document_names_the_public_modules(public_api):
    text = (ROOT / "docs" / "api_stability.md").read_text()
    listed = set(re.findall(r"^\| `([\w.]+)`", text, re.MULTILINE))
    handles = {path.replace(":", ".") for path in public_api.HANDLES}
    assert listed == {*public_api.MODULES, *handles}


# ----------------------------------------------------------------------------- what the list shows


def test_the_list_shows_signatures_values_and_aliases(entries):
    lines = {entry.name: entry.line for entry in entries}
    assert lines["volery.make"].startswith("volery.make(scenario: str | Path | Scenario, changes:")
    assert lines["volery.FlightMode.LAND"] == "volery.FlightMode.LAND = 5"
    assert lines["volery.Simulation.time_s"] == "volery.Simulation.time_s: float [property]"
    assert lines["volery.scenario.Wind.field"] == "volery.scenario.Wind.field: str | None = None"
    assert lines["volery.scenario.Scenario"] == (
        "volery.scenario.Scenario is volery.scenario.schema.Scenario"
    )


def test_a_changed_signature_is_reported(public_api, monkeypatch):
    def run(self, seconds: float) -> None:
        """Runs."""

    monkeypatch.setattr("volery.runtime.simulation.Simulation.run", run)
    assert "+volery.Simulation.run(self, seconds: float) -> None" in public_api.differences()
