"""Lengths, masses and charges whose squares and products numbers of the run do not hold are refused at the start."""

from __future__ import annotations

from typing import Any

import pytest
from simulate import points, table

import particlesim as ps
from particlesim.engine.simulation import Simulation

FAR_APART = 2e19
"""[m]; the square of it is more than single precision holds, 3.4e38."""


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"type": "soft_sphere", "epsilon": 1.0, "sigma": 3 * FAR_APART}, "has a length of 6e[+]19 m"),
        ({"type": "soft_sphere", "epsilon": 1.0}, "has a length of 6e[+]19 m"),
        ({"type": "flocking", "sight": 3 * FAR_APART, "alignment": 1.0}, "has a length of 6e[+]19 m"),
        ({"type": "morse", "depth": 1.0, "width": 1e-19, "distance": 1e19}, "up to 2e[+]19 m apart"),
        ({"type": "gravity"}, "up to 2e[+]19 m apart"),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_lengths_whose_squares_overflow_are_refused(law: dict[str, Any], told: str) -> None:
    """Pairs had felt nothing of each other; double precision holds them."""
    group = points((0, 0, 0), (FAR_APART, 0, 0), name="a", mass=1e10, radius=1.5 * FAR_APART)
    scenario = table(1.0, 0.1, particles=[group], interactions=[law])
    Simulation(ps.from_table(scenario)).close()
    scenario["simulation"]["precision"] = "single"
    with pytest.raises(ps.UsageError, match=f"{told}.*single precision holds no squares"):
        Simulation(ps.from_table(scenario))


def test_neighbours_beyond_where_lists_look_are_refused() -> None:
    # Of ten particles in a row of steps of 1e29 m, half had been found.
    group = points(*[(k * 2e29, 0, 0) for k in range(10)], name="a", mass=1.0)
    law = {"type": "soft_sphere", "epsilon": 1.0, "sigma": 3e29, "method": "neighbours"}
    scenario = table(1.0, 0.1, particles=[group], interactions=[law])
    with pytest.raises(
        ps.UsageError, match=r"1\.8e[+]30 m from the origin, and neighbour lists find those up to 1e[+]30 m"
    ):
        Simulation(ps.from_table(scenario))
    law["method"] = "direct"
    Simulation(ps.from_table(scenario)).close()


@pytest.mark.parametrize(
    ("law", "sizes", "told"),
    [
        ({"type": "power_law", "strength": 1e10, "exponent": 2}, {"mass": 6.6e-26}, "m₁ m₂ = 4.4e-51 kg²"),
        (
            {"type": "power_law", "strength": 1.0, "exponent": 1},
            {"mass": 1e20},
            "masses, 1e[+]20 and 1e[+]20 kg, is more",
        ),
        ({"type": "coulomb"}, {"charge": 1.6e-20}, "q₁ q₂ = 2.6e-40 C²"),
        (
            {"type": "coulomb", "cutoff": 1e-6, "method": "neighbours"},
            {"charge": 1.6e-20},
            "q₁ q₂ = 2.6e-40 C²",
        ),
        (
            {"type": "gravity"},
            {"mass": [1.0, 1e-30]},
            "m₁ m₂ = 1.0e-30 kg², times 6.7e-11",
        ),  # one stood still
    ],
)
def test_products_that_round_away_are_refused(law: dict[str, Any], sizes: dict[str, Any], told: str) -> None:
    """In double precision two particles at 1 nm pull by what the law says; in single precision nothing had moved."""
    group = points((0, 0, 0), (1e-9, 0, 0), name="a", **{"mass": 1e-26, **sizes})
    scenario = table(1e-12, 1e-13, particles=[group], interactions=[law])
    Simulation(ps.from_table(scenario)).close()
    scenario["simulation"]["precision"] = "single"
    with pytest.raises(ps.UsageError, match=f"{told}.* than single precision holds"):
        Simulation(ps.from_table(scenario))


@pytest.mark.parametrize(
    ("law", "sizes", "method"),
    [
        ("gravity", {"mass": 2e36}, "tree"),
        ("gravity", {"mass": 2e36}, "mesh"),
        ("coulomb", {"charge": 1.6e-20}, "mesh"),
    ],
)
def test_trees_and_meshes_advise_double_precision(law: str, sizes: dict[str, Any], method: str) -> None:
    group = points((0, 0, 0), (1, 0, 0), (0, 1, 0), name="a", **{"mass": 1e-26, **sizes})
    scenario = table(1e-6, 1e-7, particles=[group], interactions=[{"type": law, "method": method}])
    scenario["simulation"] |= {"precision": "single"} | (
        {"box": {"size": [4.0] * 3}} if method == "mesh" else {}
    )
    with pytest.raises(ps.UsageError, match=r'than single precision holds.*precision = "double"'):
        Simulation(ps.from_table(scenario))


def test_products_that_single_precision_holds_are_summed() -> None:
    # 10⁻¹⁵ kg twice: k m²/r² = 10¹⁰ · 10⁻³⁰/10⁻¹⁸ = 10⁻² N; pinned and chargeless ones have no product.
    law = {"type": "power_law", "strength": 1e10, "exponent": 2}
    groups = [points((0, 0, 0), (1e-9, 0, 0), name="a", mass=1e-15)]
    scenario = table(1e-12, 1e-13, particles=groups, interactions=[law])
    scenario["simulation"]["precision"] = "single"
    simulation = Simulation(ps.from_table(scenario))
    assert simulation.islands[0].forces(0.0)[0] == pytest.approx([1e-2, -1e-2], rel=1e-6)
    simulation.close()
    neutral = points((0, 0, 0), (1, 0, 0), name="a", mass=1.0, charge=[0.0, 1e-19])
    scenario = table(1.0, 0.1, particles=[neutral], interactions=[{"type": "coulomb"}])
    scenario["simulation"]["precision"] = "single"
    Simulation(ps.from_table(scenario)).close()
