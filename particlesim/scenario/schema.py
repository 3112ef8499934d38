"""The JSON Schema of scenario files, in the draft that editors of TOML understand.

pydantic writes draft 2020-12; taplo and Even Better TOML read draft-07. For what scenarios use the two differ
in where definitions live, in how arrays of fixed length are written, and in that draft-07 ignores what stands
beside a `$ref`. TOML has no null, so `null` is taken out as well.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

DRAFT = "http://json-schema.org/draft-07/schema#"

_NULL = {"type": "null"}


def json_schema(model: type[BaseModel], *, identifier: str | None = None) -> dict[str, Any]:
    """The draft-07 schema of the files that `model` accepts; `identifier` becomes its `$id`.

    Quantities carry their unit as `x-unit`, fields that may be absent their default.
    """
    body: dict[str, Any] = _convert(model.model_json_schema(by_alias=True, mode="validation"))
    head = {"$schema": DRAFT} | ({"$id": identifier} if identifier is not None else {})
    return head | body


def _convert(schema: Any) -> Any:
    """A (sub)schema or a list of them in draft-07."""
    if isinstance(schema, list):
        return [_convert(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    out: dict[str, Any] = {}
    for keyword, value in schema.items():
        match keyword:
            case "discriminator":  # of OpenAPI; `const` in each branch says the same
                pass
            case "default":
                if value is not None:
                    out["default"] = value
            case "const" | "enum" | "examples" | "required":
                out[keyword] = value
            case "properties":  # its keys are names of fields, not keywords
                out["properties"] = {name: _property(child) for name, child in value.items()}
            case "$defs":
                out["definitions"] = {name: _convert(child) for name, child in value.items()}
            case "$ref":
                out["$ref"] = value.replace("#/$defs/", "#/definitions/")
            case "prefixItems":
                out["items"] = _convert(value)  # maxItems, which stands beside it, forbids more
            case _:
                out[keyword] = _convert(value)
    return _beside_ref(_without_null(out))


def _property(schema: dict[str, Any]) -> dict[str, Any]:
    """A field. Its title would only repeat its name, in capitals."""
    converted: dict[str, Any] = _convert(schema)
    converted.pop("title", None)
    return converted


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """An optional value is one that may be absent: `anyOf: [X, null]` becomes X."""
    branches = schema.get("anyOf")
    if not isinstance(branches, list) or _NULL not in branches:
        return schema
    left = [branch for branch in branches if branch != _NULL]
    rest = {keyword: value for keyword, value in schema.items() if keyword != "anyOf"}
    return {**left[0], **rest} if len(left) == 1 else {**rest, "anyOf": left}


def _beside_ref(schema: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in schema or len(schema) == 1:
        return schema
    rest = {keyword: value for keyword, value in schema.items() if keyword != "$ref"}
    return {**rest, "allOf": [{"$ref": schema["$ref"]}]}
