"""The key `integrator`: a name, or a table with the options of the method."""

from __future__ import annotations

from typing import Any

import pytest
from simulate import points, table

import particlesim as ps
from particlesim.graph.graph import build_graph, methods_of
from particlesim.integrators import METHODS, MethodName, method_for
from particlesim.preflight.advice import replaced
from particlesim.scenario.dump import to_table


def scenario(method: Any, /, **group: Any) -> ps.Scenario:
    return ps.from_table(table(1.0, 0.1, method, particles=[points((0, 0, 0), **group)]))


def mistake(method: Any, /, **group: Any) -> tuple[str, str, str]:
    with pytest.raises(ps.ScenarioError) as caught:
        scenario(method, **group)
    (found,) = caught.value.diagnostics
    return found.message, found.path, found.allowed or ""


def test_every_method_has_its_name_in_the_options_of_its_family() -> None:
    assert set(MethodName.__args__) == set(METHODS)  # type: ignore[attr-defined]
    for name, method in METHODS.items():
        options = method.options(method=name)  # refuses a name that is not of the family
        assert method.configured(options) == method, "the defaults of the options are those of the method"


@pytest.mark.parametrize("name", [name for name in METHODS if name != "whfast"])
def test_a_table_without_options_is_the_name(name: str) -> None:
    for given in (name, {"method": name}):
        (island,) = build_graph(scenario(given)).islands
        assert island.method == METHODS[name]


def test_a_group_has_its_own_method() -> None:
    (island,) = build_graph(scenario("rk4", integrator={"method": "heun"})).islands
    assert island.method is not METHODS["rk4"]
    assert island.method == METHODS["heun"]


def test_the_table_survives_a_round_trip() -> None:
    made = scenario({"method": "heun"})
    assert to_table(made)["simulation"]["integrator"] == {"method": "heun"}
    assert ps.from_table(to_table(made)) == made


def test_a_method_without_options_takes_none() -> None:
    assert mistake({"method": "rk4", "tolerance": 1e-6}) == (
        "unknown key 'tolerance'",
        "simulation.integrator.tolerance",
        "method",
    )


def test_wrong_methods_are_named_with_the_right_ones() -> None:
    words, path, allowed = mistake({"method": "rk5"})
    assert ('"rk5"' in words, path) == (True, "simulation.integrator.method")
    assert '"rk4"' in allowed
    words, path, _ = mistake("rk4", integrator=3)
    assert words.endswith(" or a table with method, got 3")
    assert path == "particles.0.integrator"


@pytest.mark.parametrize("tolerance", [0, -1e-3, "nan"])
def test_tolerances_are_positive_numbers(tolerance: Any) -> None:
    _, path, _ = mistake({"method": "rk45", "tolerance": tolerance})
    assert path == "simulation.integrator.tolerance"


def test_options_are_those_of_the_method() -> None:
    (island,) = build_graph(scenario({"method": "rk45", "tolerance": 1e-4, "minimum_step": "1 ms"})).islands
    assert (island.method.name, island.method.tolerance, island.method.minimum_step) == ("rk45", 1e-4, 1e-3)  # type: ignore[attr-defined]
    assert island.method.label == "rk45 (tolerance = 0.0001, minimum_step = 0.001)"
    words, path, allowed = mistake({"method": "dop853", "tolerence": 1e-4})
    assert (words, path) == ("unknown key 'tolerence'", "simulation.integrator.tolerence")
    assert allowed == "method, tolerance, position_tolerance, velocity_tolerance, minimum_step"


def test_a_tolerance_that_the_numbers_cannot_hold_is_refused() -> None:
    words, path, allowed = mistake("rk4", integrator={"method": "rk45", "tolerance": 1e-15})
    assert words == "double precision cannot hold a tolerance of 1e-15"
    assert path == "particles.0.integrator.tolerance"
    assert "1.4e-14" in allowed


def test_method_for_reads_both_forms() -> None:
    assert method_for("rk4") == method_for(METHODS["rk4"].options(method="rk4"))


def mixed(method: Any, **dust: Any) -> ps.Scenario:
    """A group with inertia and one without, which interact."""
    groups = [
        points((1, 0, 0), name="planet", mass=1.0),
        points((0, 0, 0), name="dust", mass=1e-3, dynamics={"type": "first_order", "drag": 1.0}, **dust),
    ]
    law = {"type": "gravity", "constant": 1.0}
    return ps.from_table(table(1.0, 0.1, method, particles=groups, interactions=[law]))


def test_a_method_that_is_replaced_is_told_with_both_names() -> None:
    for asked, taken in (("symplectic_euler", "explicit_euler"), ("yoshida4", "rk4")):
        scenario = mixed(asked)
        assert {each.name for each in methods_of(scenario).values()} == {taken}
        assert {island.method.name for island in build_graph(scenario).islands} == {taken}
        (told,) = replaced(scenario)
        assert told.startswith("'dust' has no inertia and steps together with 'planet'")
        assert f"{taken} steps them all, not {asked}; energy drifts" in told
    for method in ("rk4", "dop853", "implicit_midpoint"):  # these need no velocity
        assert methods_of(mixed(method))["planet"] == METHODS[method]
        assert replaced(mixed(method)) == ()


def test_ias15_is_not_replaced_for_what_has_inertia() -> None:
    with pytest.raises(
        ps.ScenarioError, match="'planet' would be stepped by dop853 and not by ias15"
    ) as caught:
        mixed("ias15")
    assert caught.value.diagnostics[0].path == "particles.dust.dynamics"


def test_options_that_both_methods_have_are_kept() -> None:
    inert = {"dynamics": {"type": "first_order", "drag": 1.0}}
    asked = {"method": "ias15", "tolerance": 1e-11, "minimum_step": 1e-9}
    (method,) = methods_of(scenario(asked, name="p", **inert)).values()
    assert method.label == "dop853 (tolerance = 1e-11, minimum_step = 1e-09)"
    (method,) = methods_of(scenario("ias15", name="p", **inert)).values()
    assert method == METHODS["dop853"]
    words, path, _ = mistake({"method": "ias15", "tolerance": 1e-15}, **inert)
    assert "cannot hold a tolerance of 1e-15" in words
    assert path == "simulation.integrator.tolerance"
