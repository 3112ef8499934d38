"""The guard: checks at frames that islands gain no energy from nothing and that no particle outruns light."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.emitters import Emitter
from particlesim.engine.diagnosis.overlaps import overlaps
from particlesim.engine.diagnosis.post_mortem import ran_away
from particlesim.engine.diagnosis.strongest_force import alone
from particlesim.engine.diagnosis.sunk import sunk
from particlesim.engine.gain import ROUNDING, Account, Gain, drift_of, jitter
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.shadow import swing, swings
from particlesim.engine.stability.limits import island_stability
from particlesim.engine.world import World
from particlesim.errors import UsageError
from particlesim.forces import Force
from particlesim.graph.graph import Island
from particlesim.integrators import ImplicitMethod
from particlesim.laws.registry import has_law, potential
from particlesim.scenario.reach import meetings_of

MOST_GAIN, MOST_IF_ABRUPT = 0.1, 0.5
"""Part of its energy that an island may gain from nothing; and where dampers begin abruptly, as those of contacts: how much
they do in the first step of a contact, which may be a twentieth of it, is known roughly."""
MUCH_FASTER = 1000.0
"""Times that speeds beyond that of light must have grown since the last frame."""
SELDOM = 256
"""Steps between two checks of energies without a ledger: their cost is small compared with that of so many steps."""
FEW = 8
"""Particles of a group whose kicks stand for those of all."""
LIGHT = 299_792_458.0
"""Speed of light [m/s]."""


class Guard:
    """Checks at every frame that islands gain no energy from nothing, and that particles do not outrun light.

    An island whose work is in the ledger, or that nothing feeds (no emission, wind, motion, belt, or field without a
    potential that stands still), must not gain more than a tenth of its energy from nothing (`engine.gain`), or half of it
    where dampers begin abruptly. The swing of a symplectic method (`engine.shadow`) is no gain while its step is stable and
    the run goes on; at the end it is, since nothing is left that would take it back. Islands that start inside of a collider
    begin after a step, which puts them on it; others begin anew after a kick. Without a ledger, energies are taken at the
    start, at frames at least 256 steps apart, and at the end. All islands are watched for speeds beyond that of light that
    have grown a thousandfold since the last frame: energy may come from a potential without a bottom.
    """

    def __init__(self, world: World, columns: Sequence[str]) -> None:
        pairs = list(zip(world.islands, world.graph.islands, strict=True))
        self._judged = [island.books is not None or _closed(structure) for island, structure in pairs]
        self._judged = [
            judged and all(group.dynamics.type == "second_order" for group in structure.groups)
            for judged, (_, structure) in zip(self._judged, pairs, strict=True)
        ]
        # Particles and bodies that touch, or that springs join, give energy to each other.
        meetings = meetings_of(world.scenario)
        meeting = {name for each in meetings for name in (each.particles, each.bodies)}
        meeting |= world.scenario.tied
        self._judged = [
            judged and not any(group.name in meeting for group in structure.groups)
            for judged, (_, structure) in zip(self._judged, pairs, strict=True)
        ]
        # Motors of joints give energy; without books nobody knows how much.
        driven = any(joint.driven for joint in world.scenario.joints)
        self._judged = [
            judged and not (driven and structure.rigid and island.books is None)
            for judged, (island, structure) in zip(self._judged, pairs, strict=True)
        ]
        # What starts inside is pushed apart step by step, which gives energy.
        self._judged = [
            judged and not island.intrusions()
            for judged, (island, _) in zip(self._judged, pairs, strict=True)
        ]
        # The first step at which the energies of an island can be a beginning.
        self._from = [int(any(overlaps(island, structure))) for island, structure in pairs]
        names = tuple(name for name in columns if name.startswith("potential."))
        absolute = tuple(_has_zero(world, name) for name in names)
        self._drift = drift_of(world.scenario.simulation.precision)
        self._accounts = [
            Account(names, absolute, 0 if island.books is None else len(island.books.names))
            for island, _ in pairs
        ]
        # Of every island: the number of its particles at the beginning, the gain up to which its steps were found to be
        # stable [J], the largest swing as a part of its energy, its largest speed [m/s].
        self._count = np.full(len(pairs), -1)
        self._stable, self._swung = np.zeros((2, len(pairs)))
        self._fastest = np.full(len(pairs), math.inf)
        self._looked = -SELDOM

    def forget(self) -> None:
        """Take the energies of the next frame as a new beginning: something has changed them from outside."""
        for account in self._accounts:
            account.forget()

    def wants(self, world: World) -> list[int]:
        """Islands whose energies are due for a check now, where there is no ledger."""
        if world.step < world.grid.steps and world.step - self._looked < SELDOM:
            return []
        return [number for number, judged in enumerate(self._judged) if judged]

    def look(self, world: World, energies: Mapping[int, dict[str, float]]) -> None:
        """Judge the present state of a world; `energies` are those of its islands by number [J], as far as known.

        Raises DivergenceError.
        """
        if energies:
            self._looked = world.step
        for number, island in enumerate(world.islands):
            if self._judged[number] and number in energies:
                self._judge(world, number, energies[number])
            fastest = max((_fastest(state.v[:, : state.count]) for state in island.states), default=0.0)
            if fastest > LIGHT and fastest > MUCH_FASTER * self._fastest[number]:
                raise ran_away(world, number, "speed", fastest, MUCH_FASTER)
            self._fastest[number] = fastest

    def glance(self, world: World, number: int, energies: Mapping[str, float]) -> None:
        """Judge an island between two frames, as at one; frames judge as if it had not been. Raises DivergenceError."""
        kept = (
            copy.deepcopy(self._accounts[number]),
            self._count[number],
            self._stable[number],
            self._swung[number],
        )
        self._judge(world, number, energies)
        self._accounts[number], self._count[number], self._stable[number], self._swung[number] = kept

    def judges(self, number: int) -> bool:
        """Whether the energies of an island are checked."""
        return self._judged[number]

    def _judge(self, world: World, number: int, energies: Mapping[str, float]) -> None:
        """Hold the gain of an island against its energy. Raises DivergenceError."""
        island, account, step = world.islands[number], self._accounts[number], world.step
        count = sum(state.count for state in island.states)
        books = island.books
        work, turned = np.zeros((2, 0)) if books is None else (books.totals, books.turned)
        lost = books is None and count != self._count[number]  # with particles that died
        if lost or count == 0 or account.first_step < 0:
            self._count[number] = count
            if step >= self._from[number]:
                account.begin(step, energies, work, turned, _fed(island))
            return
        roughly = _holds_back(world.graph.islands[number])
        gain = account.look(step, energies, work, turned, self._drift, _fed(island), roughly)
        most = MOST_IF_ABRUPT if any(each.abrupt for each in island.interactions) else MOST_GAIN
        if gain.ratio <= most:
            return
        gain = gain._replace(
            noise=gain.noise + jitter(island.states, world.grid.dt) + _rounded(world, number)
        )
        if gain.ratio <= most:
            return
        swings = self._swings(world, number, gain)
        if not swings or step == world.grid.steps:
            hint = _too_long(world, number) if swings else None
            raise ran_away(world, number, "energy", gain.joule, most, hint)

    def _swings(self, world: World, number: int, gain: Gain) -> bool:
        """Whether a gain is one that the method will take back."""
        island, structure = world.islands[number], world.graph.islands[number]
        dt, start = world.grid.dt, self._accounts[number].first_step
        if not swings(structure):
            return False
        swung = swing(island, structure, world.time, dt)
        if start == 0:
            swung -= _swing_at_start(world, number)
        kept = gain._replace(joule=gain.joule - swung)
        if not (math.isfinite(kept.joule) and kept.ratio <= MOST_GAIN):
            return False
        if gain.joule > 2 * self._stable[number]:  # seldom enough to look closely
            try:
                stable = island_stability(world, number).step
            except UsageError:
                return False
            if dt > stable:
                return False
            self._stable[number] = gain.joule
        self._swung[number] = max(self._swung[number], gain.ratio)
        return True

    def warnings(self, world: World) -> tuple[str, ...]:
        """A sentence for every island whose energy has swung by more than a tenth, though its steps are stable; and for hard
        grains that have sunk into each other."""
        found = list(sunk(world))
        for number, (part, island) in enumerate(zip(self._swung, world.islands, strict=True)):
            if part > MOST_GAIN:
                names = " and ".join(repr(state.name) for state in island.states)
                found.append(
                    f"the energy of {names} swings by {100 * part:.3g} %: {_too_long(world, number)}"
                )
        return tuple(found)


def _rounded(world: World, number: int) -> float:
    """The energy that rounding of all kicks so far may give [J]: each is m (a h)², also where a contact takes it back
    at once, as from what lies on a slope. And that of a lift by as much as hard contacts may close or open at rest."""
    dt, structure, total = world.grid.dt, world.graph.islands[number], 0.0
    slack = max((each.slack for each in world.islands[number].interactions), default=0.0)
    for member, state in enumerate(world.islands[number].states):
        error = ROUNDING * float(np.finfo(state.dtype).eps) * world.step
        some = np.unique(np.linspace(0, state.count - 1, min(state.count, FEW)).astype(int))
        gains = [0.0]
        for particle in (state.particle(int(i), world.time) for i in some):
            pull = sum(alone(world, structure, member, particle).values())
            if particle.m > 0 and math.isfinite(pull):
                gains.append(error * (pull * dt) ** 2 / particle.m + slack * pull * particle.r)
        total += state.count * max(gains)
    return total


def _holds_back(structure: Island) -> bool:
    """Whether colliders hold back what an implicit method moves, in steps that are long for its dampers: velocities jump
    there, and what dampers do in such a step is known roughly."""
    return isinstance(structure.method, ImplicitMethod) and any(structure.colliders)


def _fed(island: BaseIsland) -> float:
    """What interactions have given by moving particles apart [J]."""
    return float(sum(each.given for each in island.interactions))


def _too_long(world: World, number: int) -> str:
    """A hint for an island whose energy oscillates too much."""
    method = world.graph.islands[number].method
    other = ", or velocity_verlet" if method.order < 2 else ""
    return (
        f"dt = {world.grid.dt:.6g} s is stable for {method.name}, but too long to be accurate; "
        f"try a smaller dt{other}"
    )


def _swing_at_start(world: World, number: int) -> float:
    """What `swing` was when the run began [J]."""
    began = World(world.scenario)
    return swing(began.islands[number], began.graph.islands[number], began.time, world.grid.dt)


def _has_zero(world: World, column: str) -> bool:
    """Whether a potential of the ledger has a zero of its own: springs and hinges at rest, and some forces."""
    label = column.removeprefix("potential.")
    scenario = world.scenario
    forces = dict(zip(scenario.labels.forces, scenario.forces, strict=True))
    return forces[label].has_zero() if label in forces else True


def _closed(structure: Island) -> bool:
    """Whether nothing feeds energy to an island."""
    return (
        not any(each.feeds for each in structure.interactions)
        and not any(structure.motions)
        and not any(each.surface_velocity for colliders in structure.colliders for each in colliders)
        and all(c.motion is None for colliders in structure.colliders for c in colliders)
        and all(
            not isinstance(group, Emitter) and all(_conserves(law) for law in forces)
            for group, forces in zip(structure.groups, structure.forces, strict=True)
        )
    )


def _conserves(law: Force) -> bool:
    """Whether a force derives from a potential that stands still, or only takes energy."""
    if has_law(potential, law.record()):
        return not law.changes()
    return hasattr(law, "flow") and not law.flow


def _fastest(v: NDArray[Any]) -> float:
    """The largest component of a velocity [m/s]."""
    return float(max(v.max(), -v.min())) if v.size else 0.0
