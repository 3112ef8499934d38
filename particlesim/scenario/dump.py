"""A validated scenario as TOML text, such that loading the text gives an equal scenario.

Floats are written with as many digits as it takes to read back the same bits; quantities are in SI units.
"""

from __future__ import annotations

from typing import Any, Literal, get_args, get_origin

import tomli_w
from pydantic import BaseModel
from pydantic.fields import FieldInfo


def dump(model: BaseModel, *, defaults: bool = False) -> str:
    """`model` as TOML. Values equal to their default are left out unless `defaults` is set.

    Keys that can hold one word only, as the `type` of a union's branches, are always written.
    """
    return tomli_w.dumps(to_table(model, defaults=defaults))


def to_table(model: BaseModel, *, defaults: bool = False) -> dict[str, Any]:
    """`model` as the dict that tomllib would read: lists for tuples, no None."""
    return {
        info.alias or name: _plain(value, defaults)
        for name, info in type(model).model_fields.items()
        if (value := getattr(model, name)) is not None and (defaults or not _is_left_out(info, value))
    }


def _is_left_out(info: FieldInfo, value: object) -> bool:
    """Whether `value` is a default that loading would supply again."""
    if get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1:
        return False
    if info.is_required() or info.default_factory_takes_validated_data:
        return False
    return bool(value == info.get_default(call_default_factory=True, validated_data={}))


def _plain(value: Any, defaults: bool) -> Any:
    if isinstance(value, BaseModel):
        return to_table(value, defaults=defaults)
    if isinstance(value, dict):
        return {str(key): _plain(child, defaults) for key, child in value.items() if child is not None}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(child, defaults) for child in value]
    return value
