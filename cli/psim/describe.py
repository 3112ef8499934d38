"""`psim describe`: formula, parameters and units of everything that a scenario may name."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated, Any

import typer

from psim.console import facts, paint

if TYPE_CHECKING:
    from pydantic import BaseModel

    from particlesim.integrators import Method


def _names(incomplete: str = "") -> list[str]:
    from particlesim.scenario.extensions import UNIONS

    own = (name for _, names in _sections() for name in names)
    offered = (name for union in UNIONS for name in union.names())
    return sorted(name for name in {*own, *offered} if name.startswith(incomplete))


def describe(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]",
            help="A force, interaction, flow, layout, collider, integrator, table or key.",
            autocompletion=_names,
        ),
    ] = None,
) -> None:
    """Explain a force, interaction, flow, layout, collider, integrator, table or key of a scenario.

    Shows its formula, energy and parameters with their units. Without a name: what there is.
    """
    if name is None:
        _find_extensions()
    sections = dict(_sections())
    if name is None:
        from particlesim.bodies import JOINTS

        # no section of their own: "ball" is a shape, too, and explained with all of its places
        joints = {model.model_fields["type"].default: model for model in JOINTS}
        for title, entries in (*sections.items(), ("Joints", joints)):
            print(paint(title, "bold", sys.stdout))
            facts([(key, _headline(entry)) for key, entry in entries.items()], sys.stdout)
        return
    if _explain(name, sections):
        return
    _find_extensions()  # only now: packages are imported for what psim itself does not have
    if not _explain(name, dict(_sections())):
        raise _unknown(name)


def _find_extensions() -> None:
    """Import the types that installed packages add, and warn of those that cannot be used."""
    from particlesim.scenario.extensions import find_all
    from psim.console import warn

    for problem in find_all():
        warn(problem)


def _explain(name: str, sections: dict[str, dict[str, Any]]) -> bool:
    """Show what a name stands for; False where it stands for nothing."""
    for word in (f"{name}s", name):  # [[planes]] answer to "plane"
        found = [entries[word] for entries in sections.values() if word in entries]
        for entry in found:  # gravity is a force, and an interaction
            _show(word, entry)
        if found:
            return True
        if _show_word(word):
            return True
    return False


def _show_word(word: str) -> bool:
    """Say where in a scenario a key or a type of something stands, and what it means there; False where it is neither."""
    from particlesim.scenario.scenario import Scenario
    from particlesim.scenario.text import typewalk
    from particlesim.scenario.text.vocabulary import Place, vocabulary, whereabouts

    said: dict[str, list[Place]] = {}
    for place in vocabulary(Scenario).get(word, ()):
        is_key = place.role in ("key", "table")
        text = dict(_parameters(place.model)).get(word, "") if is_key else _doc(place.model)
        said.setdefault(text, []).append(place)
    if not said:
        return False
    print(paint(word, "bold", sys.stdout))
    for text, places in said.items():
        print(f"  {text}".replace("\n", "\n  "))
        print(paint(f"    in {whereabouts(tuple(places), len(places))}", "dim", sys.stdout))
    first = next(iter(said.values()))[0]
    held = typewalk.node(first.model)
    if first.role in ("key", "table"):
        held = typewalk.child(held, word, None) or held
        held = (typewalk.child(held, 0, None) if held.is_list else held) or held
    if held.model is not None:
        _show_parameters(held.model)
    elif known := typewalk.tags(held):
        facts([("types", ", ".join(known))], sys.stdout)
    return True


def _sections() -> Iterator[tuple[str, dict[str, Any]]]:
    """Titles, and what there is under them by the name that scenarios use: models, or methods."""
    from particlesim.bodies import BODY_SHAPES
    from particlesim.colliders import COLLIDERS
    from particlesim.flows import OPEN_FLOWS
    from particlesim.forces import OPEN_FORCES
    from particlesim.integrators import METHODS
    from particlesim.interactions import OPEN_INTERACTIONS
    from particlesim.layouts import LAYOUTS
    from particlesim.scenario.scenario import Scenario

    unions = (OPEN_FORCES, OPEN_FLOWS, OPEN_INTERACTIONS)
    forces, flows, interactions = ((*union.own, *union.added) for union in unions)
    kinds: tuple[tuple[str, Iterable[type[BaseModel]]], ...] = (
        ("Forces", forces),
        ("Interactions", interactions),
        ("Flows", flows),
        ("Layouts", LAYOUTS),
        ("Colliders", COLLIDERS),
        ("Shapes of bodies", BODY_SHAPES),
    )
    for title, models in kinds:
        yield title, {model.model_fields["type"].default: model for model in models}
    yield "Integrators", dict(METHODS)
    yield (
        "Tables",
        {name: model for name, model in _tables(Scenario) if name not in ("forces", "interactions")},
    )


def _tables(scenario: type[BaseModel]) -> Iterator[tuple[str, type[BaseModel]]]:
    """The tables of a scenario file that are one model: [simulation], [[planes]] ..."""
    from typing import get_args

    from particlesim.scenario.text import typewalk

    for name, field in scenario.model_fields.items():
        for kind in (field.annotation, *get_args(field.annotation)):
            if (model := typewalk.node(kind).model) is not None:
                yield name, model


def _headline(entry: Any) -> str:
    if _is_method(entry):
        return str(entry.summary)
    formula = getattr(entry, "formula", None)
    first = _doc(entry).split("\n\n")[0].replace("\n", " ")
    return f"{formula}. {first}" if formula else first


def _package(entry: type[BaseModel]) -> str:
    """The package that a type comes from, with its version; empty for what is psim's own."""
    from particlesim.scenario.extensions import extension_of

    extension = extension_of(entry)
    return "" if extension is None else extension.origin


def _doc(entry: Any) -> str:
    import inspect

    return inspect.getdoc(entry) or ""


def _is_method(entry: Any) -> bool:
    return not isinstance(entry, type)


def _show(name: str, entry: Any) -> None:
    print(paint(name, "bold", sys.stdout))
    if _is_method(entry):
        _show_method(entry)
        return
    print("  " + _doc(entry).replace("\n", "\n  "))
    rows = [("formula", getattr(entry, "formula", "")), ("energy", getattr(entry, "energy", ""))]
    facts([*rows, ("package", _package(entry))], sys.stdout)
    _show_parameters(entry)


def _show_method(method: Method) -> None:
    rows = [
        ("what", method.summary),
        ("order", str(method.order)),
        ("cost", f"{method.evaluations} force evaluations per step"),
        ("symplectic", "yes" if method.symplectic else "no"),
        ("reversible", "yes" if method.reversible else "no"),
        ("without inertia", method.first_order or "the same"),
    ]
    facts(rows, sys.stdout)
    if len(method.options.model_fields) > 1:
        _show_parameters(method.options)


def _show_parameters(model: type[BaseModel]) -> None:
    print(paint("parameters", "bold", sys.stdout))
    facts(list(_parameters(model)), sys.stdout)


def _parameters(model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """The keys of a table, and what they mean, with unit and default."""
    from particlesim.scenario.schema import json_schema

    schema = json_schema(model)
    required = schema.get("required", ())
    for name, entry in schema["properties"].items():
        if name == getattr(model, "tag", "type") or name in getattr(model, "unused", ()):
            continue
        text = entry.get("description", "")
        unit = _unit(entry)
        notes = [f"in {unit}"] if unit and unit != "1" else []
        if name in required:
            notes.append("required")
        elif entry.get("default") not in (None, [], "", {}):
            notes.append(f"default {_toml(entry['default'])}")
        if "enum" in entry:
            notes.append("one of " + ", ".join(map(str, entry["enum"])))
        yield name, f"{text} ({'; '.join(notes)})" if notes else text


def _unit(schema: Any) -> str:
    """The unit of a quantity, of the components of a vector, or of the first alternative that has one."""
    if not isinstance(schema, dict):
        return ""
    if "x-unit" in schema:
        return str(schema["x-unit"])
    items = schema.get("items", ())
    return next(
        filter(
            None, map(_unit, (*schema.get("anyOf", ()), *(items if isinstance(items, list) else (items,))))
        ),
        "",
    )


def _toml(value: Any) -> str:
    """A default as the file would write it, on one line."""
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(f"{key} = {_toml(child)}" for key, child in value.items() if child is not None)
            + " }"
        )
    if isinstance(value, list):
        return "[" + ", ".join(_toml(child) for child in value) + "]"
    return (
        str(value).lower()
        if isinstance(value, bool)
        else f'"{value}"'
        if isinstance(value, str)
        else str(value)
    )


def _unknown(name: str) -> Exception:
    from particlesim.errors import UsageError
    from particlesim.model.spelling import did_you_mean
    from particlesim.scenario.scenario import Scenario
    from particlesim.scenario.text.suggestions import translation
    from particlesim.scenario.text.vocabulary import vocabulary

    known = (*_names(), *vocabulary(Scenario))
    hint = translation(name) or did_you_mean(name, known) or "psim describe lists what there is."
    return UsageError(f"there is nothing called {name!r}", hint)
