"""What differs between two scenarios, address by address."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from particlesim.scenario.dump import to_table
from particlesim.scenario.scenario import Scenario

NOT_THERE, BY_PARTS = "not given", "given part by part"

WITHOUT_EFFECT = frozenset(
    ("title", "description", "render", "output.checkpoint_every", "output.checkpoint_wall")
)
"""What changes neither the physics nor what is recorded of it."""


def changes(before: Mapping[str, Any], scenario: Scenario) -> list[tuple[str, str, str]]:
    """Address, value before and value now of all that differs between a scenario's table, defaults included, and a
    scenario, except what has no effect on its results."""
    old, new = _flat(before), _flat(to_table(scenario, defaults=True))
    found = []
    for address in dict.fromkeys((*old, *new)):
        if address in WITHOUT_EFFECT or address.split(".")[0] in WITHOUT_EFFECT:
            continue
        was, now = _at(address, old), _at(address, new)
        if was != now and (was, now) not in ((BY_PARTS, []), ([], BY_PARTS)):
            found.append((address, _shown(was), _shown(now)))
    return found


def _at(address: str, table: Mapping[str, Any]) -> Any:
    """The value at an address of a flat table; `BY_PARTS` where there are only longer addresses."""
    if address not in table and any(key.startswith(f"{address}.") for key in table):
        return BY_PARTS
    return table.get(address, NOT_THERE)


def _flat(value: Any, address: str = "") -> dict[str, Any]:
    """Values by dotted address; entries of lists of tables go by name, else by index."""
    prefix = f"{address}." if address else ""
    if isinstance(value, Mapping):
        parts = {f"{prefix}{key}": child for key, child in value.items()}
    elif isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
        parts = {f"{prefix}{each.get('name', k)}": each for k, each in enumerate(value)}
    else:
        return {address: value}
    return {key: leaf for name, part in parts.items() for key, leaf in _flat(part, name).items()}


def _shown(value: Any) -> str:
    text = value if value in (NOT_THERE, BY_PARTS) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
