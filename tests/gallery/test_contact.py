"""The shipped scenarios of contact: sand heaps up at its angle of repose, and runs out of an hourglass by Beverloo's law."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import particlesim as ps
from particlesim.engine.simulation import Simulation

from .test_scenarios import FOLDER, G, run


def slope_of_pile(x: NDArray[Any], radius: NDArray[Any]) -> float:
    """Slope of a cone of grains at x [n, 3] in degrees: of the line through the highest grain in each cell of a ring and a
    twelfth of the circle, between its tip and its foot."""
    across = x[:, [0, 2]] - x[:, [0, 2]].mean(axis=0)
    away, sector = np.hypot(*across.T), np.arctan2(*across.T) // (np.pi / 6)
    foot, top = np.percentile(away, 97), x[:, 1] + radius
    ring = away // (2 * np.median(radius))
    highest = [
        max(np.flatnonzero((ring == i) & (sector == j)), key=lambda k: top[k])
        for i in np.unique(ring)
        for j in np.unique(sector)
        if ((ring == i) & (sector == j)).any()
    ]
    on = [k for k in highest if 0.15 * foot < away[k] < 0.85 * foot]
    return float(np.degrees(np.arctan(-np.polyfit(away[on], top[on], 1)[0])))


@pytest.mark.slow
@pytest.mark.optimised
def test_sand_heaps_up_at_its_angle_of_repose() -> None:
    # 30° to 35° for dry sand. Without rolling friction there is no heap, and the slope is 0°.
    result = run("sand_pile")
    assert [check.message for check in result.checks if not check.passed] == []
    assert 30 < slope_of_pile(result.final.position, result.final["radius"]) < 35


FLOWS = 0.3, 0.6
"""Sand flows evenly from the first time on, and some is left at the second [s]."""


def grains_a_second(neck: float, layers: int = 17) -> float:
    """How many grains run through a neck of a radius [m]."""
    glass = f"max(hypot(x, z) - 0.036, (hypot(x, z) - {neck} - abs(y)) / sqrt(2))"
    changes = {"colliders.0.distance": glass, "particles.0.layout.counts": [11, layers, 11], "checks": []}
    simulation, below = Simulation(ps.load(FOLDER / "hourglass.toml", changes), threads=1), []
    for time in FLOWS:
        simulation.advance_to(round(time / simulation.scenario.grid.dt))
        below.append(int((simulation.states[0].position[:, 1] < -0.005).sum()))
    simulation.close()
    return (below[1] - below[0]) / (FLOWS[1] - FLOWS[0])


def beverloo(neck: float) -> float:
    """0.58 φ √g (D − 1.4 d)^(5/2) over the volume of a grain, φ = 0.58 (Beverloo, Leniger, van de Velde, Chem. Eng. Sci. 15,
    260 (1961)) [1/s]."""
    d, share = 0.004, 0.58
    return 0.58 * share * math.sqrt(G) * (2 * neck - 1.4 * d) ** 2.5 / (math.pi / 6 * d**3)


@pytest.mark.slow
@pytest.mark.optimised
def test_sand_runs_out_of_an_hourglass_by_beverloos_law() -> None:
    narrow, wide = (grains_a_second(neck) for neck in (0.010, 0.014))
    # Some 200 and 600 grains are counted, and they come in bursts: the law holds to a fifth, and its exponent to a tenth.
    assert narrow == pytest.approx(beverloo(0.010), rel=0.2)
    assert wide == pytest.approx(beverloo(0.014), rel=0.2)
    wider = math.log((0.028 - 1.4 * 0.004) / (0.020 - 1.4 * 0.004))
    assert math.log(wide / narrow) / wider == pytest.approx(2.5, abs=0.25)


@pytest.mark.slow
@pytest.mark.optimised
def test_the_rate_does_not_depend_on_how_much_sand_is_above_and_small_holes_jam() -> None:
    assert grains_a_second(0.012, layers=11) == pytest.approx(grains_a_second(0.012), rel=0.1)
    # At 3.5 diameters hundreds of grains come before an arch holds, at 4.5 many thousands: how many grows without bounds
    # towards 4.9 (I. Zuriguel et al., Phys. Rev. E 71, 051303 (2005)).
    assert grains_a_second(0.007) < 0.05 * beverloo(0.007)
