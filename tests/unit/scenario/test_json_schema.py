"""The JSON schema of scenarios: complete for editors, as strict as the loader about keys."""

import datetime
import json
import tomllib

import pytest
from typer.testing import CliRunner

from volery.cli.app import app
from volery.core.errors import ScenarioError
from volery.scenario import list_scenarios, load_scenario, parse_scenario
from volery.scenario.json_schema import models, scenario_schema, schema_text, write_schema
from volery.scenario.library import path_of
from volery.scenario.toml_writer import SCHEMA_DIRECTIVE, SCHEMA_FILE


@pytest.fixture(scope="module")
def schema():
    return scenario_schema()


@pytest.fixture(scope="module")
def validator(schema):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is of the extra 'test'")
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def plain(value):
    """TOML's data as an editor checks them: dates are texts."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return value.isoformat() if isinstance(value, datetime.date) else value


def nodes_of(node):
    """All tables of a schema, nested ones included."""
    if isinstance(node, dict):
        yield node
        for inner in node.values():
            yield from nodes_of(inner)
    elif isinstance(node, list):
        for inner in node:
            yield from nodes_of(inner)


# ------------------------------------------------------------------------------------- for editors


@pytest.mark.parametrize("name", list_scenarios())
def test_shipped_scenarios_name_the_schema_and_satisfy_it(name, validator):
    text = path_of(name).read_text(encoding="utf-8")
    assert text.split("\n", 1)[0] == SCHEMA_DIRECTIVE
    assert [error.message for error in validator.iter_errors(plain(tomllib.loads(text)))] == []


def test_a_saved_scenario_names_the_schema_beside_it_and_satisfies_it(validator, tmp_path):
    load_scenario("hover").save(tmp_path / "mine.toml")
    text = (tmp_path / "mine.toml").read_text(encoding="utf-8")
    directive, _, rest = text.partition("\n")
    assert directive == f"#:schema ./{SCHEMA_FILE}"
    assert not list(validator.iter_errors(plain(tomllib.loads(rest))))


@pytest.mark.parametrize(
    "changes",
    [
        {"colour": "red"},
        {"ends_when": "later"},
        {"seed": -1},
        {"duration_s": "long"},
        {"uavs": []},
        {"types": {"Upper": {}}},
        {"world": {"wind": {"velocity_m_s": [1.0, 2.0]}}},
        {"world": {"terrain": {"extent_m": 100.0}}},
        {"world": {"terrain": {"kind": "round"}}},
        {"faults": [{"kind": "motor", "uav": "uav1"}]},
    ],
)
def test_both_schema_and_loader_reject(changes, validator, flat_data):
    assert validator.is_valid(flat_data)
    assert not validator.is_valid({**flat_data, **changes})
    with pytest.raises(ScenarioError):
        parse_scenario({**flat_data, **changes})


def test_each_key_of_each_table_has_a_description_with_its_unit(schema):
    tables = {**schema["$defs"], "Scenario": schema}
    assert set(tables) == {model.__name__ for model in models()}
    for model in models():
        properties = tables[model.__name__]["properties"]
        assert set(properties) == set(model.model_fields)
        assert all(value["description"].strip() for value in properties.values())
    wind = tables["Wind"]["properties"]["velocity_m_s"]
    assert wind["description"] == "Steady wind. Unit: m/s."
    rain = tables["Weather"]["properties"]["rain_mm_h"]
    assert rain["description"].endswith("Unit: mm/h.")


def test_references_lead_somewhere(schema):
    found = [node["$ref"] for node in nodes_of(schema) if isinstance(node.get("$ref"), str)]
    assert len(found) > 40
    assert {name.removeprefix("#/$defs/") for name in found} == set(schema["$defs"])


def test_values_that_toml_lacks_do_not_occur(schema):
    assert not [node for node in nodes_of(schema) if None in node.values()]
    assert {"type": "null"} not in list(nodes_of(schema))


# ----------------------------------------------------------------------------------- volery schema


def test_the_command_prints_the_schema(schema):
    done = CliRunner().invoke(app, ["schema"])
    assert done.exit_code == 0
    assert json.loads(done.stdout) == schema


def test_the_command_writes_a_file(schema, tmp_path):
    done = CliRunner().invoke(app, ["schema", "--out", str(tmp_path / SCHEMA_FILE)])
    assert done.exit_code == 0
    assert (tmp_path / SCHEMA_FILE).read_text(encoding="utf-8") == schema_text()


def test_a_missing_folder_is_reported(tmp_path):
    with pytest.raises(ScenarioError, match=r"none.a\.json: cannot be written: No such file"):
        write_schema(tmp_path / "none" / "a.json")
