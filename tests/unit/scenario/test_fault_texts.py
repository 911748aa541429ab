"""Errors of values say what is needed in plain words, not as a regular expression."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from volery.bridges.nodes.profile import Profile
from volery.cluster.study import Study
from volery.grading.assignment import AssignmentFile
from volery.scenario.fault_texts import fault_text
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe
from volery.vehicle.identified import IdentifiedModel


def patterns_of(schema: Any) -> Iterator[str]:
    """Yields all patterns of a JSON schema."""
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield schema["pattern"]
        for value in schema.values():
            yield from patterns_of(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from patterns_of(value)


@pytest.mark.parametrize(
    "model", [Airframe, AssignmentFile, IdentifiedModel, Profile, Scenario, Study]
)
def test_each_pattern_of_a_file_has_words(model):
    patterns = set(patterns_of(model.model_json_schema()))
    assert patterns
    for pattern in patterns:
        fault = {"type": "string_pattern_mismatch", "msg": "", "ctx": {"pattern": pattern}}
        assert " is needed" in fault_text(fault), pattern
