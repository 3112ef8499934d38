"""Interactions of all pairs in a box that is periodic along all axes, with all of their images, summed with a mesh.

The near part is a law like others, summed over neighbour lists, in whose order the particles are spread over the mesh. The
mean density exerts no force: a uniform background cancels it. The forces of the mesh are the gradient of its energy; their
sum is not zero but an error, which is subtracted from the particles in proportion to their squared weights.

Before the first step the error is measured on some particles against Ewald's sums, and the plan changed until it is as asked
for: the root of the mean square of |δF|/|F| over particles, |F| not below a thousandth of its mean, nor below a tenth of the
force of two neighbours at the mean distance, as forces in a crystal cancel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, shared
from particlesim.engine.barrier import meet, new_gate
from particlesim.engine.interactions.coincident import refuse_coincident
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Lone, Site, lone
from particlesim.engine.interactions.mesh import calibration
from particlesim.engine.interactions.mesh.bricks import (
    Bricks,
    Given,
    new_bricks,
    read,
    sort_by_bricks,
    spread,
)
from particlesim.engine.interactions.mesh.ewald import Sum, ewald_sum, near_volume, own_height
from particlesim.engine.interactions.mesh.fourier import (
    Waves,
    filter_waves,
    from_waves,
    new_lines,
    new_waves,
    to_waves,
)
from particlesim.engine.interactions.mesh.influence import Influence, Transform, influence, transform
from particlesim.engine.interactions.mesh.plan import (
    TYPICAL,
    Plan,
    Task,
    class_of,
    far_reach,
    planned,
    uniform,
)
from particlesim.engine.interactions.mesh.split import ByCharge, ByMass, Near, ended, far_of
from particlesim.engine.interactions.near_pairs import (
    NearLists,
    bring_up,
    look_in,
    near_energy,
    near_forces,
    near_virial,
    pull_on,
)
from particlesim.engine.interactions.near_sums import pull_all
from particlesim.engine.interactions.neighbours.record import (
    DUE,
    Neighbours,
    enlarged,
    forget,
    new_neighbours,
)
from particlesim.engine.interactions.neighbours.refresh import Crew
from particlesim.engine.interactions.pair_blocks import CHARGE, Block
from particlesim.engine.interactions.pairs import what_acts
from particlesim.engine.step.records import as_precision
from particlesim.interactions import PairSet
from particlesim.interactions.far import FarInteraction
from particlesim.model.vectors import square
from particlesim.process.preparing import preparing
from particlesim.process.threads import Team

SPRINGS = 40
"""About how many springs take as long as a particle with its neighbours and nodes."""
Made = TypeVar("Made", bound="MeshPairs")

WORTH_THREADS = 5_000
FEWEST = 50
"""For fewer particles than these nothing is typical: a plan without measured errors is made for as many."""
SHORTEST = 0.5
"""Where softening alone cuts forces off, the end of the near part over the mean distance of particles: lists of nearer ones
would not hold for long."""
BY_LAW = 0.1
"""How exact the polynomials of the far part are, over the accuracy."""
WITHOUT_END = np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore")
"""Numbers that overflow are infinite; checks of energies and errors report that."""
ALPHA, CUTOFF, NODES, ERROR, TOTAL = 0, 1, 2, 5, 6
"""Places in `plan`: those of a `Plan`, the error that was measured, 0 before it is, and Σ w over Σ |w|."""


class Aim(NamedTuple):
    """What is asked for, and does not change: the law of pairs in double precision, and what they act by; c of
    U = −c w₁ w₂/R, the accuracy, the softening of the far part [m], and how far the near part must reach in any case [m]."""

    law: Any
    by: Any
    strength: float
    accuracy: float
    softening: float
    least: float


class MeshColumns(NamedTuple):
    """The columns of `NearColumns`, of the near part; the order of the splines, as many None; mesh, roots of unity, scratch
    of every thread, influence function; by how much the energy of a unit particle is too high on it [1/m]; ∫ U of the near
    part [J m³]; what is asked for, the plan that all is made for, and the plan as an array of the state [7], which may be
    another one after a resume, until the next interval begins (`renewed`)."""

    law: Any
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    seen: Block
    pull: Any
    box: Any
    spline: tuple[None, ...]
    bricks: Bricks
    waves: Waves
    lines: Any
    influence: Any
    excess: float
    volume: float
    aim: Aim
    made: Plan
    plan: Any


class MeshPairs(NearLists, MeshColumns):
    """An interaction of all pairs and their images, cut into a near part and one on a mesh."""

    __slots__ = ()
    follows: ClassVar[frozenset[str]] = frozenset(MeshColumns._fields) - {"plan"}
    inexact: ClassVar[bool] = True

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        near, changed = self.near, bring_up(self, c, share, t)
        if changed or near.report[DUE] != 0:
            pull_all(self, t)
            meet(share.gate, share.threads)
            crew = Crew(share.number, share.threads, share.gate)
            far_forces(on_mesh(self), self.influence, self.aim.strength, self.pull, crew)
            if share.number == 0:
                near.report[DUE] = 0

    def error_of(self, c: Any, i: Any) -> Any:
        return self.aim.accuracy * pull_on(self, i)

    @property
    def effort(self) -> int:
        nodes = self.bricks.mesh.size
        return SPRINGS * len(self.near.members) + nodes // 4

    def in_team(self, threads: int) -> Self:
        bricks = self.bricks._replace(counts=np.zeros((threads, len(self.bricks.begin) - 1), np.int64))
        return self._replace(bricks=bricks, lines=new_lines(self.made.shape, threads))

    def renewed(self) -> Self:
        forget(self.near)
        each = fitted(self, plan_in(self.plan))
        near = enlarged(each.near)
        return each if near is each.near else each._replace(near=near)

    def calibrate(self, c: Any, team: Team) -> Self:
        if self.plan[ERROR] > 0:
            return self
        with preparing("measuring the errors of forces by a mesh"):
            return self._measured(c._replace(clock=None), team)

    @WITHOUT_END
    def _measured(self, c: Any, team: Team) -> Self:
        """The same with a plan whose errors have been measured, at the present places of all particles."""
        weight = weights_of(self, c)
        size = np.abs(weight).sum()
        self.plan[TOTAL] = weight.sum() / size if size > 0 else 0.0
        if np.count_nonzero(weight) < 2:
            return self
        members = self.near.members
        place = np.stack([column.astype(float) for column in (c.x, c.y, c.z)])
        task = task_of(self, len(members))._replace(
            nearer=calibration.counted(np.ascontiguousarray(place[:, members]), self.box)
        )
        exact = self._exact()
        calibration.refuse_long(self.made, task.size, exact.waves, self.aim.accuracy)
        sample = calibration.sampled(place, weight, task.volume, exact, team)
        threads = team.threads if len(members) > WORTH_THREADS else 1
        made = [self]  # the last one measured

        def measure(plan: Plan) -> float:
            made[0] = fitted(made[0], plan)
            found = _forces_at(made[0], c, sample.rows, threads, team) / self.aim.strength
            miss = np.linalg.norm(found - weight[sample.rows] * sample.gradient, axis=0)
            return float(np.sqrt(np.mean((miss / sample.need) ** 2)))

        total = float((weight**2).sum())
        plan, error = calibration.calibrated(task, self.aim.accuracy, sample, total, measure)
        each = fitted(made[0], plan)
        each.plan[ERROR] = error
        return each

    def _exact(self) -> Sum:
        """Sums to compare with."""
        error = max(calibration.EXACT * self.aim.accuracy, 1e-13)
        aim = self.aim
        given = (aim.law, aim.by, aim.strength, self.box, aim.softening, error)
        return ewald_sum(*given, everywhere=self.least is None)

    def bounds(self, c: Any, w: Floats, t: float) -> tuple[Ints, Floats, Floats]:
        """As of the near part, but no less than the square of the plasma frequency, 4π c w ρ/m, that all have together."""
        rows, stiff, damped = super().bounds(c, w, t)
        weight = np.abs(weights_of(self, c))
        collective = 4 * math.pi * abs(self.aim.strength) * weight * weight.sum() / math.prod(self.box)
        return rows, np.maximum(stiff, collective * w), damped

    @WITHOUT_END
    def energy(self, c: Any, t: float) -> float:
        near = float(near_energy(self, c._replace(clock=None), lone(c.x.size)))
        power, _ = self._power(c)
        weight = weights_of(self, c)
        own = (own_height(self.made.alpha, self.aim.softening) + self.excess) * float((weight**2).sum())
        far = -0.5 * self.aim.strength * (float(power.sum()) - own)
        return near + far + self._background(weight) + self._ended(weight)

    @WITHOUT_END
    def virial(self, c: Any, t: float) -> Floats:
        """Σ l ⊗ f over all pairs and images, −∂U/∂strain [J], shape [3, 3]."""
        out = np.zeros(9)
        near_virial(self, c._replace(clock=None), lone(c.x.size), t, out)
        power, k = self._power(c)
        squares = sum(each**2 for each in k)
        steep = power * _transform(self).slopes(np.asarray(squares))
        far = np.array([[float((steep * a * b).sum()) for a in k] for b in k])
        far += float(power.sum()) * np.eye(3)
        rest = self._background(weights_of(self, c)) * np.eye(3)
        return out.reshape(3, 3) - 0.5 * self.aim.strength * far + rest

    def _power(self, c: Any) -> tuple[Floats, list[Floats]]:
        """What every wave on the mesh adds to Σ w Φ, and the waves along the axes [1/m], to be broadcast."""
        density_waves(self, c._replace(clock=None), lone(c.x.size))
        self.near.report[DUE] = 1
        shape, half = self.made.shape, self.bricks.mesh.shape[2] // 2
        last = shape[2] // 2 + 1
        waves = self.bricks.mesh[..., :last] ** 2 + self.bricks.mesh[..., half : half + last] ** 2
        index = [np.minimum(np.arange(n), n - np.arange(n)) for n in shape[:2]]
        waves *= self.influence[..., :last][index[0]][:, index[1]]
        waves[..., 1 : last - 1] *= 2  # of a real density, the other half is the same
        numbers = [np.fft.fftfreq(n, 1 / n) for n in shape[:2]] + [np.arange(last, dtype=float)]
        k = [2 * np.pi * n / length for n, length in zip(numbers, self.box, strict=True)]
        return waves, [k[0][:, None, None], k[1][None, :, None], k[2][None, None, :]]

    def _background(self, weight: Floats) -> float:
        """The energy of the near part with the background [J], which the waves do not have."""
        return -0.5 * self.volume / math.prod(self.box) * square(float(weight.sum()))

    def _ended(self, weight: Floats) -> float:
        """What the energy lacks as that of pairs ends at 0 [J]. Masses within the reach are the mean of the background,
        which has it; charges gather the opposite of their own around them (D. Wolf et al., J. Chem. Phys. 110, 8254
        (1999))."""
        if isinstance(self.law.by, ByMass):
            return 0.0
        return -0.5 * near_law(self.aim, self.made).end * float((weight**2).sum())

    def summary(self) -> str:
        plan = self.made
        told = (
            f"mesh of {' × '.join(map(str, plan.shape))} with splines of order {len(self.spline)}, "
            f"near part up to {plan.cutoff:.3g} m"
        )
        if self.plan[ERROR] > 0:
            told += f", rms relative force error {self.plan[ERROR]:.1e} at the start"
        if isinstance(self.law.by, ByMass):
            told += "; the mean density does not act"
        elif abs(self.plan[TOTAL]) > 1e-9:
            told += "; the charges are not neutral, and a uniform background makes them so"
        return told

    def after(self, before: Interaction, place: Ints) -> Self:
        if not isinstance(before, MeshPairs):
            return self
        self.plan[:] = before.plan
        return fitted(self, plan_in(before.plan))

    def changing(self) -> tuple[NDArray[Any], ...]:
        return (self.plan,)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        (plan,) = arrays
        return self._replace(plan=plan)


# What kernels do


def on_mesh(each: Any) -> Any:
    """The mesh, and the particles as it sees them."""
    weight = each.seen.m if isinstance(each.law.by, ByMass) else each.seen.q
    shape, box = each.made.shape, each.box
    cells = (shape[0] / box[0], shape[1] / box[1], shape[2] / box[2])
    given = Given(each.near.x, weight, each.near.part, cells, shape)
    return OnMesh(each.spline, each.bricks, each.waves, each.lines, given)


class OnMesh(NamedTuple):
    """Splines, bricks, roots of unity, scratch of all threads, particles."""

    spline: Any
    bricks: Any
    waves: Any
    lines: Any
    given: Any


@shared
def far_forces(on: Any, influence: Any, strength: Any, pull: Any, share: Any) -> None:
    """Add the forces of the far part to `pull`, by all threads together."""
    spline, bricks, waves, lines, given = on
    count, mine = given.nodes[2], lines[share.number]
    sort_by_bricks(bricks, given, share)
    spread(spline, bricks, given, share)
    to_waves(bricks.mesh, count, waves, mine, share)
    filter_waves(bricks.mesh, waves, mine, influence, share, True)
    from_waves(bricks.mesh, count, waves, mine, share)
    read(spline, bricks, given, strength, pull, share)


@shared
def far_waves(on: Any, influence: Any, share: Any) -> None:
    """The waves of the density on the mesh, for one thread."""
    spline, bricks, waves, lines, given = on
    sort_by_bricks(bricks, given, share)
    spread(spline, bricks, given, share)
    to_waves(bricks.mesh, given.nodes[2], waves, lines[0], share)
    filter_waves(bricks.mesh, waves, lines[0], influence, share, False)
    for k in range(bricks.turns.size):
        bricks.turns[k] = 0


@kernel
def density_waves(each: Any, c: Any, share: Any) -> None:
    """`far_waves` with lists that hold."""
    look_in(each, c, share, 0.0)
    far_waves(on_mesh(each), each.influence, Crew(share.number, share.threads, share.gate))


# How it is made


def weights_of(each: MeshPairs, c: Any) -> Floats:
    """Masses or charges of all particles of an island, 0 of those that take no part [n]."""
    column = c.m if isinstance(each.law.by, ByMass) else c.further[CHARGE]
    weight, members = np.zeros(len(column)), each.near.members
    weight[members] = column[members]
    return weight


def task_of(each: MeshPairs, count: int) -> Task:
    """What a plan is made for, of particles without order."""
    aim = each.aim
    return task_in(each.box, aim, len(each.spline), count)


def task_in(size: tuple[float, float, float], aim: Aim, order: int, count: int) -> Task:
    """The same before there is anything."""
    spacing = (math.prod(size) / max(count, 1)) ** (1 / 3)
    least = min(max(aim.least, SHORTEST * spacing), min(size) / 2)
    return Task(size, aim.softening, order, count, least, uniform(size, max(count, 1)))


def first_plan(task: Task, accuracy: float) -> Plan:
    """The plan for particles without order, all of the same weight."""
    n = max(task.number, FEWEST)
    typical = TYPICAL * (n / task.volume) ** (2 / 3) / math.sqrt(n)
    return planned(task, calibration.AIM * accuracy * typical)


def plan_in(array: Floats) -> Plan:
    """The plan of a state."""
    x, y, z = (int(n) for n in array[NODES : NODES + 3])
    return Plan(float(array[ALPHA]), float(array[CUTOFF]), (x, y, z))


def _transform(each: MeshPairs) -> Transform:
    return transform(each.made.alpha, each.aim.softening)


def fitted(each: Made, plan: Plan) -> Made:
    """The same for another plan; itself where it is made for that one."""
    if plan == each.made:
        return each
    dtype = each.pull.dtype
    each.plan[: len(_numbers(plan))] = _numbers(plan)
    return each._replace(
        **_parts(each.aim, plan, each.box, len(each.spline), len(each.pull), dtype),
        near=new_neighbours(
            each.near.members,
            len(each.near.place),
            plan.cutoff,
            box=each.box,
            clocked=each.near.part is not None,
            dtype=dtype,
        ),
    )


def _numbers(plan: Plan) -> list[float]:
    return [plan.alpha, plan.cutoff, *plan.shape]


@lru_cache(maxsize=8)
def influence_of(plan: Plan, box: tuple[float, float, float], order: int, softening: float) -> Influence:
    """The influence function of a plan; kept, since births and deaths ask for it again."""
    return influence(plan.shape, box, order, transform(plan.alpha, softening))


def near_law(aim: Aim, plan: Plan) -> Near:
    """The near part of a plan: its energy ends at 0, so that energy does not jump where pairs come and go."""
    _, accuracy = class_of(aim.accuracy)
    reach = far_reach(accuracy)
    far = far_of(plan.alpha, square(aim.softening), aim.strength, reach, BY_LAW * accuracy / reach**3)
    return ended(Near(aim.law, aim.by, far), plan.cutoff)


def _parts(aim: Aim, plan: Plan, box: Any, order: int, room: int, dtype: Any) -> dict[str, Any]:
    """The columns that follow from a plan, but for the lists."""
    law = near_law(aim, plan)
    found = influence_of(plan, box, order, aim.softening)
    return {
        "law": as_precision(law, dtype),
        "most": dtype.type(square(plan.cutoff)),
        "bricks": new_bricks(plan.shape, room, 1),
        "waves": new_waves(plan.shape),
        "lines": new_lines(plan.shape, 1),
        "influence": found.function,
        "excess": found.excess,
        "volume": near_volume(law, plan.cutoff),
        "made": plan,
    }


def mesh_of(site: Site, pairs: PairSet) -> MeshPairs:
    """An interaction of all pairs and their images among the particles of an island, summed with a mesh.

    Raises UsageError for two at one place, if they have no force there.
    """
    law, dtype = pairs.law, site.dtype
    assert isinstance(law, FarInteraction)
    if law.singular() and site.began:
        with site.scenario.at_interaction(pairs.name):
            refuse_coincident(site, pairs)
    _, _, least, _, a, b, ids = what_acts(site, pairs, None)
    box = site.scenario.simulation.box
    assert box is not None
    names = sorted(pairs.groups, key=site.offset.__getitem__)
    rows = [np.arange(site.offset[name], site.offset[name] + site.state[name].count) for name in names]
    members = np.concatenate(rows)
    by = ByMass() if law.by == "mass" else ByCharge()
    aim = Aim(law.record(), by, law.coupling(), law.accuracy, law.far_softening(), law.near_reach())
    x, y, z = (float(length) for length in box.size)
    size, (order, _) = (x, y, z), class_of(law.accuracy)
    plan = first_plan(task_in(size, aim, order, len(members)), law.accuracy)
    near = new_neighbours(
        members, site.whole.count, plan.cutoff, box=size, clocked=site.whole.clocked, dtype=dtype
    )
    room = near.order.size
    charge = np.zeros(room, dtype) if law.by == "charge" else None
    seen = Block(None, None, None, None, None, None, np.zeros(room, dtype), None, charge, None, None, None)
    numbers = np.array([*_numbers(plan), 0.0, 0.0])
    return MeshPairs(
        near=near,
        least=least,
        a=a,
        b=b,
        ids=ids,
        seen=seen,
        pull=np.zeros((room, 3), dtype),
        box=size,
        spline=(None,) * order,
        aim=aim,
        plan=numbers,
        **_parts(aim, plan, size, order, room, dtype),
    )


def _forces_at(each: MeshPairs, c: Any, rows: Ints, threads: int, team: Team) -> Floats:
    """Forces on some particles [3, rows], by so many threads."""
    mine, gate = each.in_team(threads), new_gate()
    team.each(lambda k: near_forces(mine, c, Lone(0, 0, k, threads, gate), 0.0), threads)
    return np.asarray(mine.pull[mine.near.place[rows]].T.astype(float))
