"""An assignment: what submissions fly, with which seeds, limits and points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PositiveFloat

from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss
from volery.scenario import library
from volery.scenario.base import Data
from volery.scenario.data_files import load_data_file
from volery.scenario.expectations import names_of
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

_Pattern = Annotated[str, Field(pattern=r"^/[\w*?/]+$", max_length=200)]


class AssignmentFile(Data):
    """The TOML file of an assignment."""

    scenario: str
    """Shipped scenario, or a file relative to this one; its expectations give the points."""
    node: Annotated[str, Field(pattern=r"^[A-Za-z_]\w*$")] = "Pilot"
    """Class of the node in each submission."""
    uav: Annotated[str, Field(pattern=r"^uav[1-9]\d*$")] = "uav1"
    """UAV that the node flies."""
    seeds: Annotated[int, Field(ge=1, le=1000)] = 3
    """Number of flights of each submission, with consecutive seeds."""
    first_seed: Annotated[int, Field(ge=0)] = 1
    """First of these seeds."""
    period_s: Annotated[float, Field(ge=0.001, le=10.0)] = 0.02
    """Simulated time between two exchanges with the node, in lock step."""
    timeout_s: PositiveFloat = 60.0
    """Wall time of the node for a flight, including its start."""
    memory_mb: Annotated[int, Field(ge=64)] = 4096
    """Greatest address space of the node's process, MB."""
    points: dict[str, Annotated[float, Field(ge=0.0)]] = Field(default_factory=dict)
    """Points by the names of expectations; those that are not named have 1."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Parameters of the node."""
    reads: tuple[_Pattern, ...] = ()
    """Patterns of topics that the node may read beside those of its UAV, `/clock` and `/tf`."""
    writes: tuple[_Pattern, ...] = ()
    """Patterns of topics and services that it may use beside those of its UAV."""


@dataclass(frozen=True)
class Assignment:
    """An assignment with its scenario."""

    name: str
    """Name of the file without its ending."""
    path: Path
    """The file."""
    terms: AssignmentFile
    """Its content."""
    scenario: Scenario
    """What is flown."""

    @property
    def seeds(self) -> range:
        """Seeds of the flights."""
        return range(self.terms.first_seed, self.terms.first_seed + self.terms.seeds)

    @property
    def points(self) -> Mapping[str, float]:
        """Points by the names of all expectations."""
        names = names_of(self.scenario.expect)
        return {name: self.terms.points.get(name, 1.0) for name in names}


def load_assignment(path: Path) -> Assignment:
    """Reads an assignment; its scenario is trusted, as the teacher's own.

    Raises `ScenarioError` or `DataFileError` for an invalid file, a scenario that expects nothing,
    and points for an unknown expectation.
    """
    terms = load_data_file(path, AssignmentFile)
    is_shipped = terms.scenario in library.names()
    source = terms.scenario if is_shipped else path.parent / terms.scenario
    scenario = load_scenario(source, trust=True)
    if not scenario.expect:
        raise ScenarioError(f"{source}: expects nothing: add [[expect]] (docs/scenario_tests.md)")
    if int(terms.uav.removeprefix("uav")) > scenario.uav_count:
        raise ScenarioError(f"{path}: key 'uav': no '{terms.uav}' among {scenario.uav_count}")
    names = names_of(scenario.expect)
    for name in terms.points:
        if name not in names:
            raise ScenarioError(
                f"{path}: key 'points': no expectation '{name}'{near_miss(name, names)}; "
                f"expected: {', '.join(names)}"
            )
    return Assignment(path.stem, path, terms, scenario)
