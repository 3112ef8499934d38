"""The schema is valid draft-07 and accepts and rejects the same documents as the models."""

import json
from typing import Any

import pytest
from jsonschema import Draft7Validator

from particlesim.errors import ScenarioError
from particlesim.scenario.schema import json_schema
from particlesim.scenario.text.source import parse_source

from .toy import GOOD, Scenario, load

SCHEMA = json_schema(Scenario, identifier="https://example.org/toy.schema.json")


def accepts(text: str) -> bool:
    return bool(Draft7Validator(SCHEMA).is_valid(parse_source(text).raw))


def test_draft_and_identifier() -> None:
    Draft7Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert SCHEMA["$id"] == "https://example.org/toy.schema.json"
    assert SCHEMA["additionalProperties"] is False


def test_nothing_of_later_drafts_is_left() -> None:
    text = json.dumps(SCHEMA)
    for keyword in ("$defs", "prefixItems", "discriminator", '"null"', ": null"):
        assert keyword not in text


def test_references_resolve_and_stand_alone() -> None:
    def walk(node: Any) -> None:
        if isinstance(node, dict):
            if "$ref" in node:
                assert len(node) == 1
                assert node["$ref"].removeprefix("#/definitions/") in SCHEMA["definitions"]
            for child in node.values():
                walk(child)
        elif isinstance(node, list):
            for child in node:
                walk(child)

    walk(SCHEMA)


def test_descriptions_units_and_limits() -> None:
    drag = SCHEMA["definitions"]["Drag"]["properties"]["coefficient"]
    assert drag["x-unit"] == "kg/s"
    assert drag["exclusiveMinimum"] == 0
    assert drag["description"] == "Drag coefficient k in f = −k v."
    assert "default" in SCHEMA["definitions"]["Simulation"]["properties"]["dt"]


def test_the_good_document() -> None:
    assert accepts(GOOD)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.47", "-1"),
        ("coefficient", "coeficient"),
        ('"drag"', '"darg"'),
        ("0.47", '"47"'),
        ('"12 cm", 0', '"12 cm"'),
        ('"12 cm", 0', '"12 cm", 0, 0'),
        ('["ball"]', '"ball"'),
        ("dt = 0.002", 'integrator = "rk5"'),
        ("std = 0.4", "std = -1"),
        ("[simulation]", "[[simulation]]"),
    ],
)
def test_schema_and_models_reject_the_same(old: str, new: str) -> None:
    text = GOOD.replace(old, new)
    assert not accepts(text)
    with pytest.raises(ScenarioError):
        load(text)
