"""The largest stable step of a world at its present state: of every island, by force and with all forces together.

What decides are the modes of the linearised island (`engine.stability.linearised`) and the stability region of its method
(`integrators.regions`). Forces change as particles move: the limit holds near the state that was looked at.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.stability.linearised import IslandModel, pairs
from particlesim.engine.world import World
from particlesim.errors import UsageError
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles
from particlesim.integrators import METHODS, ImplicitMethod, Method
from particlesim.integrators.regions import (
    SLIP_OF_STEPS,
    amplification,
    eigenvalues,
    growth,
    has_function,
    judged,
    largest_step,
)
from particlesim.interactions import PairSet
from particlesim.scenario.scenario import Scenario

TOLERATED = 10.0
"""Factor by which a mode may grow in a whole run before there is a warning: methods such as `heun` let every undamped
oscillation grow, most often by too little to see."""
ORBITS = "bounds: a sixteenth of the shortest passage of a pericentre"
"""What limits the steps of methods that follow orbits."""
MARGIN = 0.9
"""Part of the largest stable step that is recommended."""


@dataclass(frozen=True)
class IslandStability:
    """What holds for an island: groups, method, the largest stable step [s] under each force alone (`forces`) and under all
    (`step`); 0: none is stable, infinite: no limit.

    Adaptive methods have no limit: they choose steps that are short enough. WHFast has that of its orbits.
    `growth` is log10 of how much its least stable mode grows over the whole run with the step in use, and at most 0 for a
    stable one; `eigenvalues` are those of all forces together [1/s], and `spectra` those of every force alone; `how` is that
    of `Linearised`.
    """

    groups: tuple[str, ...]
    method: Method
    forces: dict[str, float]
    step: float
    growth: float
    how: str
    eigenvalues: NDArray[np.complex128] = field(repr=False)
    spectra: dict[str, NDArray[np.complex128]] = field(repr=False, default_factory=dict)
    rods: bool = False
    """Whether there are rods, which methods without a limit cannot hold."""
    pairs: bool = False
    """Whether there are interactions that have a limit with implicit methods, too: they are not in the matrix."""
    folds: float = 1.0
    """How much shorter a step is surely stable however its bodies crumple, as a factor."""

    def warning(self, dt: float) -> str | None:
        """What to tell whoever is about to run with steps of dt [s]; None where there is nothing to fear."""
        name = " and ".join(repr(group) for group in self.groups)
        if not self.growth > math.log10(TOLERATED):
            if self.folds <= 1 or not dt * self.folds > self.step > 0:
                return None
            return (
                f"dt = {dt:.6g} s is stable for {name} as it begins, up to {self.step:.3g} s, but perhaps not where it "
                f"crumples and its springs come to lie along one line: simulation.dt = "
                f"{rounded(self.step / self.folds):g} surely is"
            )
        if self.step == 0:
            return (
                f"{self.method.name} lets oscillations of {name} grow with every step, by a factor of "
                f"{_power(self.growth)} over this run with dt = {dt:.6g} s; {_others(self.method.name, rods=self.rods)}"
            )
        sure = " that is sure" if self.how.startswith("bounds") else ""
        return (
            f"dt = {dt:.6g} s is beyond the largest stable step{sure} of {self.method.name} for {name}, {self.step:.3g} s"
            f"{self._strictest()}: {remedy(self.step, limited=self.rods or self.pairs or self.how == ORBITS)}"
        )

    def _strictest(self) -> str:
        """The force that limits the step most, if there are several."""
        if len(self.forces) < 2:
            return ""
        name, step = min(self.forces.items(), key=lambda item: item[1])
        return f" ({name} alone: {step:.3g} s)" if math.isfinite(step) else ""


@dataclass(frozen=True)
class Stability:
    """The largest stable steps of a simulation with steps of `dt` [s]."""

    dt: float
    islands: tuple[IslandStability, ...]

    @property
    def step(self) -> float:
        """The largest step that is stable for all islands [s]."""
        return min((island.step for island in self.islands), default=math.inf)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for every island that cannot be stable."""
        return tuple(text for island in self.islands if (text := island.warning(self.dt)) is not None)

    def as_data(self) -> dict[str, Any]:
        """As plain data, for JSON; steps without a limit are None."""
        return {
            "dt": self.dt,
            "largest_stable_dt": _finite(self.step),
            "islands": [
                {
                    "groups": list(island.groups),
                    "method": island.method.label,
                    "largest_stable_dt": _finite(island.step),
                    "forces": {name: _finite(step) for name, step in island.forces.items()},
                    "growth_over_run_log10": island.growth,
                    "basis": island.how,
                }
                for island in self.islands
            ],
        }


def stability(world: World) -> Stability:
    """The largest stable steps of a world at its present state.

    Raises UsageError where forces change so fast that no number can hold it.
    """
    return Stability(
        world.grid.dt,
        tuple(island_stability(world, k) for k in range(len(world.islands))),
    )


def suspects(world: World) -> Stability:
    """The islands that cannot be stable with the step in use; fast where there are none.

    Large islands of springs are looked at closely only when bounds on their modes leave a doubt.
    """
    dt = world.grid.dt
    doubtful = []
    for k in range(len(world.islands)):
        with _within_numbers(world, k):
            doubtful += [] if _surely_stable(world, k) else [k]
    found = (island_stability(world, k) for k in doubtful)
    return Stability(dt, tuple(island for island in found if island.warning(dt) is not None))


def remedy(step: float, *, limited: bool) -> str:
    """What to try when steps are longer than the largest stable one [s].

    `limited`: with rods, which methods without a limit cannot hold, interactions that those leave explicit, or orbits, which
    those damp.
    """
    text = f"try simulation.dt = {rounded(MARGIN * step):g}"
    names = () if limited else unlimited()
    return f"{text}, or an integrator without a limit ({', '.join(names)})" if names else text


def rounded(step: float) -> float:
    """A step cut to two digits [s]."""
    if not (step > 0 and math.isfinite(step)):
        return step
    digits = 1 - math.floor(math.log10(step))
    return math.floor(step * 10.0**digits * (1 + 1e-12)) / 10.0**digits


def unlimited() -> tuple[str, ...]:
    """Methods that are stable for every decaying or oscillating mode, whatever the step."""
    wedge = np.concatenate(
        [1j * np.geomspace(1e-2, 1e6, 9), -np.geomspace(1e-2, 1e6, 9), [-1 + 1j, -1e3 + 1e3j]]
    )
    return tuple(
        name
        for name, method in METHODS.items()
        if has_function(method) and bool((np.abs(amplification(method, wedge)) <= 1 + 1e-12).all())
    )


def double_advised(scenario: Scenario) -> str:
    """What to do about numbers that single precision does not hold; "" in double precision."""
    if scenario.simulation.precision == "double":
        return ""
    return 'precision = "double" under [simulation] holds numbers from 1e-308 to 1e308, and "single" from 1e-38 to 3e38'


@contextmanager
def _within_numbers(world: World, number: int) -> Iterator[None]:
    """Turns what no number can hold into a UsageError."""
    try:
        with np.errstate(over="raise", invalid="raise"):  # too large, and infinite from the beginning
            yield
    except (FloatingPointError, np.linalg.LinAlgError):
        structure, island = world.graph.islands[number], world.islands[number]
        island.refuse_wild(world.time)
        names = " and ".join(repr(group.name) for group in structure.groups)
        masses = [state.mass[: state.count] for state in world.islands[number].states if state.count]
        least = f", whose masses begin at {min(map(np.min, masses)):.3g} kg," if masses else ""
        raise UsageError(
            f"the rates at which forces move {names}{least} are not finite, or beyond what numbers hold",
            "a stiffness, a coefficient or a mass is out of all proportion, or a force has no value where a particle starts"
            + (f"; {in_double}" if (in_double := double_advised(world.scenario)) else ""),
        ) from None


def island_stability(world: World, number: int) -> IslandStability:
    """The largest stable steps of one island at its present state. Raises UsageError as `stability` does."""
    with _within_numbers(world, number):
        return _judged(world, number)


def _judged(world: World, number: int) -> IslandStability:
    structure, grid = world.graph.islands[number], world.grid
    method = structure.method
    if structure.rigid:  # contacts are solved, and turns are exact
        return IslandStability(
            _names(structure), method, {}, math.inf, -math.inf, "rigid bodies", np.empty(0, complex), {}
        )
    model = _model(world, number)
    found = model.linearise()
    names = _names(structure)
    values = eigenvalues(found.together).ravel()
    spectra = {label: eigenvalues(system).ravel() for label, system in found.forces.items()}
    if not method.by_modes:
        free = dict.fromkeys(found.forces, math.inf)
        step = world.islands[number].longest_step_on_orbits()
        grown, how = (math.inf, ORBITS) if grid.dt > step else (-math.inf, found.how)
        return IslandStability(names, method, free, step, grown, how, values, spectra)
    factor = growth(method, found.together, grid.dt)
    total = grid.steps * math.log10(factor) if factor > 0 else -math.inf
    if not has_function(method) and factor <= 1 + SLIP_OF_STEPS:
        total = min(total, 0.0)  # rounding, not growth
    excluded = explicit_sets(world, number)
    left_out = excluded if isinstance(method, ImplicitMethod) else ()
    forces = {label: largest_step(method, system) for label, system in found.forces.items()}
    forces |= {label: _explicit_step(method, spectra[label]) for label in left_out if label in forces}
    step = min(
        largest_step(method, found.together), *(forces[each] for each in left_out if each in forces), math.inf
    )
    if left_out and grid.dt > step:
        total = math.inf
    return IslandStability(
        names,
        method,
        forces,
        step,
        total,
        found.how,
        values,
        spectra,
        bool(structure.constraints),
        bool(excluded),
        _folds(structure),
    )


def _folds(structure: Island) -> float:
    """How much stiffer crumpled bodies may be than at the start, as a factor of frequencies, where they touch something:
    a spring is at most as stiff across as it is along itself."""
    touch = any(structure.colliders) or any(
        isinstance(each, PairSet) and each.law.is_contact for each in structure.interactions
    )
    if not touch or isinstance(structure.method, ImplicitMethod):
        return 1.0
    return max(
        (group.layout.folds for group in structure.groups if isinstance(group, Particles)), default=1.0
    )


def explicit_sets(world: World, number: int) -> tuple[str, ...]:
    """Names of the interactions of an island that implicit methods have in the forces and not in the matrix."""
    island = world.islands[number]
    return tuple(
        name
        for name, each in zip(island.names, island.interactions, strict=False)
        if not each.by_chunks and not each.numbers
    )


def _explicit_step(method: Method, values: NDArray[np.complex128]) -> float:
    """The largest step of an implicit method under forces that are not in its matrix [s].

    A single solve takes them at the beginning of the step, as symplectic Euler does: h ω < 2. Newton's iterations go on with
    γ² h² ω² of their error, which must be less than 1.
    """
    assert isinstance(method, ImplicitMethod)
    fastest = float(np.abs(judged(values)).max(initial=0.0))
    return (1 / method.gamma if method.iterates else 2.0) / fastest if fastest > 0 else math.inf


def _surely_stable(world: World, number: int) -> bool:
    """Whether no mode can grow by more than is tolerated, by what is cheap to know."""
    if world.graph.islands[number].rigid:
        return True
    model = _model(world, number)
    method, grid = model.structure.method, world.grid
    if not method.by_modes:
        return grid.dt <= world.islands[number].longest_step_on_orbits()
    if isinstance(method, ImplicitMethod) and explicit_sets(world, number):
        return False
    limits = model.box()
    if limits is None:
        if model.structure.coupled:
            return False
        system = model.linearise().together
    else:
        k, d = (np.multiply(limit, [0, 0.25, 0.5, 0.75, 1]) for limit in limits)
        system = pairs(np.repeat(k, 5), np.tile(d, 5))
    factor = growth(method, system, grid.dt * _folds(model.structure))
    allowed = max(TOLERATED ** (1 / grid.steps), 1 + SLIP_OF_STEPS)
    return factor <= allowed


def _names(structure: Island) -> tuple[str, ...]:
    return tuple(group.name for group in structure.groups)


def _model(world: World, number: int) -> IslandModel:
    return IslandModel(world.scenario, world.graph.islands[number], world.islands[number], world.time)


def _others(method: str, *, rods: bool) -> str:
    """Methods that do not let oscillations grow, and hold rods if there are some."""
    known = ("symplectic_euler", "velocity_verlet", *(() if rods else ("rk4",)))
    names: Sequence[str] = [name for name in known if name != method]
    return f"try integrator = {' or '.join(repr(name) for name in names)}"


def _power(exponent: float) -> str:
    return f"10^{exponent:.0f}" if exponent > 4 else f"{10**exponent:.3g}"


def _finite(step: float) -> float | None:
    return step if math.isfinite(step) else None
