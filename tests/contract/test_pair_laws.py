"""What every registered interaction must hold: F = −∇U, the third law, Jacobians, compiled laws, and documentation."""

from __future__ import annotations

import itertools
import sys
from typing import ClassVar, NamedTuple

import numpy as np
import pytest
from contract.pair_cases import PAIR_CASES, pairs, record_of, records

from particlesim.extensions.requirements import undocumented
from particlesim.interactions import INTERACTIONS, PairInteraction
from particlesim.interactions.morse import Morse
from particlesim.laws.pair import (
    Pair,
    central,
    is_central,
    pair_force,
    pair_force_dv,
    pair_force_dx,
    pair_potential,
)
from particlesim.laws.registry import GENERICS, has_law, law
from particlesim.model.attributes import ATTRIBUTES
from particlesim.testing import (
    COMPILED,
    TOLERANCE,
    H,
    check_interaction,
    compiled,
    differences,
    scale,
    swapped,
)

PAIRS = pairs()
ALL = pytest.mark.parametrize("model", PAIR_CASES.values(), ids=PAIR_CASES)
CLASSES = pytest.mark.parametrize("cls", INTERACTIONS, ids=lambda c: c.__name__)


def test_every_interaction_has_a_case() -> None:
    assert {type(model) for model in PAIR_CASES.values()} == set(INTERACTIONS)


def test_every_record_has_a_case() -> None:
    known = itertools.chain(GENERICS[pair_force].laws, GENERICS[central].laws)
    ours = {record for record in known if record.__module__.startswith("particlesim.")}
    # what methods make of laws (the near part of a mesh) has tests of its own
    assert {record for record in ours if not record.__module__.startswith("particlesim.engine.")} <= records()


@ALL
def test_force_is_the_gradient_of_its_potential(model: PairInteraction) -> None:
    record = record_of(model)
    if not has_law(pair_potential, record):
        return
    for p in PAIRS:
        p = p._replace(vx=0.0, vy=0.0, vz=0.0)  # dampers beside a potential do nothing then
        gradient = differences(lambda q: pair_potential(record, q), p, "x y z")[0]
        f = pair_force(record, p)
        noise = 1.5 * np.finfo(float).eps / H * abs(pair_potential(record, p))
        # fifth derivatives of (σ/r)¹² at r = 0.7 are some 10⁶ of the force's scale: h⁴/30 of that
        np.testing.assert_allclose(f, -gradient, rtol=0, atol=1e-6 * scale(f) + 4 * noise)


@ALL
def test_second_feels_the_opposite(model: PairInteraction) -> None:
    record = record_of(model)
    for p in PAIRS:
        assert pair_force(record, swapped(p)) == tuple(-f for f in pair_force(record, p))


@ALL
@pytest.mark.parametrize(("generic", "names"), [(pair_force_dx, "x y z"), (pair_force_dv, "vx vy vz")])
def test_jacobians(model: PairInteraction, generic: object, names: str) -> None:
    record = record_of(model)
    for p in PAIRS:
        expected = differences(lambda q: pair_force(record, q), p, names)
        found = np.reshape(generic(record, p), (3, 3))  # type: ignore[operator]
        # Differences of the dashpot of Hertz, which goes with the fourth root of the overlap, err by a little more.
        part = 2e-6 if getattr(model, "model", None) == "hertz" else 1e-6
        np.testing.assert_allclose(
            found, expected, rtol=0, atol=part * scale(expected) + TOLERANCE * scale(pair_force(record, p))
        )


@ALL
def test_compiled_laws_give_the_same(model: PairInteraction) -> None:
    record = record_of(model)
    for generic in (pair_force, pair_force_dx, pair_force_dv, pair_potential):
        if has_law(generic, record):
            expected = np.array([np.atleast_1d(generic(record, p)) for p in PAIRS], float)
            found = compiled(generic, [record], PAIRS)[0]
            # what a formula knows of its second derivative are differences, good to 10⁻¹⁰
            by_differences = model.type == "formula" and generic is pair_force_dx
            tolerance = 1e-9 if by_differences else COMPILED
            np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale(expected))


@ALL
def test_laws_read_only_what_they_say(model: PairInteraction) -> None:
    record = record_of(model)
    for p in PAIRS:
        f = pair_force(record, p)
        if not model.needs_velocity():
            assert f == pair_force(record, p._replace(vx=9.0, vy=-9.0, vz=9.0))
        for each in ATTRIBUTES.values():
            if each.name not in ("mass", "temperature") and each.name not in model.needs():
                more = {f"{each.symbol}{k}": getattr(p, f"{each.symbol}{k}") + 1 for k in (1, 2)}
                assert f == pair_force(record, p._replace(**more)), f"{model.type} reads the {each.name}"


@ALL
def test_a_shifted_law_ends_at_its_cutoff(model: PairInteraction) -> None:
    if model.shift == "none" or model.cutoff is None:
        return
    p = PAIRS[0]._replace(x=model.cutoff, y=0.0, z=0.0)
    plain = pair_potential(model.record(), p)
    assert pair_potential(record_of(model), p) == pytest.approx(0, abs=1e-14 * abs(plain))
    f = pair_force(record_of(model), p)[0]
    expected = 0 if model.shift == "force" else pair_force(model.record(), p)[0]
    assert f == pytest.approx(expected, abs=1e-13 * abs(pair_force(model.record(), p)[0]))


@pytest.mark.parametrize("name", ["gravity", "lennard_jones", "yukawa", "flocking"])
def test_the_check_for_packages_passes(name: str) -> None:
    check_interaction(PAIR_CASES[name], PAIRS[:5])


class Wrong(Morse):
    """One that does not say what it reads, and breaks the third law."""

    fault: ClassVar[str] = ""

    def record(self) -> WrongRecord:
        return WrongRecord(
            *super().record(), self.fault == "third law", self.fault == "time", self.fault == "velocity"
        )


class WrongRecord(NamedTuple):
    depth: float
    width: float
    distance: float
    lopsided: bool
    timed: bool
    moving: bool


@law(pair_force, WrongRecord)
def wrong(f: WrongRecord, p: Pair) -> tuple[float, float, float]:
    return p.x + f.lopsided * p.x * p.x + f.timed * p.t * p.x + f.moving * p.vx, p.y, p.z


@pytest.mark.parametrize(
    ("fault", "words"), [("third law", "third law"), ("time", "changes"), ("velocity", "needs_velocity")]
)
def test_the_check_for_packages_finds_what_is_wrong(fault: str, words: str) -> None:
    class Broken(Wrong):
        """See above."""

        energy: ClassVar[str] = "none: it is wrong"

    Broken.fault = fault
    with pytest.raises(AssertionError, match=words):
        check_interaction(Broken(depth=1.0, width=1.0, distance=1.0), PAIRS[:3])


@CLASSES
def test_documented(cls: type[PairInteraction]) -> None:
    assert undocumented(cls, ("formula", "energy")) == []
    doc = sys.modules[cls.__module__].__doc__ or ""
    assert "Source:" in doc


@CLASSES
def test_potentials_are_as_documented(cls: type[PairInteraction]) -> None:
    models = [model for model in PAIR_CASES.values() if type(model) is cls]
    assert any(model.conserves() for model in models) != cls.energy.startswith("none")
    assert all(is_central(model.record()) for model in models if model.shift != "none")
