"""Interactions of all pairs in which far particles act by multipoles.

All threads together compute the forces, and each adds those on its own particles. Every particle has its own sum, so the
third law holds to the accuracy asked for and no further: momentum drifts accordingly.

The accuracy is that of the root of the mean square of |δg|/|g| over particles, with g the force on a unit of mass or charge,
not below a thousandth of its mean.
Before the first step it is measured on some particles against direct sums, and the tolerance of the walk set until it is
met; from then on the estimate of errors keeps it as particles move.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site
from particlesim.engine.interactions.pair_blocks import CHARGE
from particlesim.engine.interactions.pair_tensors import PairTensors
from particlesim.engine.interactions.pairs import DirectPairs, pairs_of
from particlesim.engine.interactions.tree import calibration
from particlesim.engine.interactions.tree.field import (
    FULL,
    Hand,
    Tree,
    field_of_all,
    for_threads,
    new_tree,
    sum_field,
    with_height,
)
from particlesim.engine.interactions.tree.form import BothSigns, Form, Gradient, OneSign, Plummer
from particlesim.engine.state.columns import presence, type_of
from particlesim.interactions import PairSet
from particlesim.interactions.far import FarInteraction
from particlesim.model.vectors import square
from particlesim.process.preparing import preparing
from particlesim.process.threads import Team

SPRINGS_PER_PARTICLE = 200
"""About how many springs take as long as the forces on a particle."""
ENERGY_TOLERANCE = 0.3
"""Tolerance of a walk for the energy over that for forces: potentials are cut off one degree earlier, and energies are
compared with each other."""


class TreeColumns(NamedTuple):
    """An interaction summed with a tree: the same summed directly; room for the tree; the number c of U = −c w₁ w₂ f; which
    particles take part [n]; their w, of those that are there [n]; the field's size at each [n]; what errors are allowed [5]:
    the squares of the tolerance, of the widest opening, and of the widest target, the accuracy asked for, and the error
    that was measured, 0 before it is."""

    direct: DirectPairs
    tree: Tree
    coupling: float
    member: Any
    w: Any
    size: Any
    limits: Any


class TreePairs(Interaction, TreeColumns):
    """An interaction of all pairs, of which far ones are summed cell by cell."""

    __slots__ = ()
    prepares: ClassVar[bool] = True
    settled: ClassVar[bool] = True
    inexact: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(TreeColumns._fields) - {"size", "limits"}

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        load_sources(self, c, share.first, share.last)
        sum_field(self.tree, self.limits, self.size, c.x, c.y, c.z, self.w, share)

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        type(self).add_settled(self, c, total[:, first:last], first, last, t)

    def add_settled(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        field = self.tree.field
        for i in range(first, last):
            k = self.coupling * weight_of(self, c, i)
            total[0, i - first] += k * field[0, i]
            total[1, i - first] += k * field[1, i]
            total[2, i - first] += k * field[2, i]

    def error_of(self, c: Any, i: Any) -> Any:
        field = self.tree.field
        size = field[0, i] * field[0, i] + field[1, i] * field[1, i] + field[2, i] * field[2, i]
        return self.limits[calibration.TARGET] * abs(self.coupling * weight_of(self, c, i)) * np.sqrt(size)

    @property
    def number(self) -> int:
        return self.direct.number

    @property
    def effort(self) -> int:
        return SPRINGS_PER_PARTICLE * len(self.member)

    def in_team(self, threads: int) -> Self:
        return self._replace(tree=for_threads(self.tree, threads))

    def calibrate(self, c: Any, team: Team) -> Self:
        if self.limits[calibration.ERROR] == 0:
            self.w[:] = source_of(self, c)
            with preparing("measuring the errors of forces by a tree"):
                calibration.calibrate(self.tree, self.limits, self.size, (c.x, c.y, c.z), self.w, team)
        return self

    def energy(self, c: Any, t: float) -> float:
        w = source_of(self, c)
        tree, height = with_height(self.tree)
        limits = self.limits.copy()
        limits[calibration.TOLERANCE] *= ENERGY_TOLERANCE**2
        field_of_all(tree, limits, self.size.copy(), c.x, c.y, c.z, w, Hand(0, 1, new_gate()))
        with np.errstate(over="ignore", invalid="ignore"):  # the ledger says what is not finite
            return -0.5 * self.coupling * float((w * height).sum())

    def linearise(self, c: Any, t: float) -> PairTensors:
        return PairTensors(self.direct, c, t)

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        return self.direct.force_on(c, row, t)

    def summary(self) -> str | None:
        error, told = (
            float(self.limits[calibration.ERROR]),
            f"multipoles of order {len(self.tree.form.order)}",
        )
        if error > np.finfo(float).eps:  # measured
            told += f", rms relative force error {error:.1e} at the start"
        if self.tree.report[FULL]:
            told += "; there was no room for all cells, so that some leaves were large and sums slower"
        return told

    def after(self, before: Interaction, place: Ints) -> Self:
        if not isinstance(before, TreePairs):
            return self
        known = before.size[place >= 0]
        size = np.full(len(self.size), known.mean() if known.size else 0.0)
        size[place[place >= 0]] = known
        return self._replace(size=size, limits=before.limits)

    def changing(self) -> tuple[NDArray[Any], ...]:
        return (self.size, self.limits)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        size, limits = arrays
        return self._replace(size=size, limits=limits)


def load_sources(each: Any, c: Any, first: Any, last: Any) -> None:
    """Set w of particles [first, last), the part of it that counts in the present step."""
    for i in range(first, last):
        each.w[i] = weight_of(each, c, i) * presence(c.clock, i)


def weight_of(each: Any, c: Any, i: Any) -> Any:
    """Mass or charge of particle i, 0 of one that takes no part."""
    w = c.m[i] if isinstance(each.tree.form.signs, OneSign) else c.further[CHARGE][i]
    return w if each.member[i] > 0 else type_of(w, 0)


def source_of(each: TreePairs, c: Any) -> NDArray[np.float64]:
    """w of all particles that take part [n]."""
    w = c.m if isinstance(each.tree.form.signs, OneSign) else c.further[CHARGE]
    return np.where(each.member > 0, w.astype(float), 0.0)


def tree_of(site: Site, pairs: PairSet) -> TreePairs:
    """An interaction of all pairs among the particles of an island, summed with a tree.

    Raises UsageError for two at one place, if they have no force there.
    """
    law = pairs.law
    assert isinstance(law, FarInteraction)
    direct = pairs_of(site, pairs, again=False)
    count = site.whole.count
    member = np.zeros(count, np.int8)
    for name in pairs.groups:
        first = site.offset[name]
        member[first : first + site.state[name].count] = 1
    signs = OneSign() if law.by == "mass" else BothSigns()
    order = calibration.order_for(law.accuracy)
    form = Form((None,) * order, signs, Plummer(square(law.softening_length())), Gradient())
    limits = np.array([*calibration.first_limits(law.accuracy), law.accuracy, 0.0])
    return TreePairs(
        direct,
        new_tree(form, count, 1),
        law.coupling(),
        member,
        np.zeros(count),
        np.zeros(count),
        limits,
    )
