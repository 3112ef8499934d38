"""Unions built branch by branch accept what pydantic's discriminated unions accept, and refuse with the same errors."""

from __future__ import annotations

import subprocess
import sys
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field, TypeAdapter, ValidationError

from particlesim.bodies import BODY_SHAPES
from particlesim.colliders import COLLIDERS
from particlesim.flows import OPEN_FLOWS
from particlesim.forces import OPEN_FORCES
from particlesim.interactions import INTERACTIONS
from particlesim.layouts import LAYOUTS
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.variants import Family, Tagged


class Box(Model):
    type: Literal["box"] = "box"
    size: float

    def model_post_init(self, context: Any) -> None:
        if self.size > 100:
            raise invalid("too large", at=("size",))


class Shell(Model):
    type: Literal["shell"] = "shell"


class Ball(Model):
    type: Literal["ball", "sphere"] = "ball"
    radius: Annotated[float, Field(gt=0)] = 1.0
    inside: Annotated[Box | Shell, Tagged("type")] | None = None


class Never(Model):
    type: Literal["never"] = "never"


OURS: TypeAdapter[Any] = TypeAdapter(tuple[Annotated[Box | Ball, Tagged("type")], ...])
THEIRS: TypeAdapter[Any] = TypeAdapter(tuple[Annotated[Box | Ball, Field(discriminator="type")], ...])

VALUES: list[Any] = [
    {"type": "box", "size": 2},
    {"type": "sphere", "radius": 0.5},
    Ball(),
    {"type": "box"},
    {"type": "box", "size": "wide", "colour": 1},
    {"type": "box", "size": 101},
    {"type": "ball", "radius": -1, "inside": {"type": "box", "size": []}},
    {"type": "ball", "inside": {"type": "cube"}},
    {"type": "cube", "size": 1},
    {"type": ["box"], "size": 1},
    {"size": 1},
    7,
    None,
]


def outcome(adapter: TypeAdapter[Any], value: Any) -> Any:
    try:
        return adapter.validate_python((value,))
    except ValidationError as error:
        return [
            {k: v for k, v in entry.items() if k != "url"} for entry in error.errors(include_context=False)
        ]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_values_and_errors_are_those_of_pydantic(value: Any) -> None:
    assert outcome(OURS, value) == outcome(THEIRS, value)


def test_so_is_the_json_schema() -> None:
    theirs = THEIRS.json_schema()
    theirs["items"].pop("discriminator", None)
    ours = OURS.json_schema()
    ours["items"].pop("discriminator", None)
    assert ours == theirs


def test_branches_that_are_not_named_are_not_built() -> None:
    adapter: TypeAdapter[Any] = TypeAdapter(Annotated[Box | Never, Tagged("type")])
    adapter.validate_python({"type": "box", "size": 1})
    assert not Never.__pydantic_complete__


FAMILIES = (COLLIDERS, OPEN_FORCES.own, OPEN_FLOWS.own, INTERACTIONS, LAYOUTS, BODY_SHAPES)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family[0].__name__)
def test_families_name_their_models_as_files_do(family: Family[Any]) -> None:
    assert [model.model_fields["type"].default for model in family] == list(family.tags)
    assert len({*family}) == len(family) > 1
    assert family[0] is family.named(family.tags[0])
    assert family[:1] == (family[0],)
    assert family.by_name(family[0].__name__) is family[0]
    with pytest.raises(AttributeError, match="Nothing"):
        family.by_name("Nothing")


def test_a_small_run_imports_what_it_needs_only() -> None:
    """A scenario without bodies, springs and pairs starts without their models and kernels."""
    program = (
        "import sys, particlesim as ps\n"
        "ps.run(ps.from_table({'simulation': {'duration': 1.0, 'dt': 1.0},"
        " 'particles': [{'name': 'p', 'layout': {'type': 'points', 'position': [[0, 0, 0]]}}]}))\n"
        "print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    unneeded = ("bodies.shape", "engine.rigid.kernel", "engine.coupled", "forces.drag")
    assert "particlesim.layouts.points" in done.stdout.split()
    assert not {f"particlesim.{name}" for name in unneeded} & set(done.stdout.split())
