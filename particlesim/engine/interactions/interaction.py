"""The interface of a kind of interaction, for sums of forces, implicit methods, the ledger, stability and output.

A kind is a class of records. The record of a set of its interactions (the springs of one law, the drag on one surface) is a
NamedTuple of numbers and arrays, which is what kernels get; its class says what it does. Kernels choose by the type of the
record, as they do for laws: `type(each).add_forces(each, ...)` is known while they are compiled.

An island holds a tuple of such records, `interactions`, and a tuple of their names. Those that are added chunk by chunk of
particles (`by_chunks`: springs) come first; all others are added by every thread to its own particles, in their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet, new_gate
from particlesim.engine.interactions.coupling import Coupling
from particlesim.engine.state.columns import presence
from particlesim.engine.state.group_state import GroupState
from particlesim.process.threads import Team
from particlesim.scenario.reach import mortal
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Interaction:
    """Base of the kinds of interaction. A record derives from this class and from a NamedTuple of its columns.

    Methods for kernels are compiled, and take what they work on as arguments; the others run in Python. States are `Columns`
    of the whole island, c.
    """

    __slots__ = ()

    by_chunks: ClassVar[bool] = False
    """Whether its forces are added chunk by chunk, between the moves of particles (`coupled.forces`)."""
    internal: ClassVar[bool] = True
    """Whether its forces stay the same when all particles get the same velocity, so that momentum is kept."""
    numbers: ClassVar[int] = 0
    """Numbers for each interaction that implicit methods keep of its linearisation; 0: it is left out of the matrix."""
    follows: ClassVar[frozenset[str]] = frozenset()
    """Fields that follow from the scenario; the others belong to the state, and to checkpoints."""
    spends_as: ClassVar[str | None] = None
    """The name in the ledger of the work that its potential does not account for; None: its own name."""

    together: ClassVar[bool] = False
    """Whether threads do what `stiffen` and `multiply` need together (`stiffen_together`, `multiply_together`)."""

    prepares: ClassVar[bool] = False
    """Whether it has something to find out before every sum of forces (`prepare`)."""

    movable: ClassVar[bool] = False
    """Whether it can be `among` particles in another order."""
    settled: ClassVar[bool] = False
    """Whether `add_forces` reads of other particles only what `prepare` has found out: particles may then move as soon as
    the forces on them are known."""

    inexact: ClassVar[bool] = False
    """Whether its forces are known to an accuracy alone (`error_of`), and may jump by as much from one place to the next."""

    resumes: ClassVar[bool] = False
    """Whether all that steps find out is among `changing`, so that a resumed run knows it, too."""

    concludes: ClassVar[bool] = False
    """Whether it has something to do at the end of every step (`conclude`)."""
    looks_back: ClassVar[bool] = False
    """Whether it then needs the state at the beginning of the step."""
    jointly: ClassVar[bool] = False
    """Whether all of its kind in an island conclude a step together (`conclude_all`), and look before at what has happened
    within it (`hasten`)."""
    tires: ClassVar[bool] = False
    """Whether its steps may take so long that some of them are worth a pause (`tired`)."""

    # ---- kernels: forces, and the matrix of implicit methods

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        """Find out what forces need, such as neighbours, before they are summed at time t.

        All threads of an island call it, with all positions in place; thread `share.number` of `share.threads` owns
        particles [share.first, share.last). Threads may `meet` in it as often as they like, all equally often; where it has
        written what others read, it ends with one, as `add_forces` only reads.
        """

    def hasten(
        self, sets: Any, alone: bool, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any
    ) -> None:
        """Look at what has happened within a step that is a good one, before any of the sets concludes it; it is called once
        for all of them, by all threads of an island. `alone`: whether there are no other sets."""

    def conclude_all(self, sets: Any, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        """`conclude` for all sets of its kind, of which it is the first."""

    def conclude(self, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        """Bring up to date what it remembers, or give impulses, at the end t of a step of length h that is a good one.

        All threads of an island call it, with all particles in their places after other contacts; `parts`
        are the groups with their colliders, and `before` [6, n] is the
        state at the beginning of the step, where it `looks_back`. It ends with a `meet`.
        """

    def tired(self) -> Any:
        """Whether steps should pause after the one that has been concluded: they have taken long since the last pause, or
        are to be done again."""
        return False

    def leave(self) -> None:
        """Forget results that are valid only right after `conclude`: others may change the state before the next step."""

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        """Add its forces on particles [first, last) at time t to total [3, n], and torques on them to rows 3 to 5 where
        particles spin.

        Where particles may be born or die, what particle j does to others counts `presence(c.clock, j)` times; whether those
        are there themselves makes no difference here.
        """
        raise NotImplementedError

    def add_settled(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        """The same, of one that is `settled`, to total [3, last − first], and torques to rows 3 to 5."""

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        """Linearise: put into `form` [numbers, n] what `multiply` needs of γ times the positive part of −∂f/∂x, and of
        −∂f/∂v, with γ = `reach`; add its part to the blocks of particles [first, last), and take from their residuals what
        its forces lose by the lead (`implicit.linear_system`)."""

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        """Add its matrix times x [3, n] to y, on particles [first, last)."""

    def stiffen_together(self, form: Any, c: Any, s: Any, share: Any, t: Any, reach: Any) -> None:
        """What `stiffen` adds afterwards, once threads have met, to particles of any thread."""

    def multiply_together(self, form: Any, x: Any, share: Any) -> None:
        """What `multiply` adds afterwards, once threads have met, to particles of any thread."""

    def error_of(self, c: Any, i: Any) -> Any:
        """By how much its last force on particle i may be off [N], of one that is `inexact`."""

    # ---- Python

    @property
    def number(self) -> int:
        """How many interactions there are."""
        raise NotImplementedError

    def renewed(self) -> Self:
        """The same for a new interval between frames, or for one that is repeated: what it has found out is forgotten, so
        that a run which is resumed there goes on with the same bits; with more room where it had too little."""
        return self

    def recalled(self) -> Self:
        """The same after what steps change has been set to what it was at another time."""
        return self.renewed()

    def roomier(self) -> Self:
        """The same with more room where it had too little, before its interval is done again."""
        return self.renewed()

    @property
    def lasts(self) -> bool:
        """Whether what it has found out is of use in an interval after the next, though others move particles meanwhile."""
        return False

    @property
    def cramped(self) -> bool:
        """Whether something found no room in this interval, which is then done again with more (`roomier`)."""
        return False

    def new_form(self, dtype: Any) -> NDArray[Any]:
        """Room for what it keeps of its linearisation, [numbers, n] unless it says otherwise: for every thread its own, or
        for all what they find out `together`."""
        return np.zeros((self.numbers, self.number), dtype)

    @property
    def effort(self) -> int:
        """About how many springs take as long."""
        return self.number

    def between(self, first: int, last: int) -> Self:
        """What concerns particles [first, last), in the same order: the share of a thread."""
        return self

    def in_team(self, threads: int) -> Self:
        """The same with room for so many threads to work at it together."""
        return self

    def calibrate(self, c: Any, team: Team) -> Self:
        """The same after it has found out once, before the first step, what steps need to know, which is among `changing`.

        Raises UsageError where it cannot be as was asked for.
        """
        return self

    def summary(self) -> str | None:
        """How its forces are summed, and their measured errors, in words; None: nothing to say."""
        return None

    def laid_again(self, site: Site, place: Ints) -> Self | None:
        """The same for other rows, after births and deaths: row k has become row `place[k]` of `site`, and is gone if that
        is −1. Only called between steps. None for a kind without a history: it is laid out anew."""
        return None

    def after(self, before: Interaction, place: Ints) -> Self:
        """One that is laid out anew after births and deaths, with what the one before, of which row k is row `place[k]` now,
        has found out."""
        return self

    def virial(self, c: Any, t: float) -> Floats | None:
        """Σ l ⊗ f over its pairs at time t [J], shape [3, 3]; None of what is no sum over pairs."""
        return None

    def among(self, rows: Ints, place: Ints) -> Self | None:
        """The same among particles in another order, whose row k is row `rows[k]` of the present one and row `place[k]` of
        which is k, for steps; what is known by places of its own is shared. None for a kind that cannot."""
        return None

    def bring_back(self, there: Self, rows: Ints, place: Ints) -> None:
        """Copy the changes of the same `among` particles in another order."""

    def energy(self, c: Any, t: float) -> float | None:
        """Potential energy at time t [J] of all particles in c, born yet or not, or dead; None for a kind without one."""
        return None

    @property
    def spends(self) -> bool:
        """Whether its forces do work that no potential accounts for."""
        return False

    @property
    def abrupt(self) -> bool:
        """Whether some of this work begins with a jump of the power, within a step that does not know of it."""
        return False

    def power(self, c: Any, t: float) -> float:
        """The power of such forces [W]; in a step (`in_step`), in which what is there for a part of it counts so much."""
        return 0.0

    @property
    def slack(self) -> float:
        """How far contacts at rest may overlap, or be apart, as a part of the radius."""
        return 0.0

    @property
    def given(self) -> float:
        """What it has given to particles by moving them apart, without forces [J]."""
        return 0.0

    @property
    def stopped(self) -> int:
        """How often a particle has had more impacts in a step than are followed."""
        return 0

    def snapped(self, before: Self, c: Any) -> float:
        """What its potential has lost in a step by jumps of contacts that have begun or ended since `before` [J]."""
        return 0.0

    def linearise(self, c: Any, t: float) -> Coupling:
        """The set near a state, for the largest stable step."""
        raise NotImplementedError

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        """Its force on one particle [N], shape [3], in plain Python."""
        raise NotImplementedError

    def topology(self, name: str, ids: Ints) -> Topology | None:
        """What a trajectory keeps of it, by the ids of the particles; None: nothing."""
        return None

    @property
    def broke(self) -> Floats | None:
        """When each broke or lost a particle [s], infinity while it holds, in the order of `topology`; None where none
        can."""
        return None

    def without_dead(self, now: Self, c: Any) -> Self:
        """The same without those that, up to its later state `now`, broke because they lost a particle."""
        return self

    def changing(self) -> tuple[NDArray[Any], ...]:
        """The arrays in it that steps change."""
        return ()

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        """The same with other such arrays."""
        return self


class Lone(NamedTuple):
    """The share of a thread that is alone."""

    first: int
    last: int
    number: int
    threads: int
    gate: Any


def lone(count: int) -> Lone:
    """The share of a thread that owns all of some particles."""
    return Lone(0, count, 0, 1, new_gate())


class Site:
    """Where interactions are laid out: the particles of an island, as one state and group by group; `began` if they are
    those of the start, where errors in the scenario are reported; `common`: arrays that several of them have together;
    `obstacles`: rigid bodies in their way, None if there are none."""

    def __init__(
        self,
        scenario: Scenario,
        whole: GroupState,
        states: Sequence[GroupState],
        *,
        began: bool = True,
        obstacles: Any = None,
    ) -> None:
        self.scenario, self.whole, self.began, self.obstacles = scenario, whole, began, obstacles
        self.common: dict[str, Any] = {}
        self.state = {state.name: state for state in states}
        begins = np.cumsum([0, *(state.count for state in states)]).tolist()
        self.offset = {state.name: begin for state, begin in zip(states, begins, strict=False)}

    def mortal(self, *names: str) -> bool:
        """Whether particles of some groups may die."""
        return any(mortal(self.scenario, name) for name in names)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The precision of the run."""
        return cast("np.dtype[Any]", self.whole.dtype)

    @property
    def place(self) -> Floats:
        """Positions [m], shape [3, n]."""
        return np.asarray(self.whole.x[:, : self.whole.count].astype(float))

    def inverse_mass(self) -> Floats:
        """1/m of every particle [1/kg], 0 of a pinned one."""
        inverse = 1 / self.whole.mass[: self.whole.count].astype(float)
        inverse[self.pinned()] = 0
        return np.asarray(inverse)

    def pinned(self) -> NDArray[np.bool_]:
        """Which particles no force moves from the start on: those that stuck are none, so that it does not matter when
        interactions are laid out."""
        if not self.whole.clocked:
            return np.zeros(self.whole.count, np.bool_)
        return np.asarray(np.isinf(self.whole.start[: self.whole.count])) & ~self.whole.stuck()


@outlined
def prepare_set(each: Any, c: Any, share: Any, t: Any) -> None:
    """`prepare` for one set."""
    type(each).prepare(each, c, share, t)


def prepare_elements(sets: Any, c: Any, share: Any, t: Any) -> None:
    """Let all sets that have to find something out before a sum of forces do so; all threads of an island come here."""
    for each in sets:
        if type(each).prepares:
            prepare_set(each, c, share, t)


@outlined
def conclude_set(each: Any, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """`conclude` for one set."""
    type(each).conclude(each, parts, c, before, share, t, h)


@outlined
def conclude_together(sets: Any, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
    """`conclude_all` for some sets."""
    type(sets[0]).conclude_all(sets[0], sets, parts, c, before, share, t, h)


def joint(sets: Any) -> Any:
    """Those of the sets that conclude steps together."""
    if len(sets) == 0:
        return ()
    return (sets[:1] if type(sets[0]).jointly else ()) + joint(sets[1:])


def conclude_elements(
    sets: Any, free: bool, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any
) -> None:
    """Let all sets that have something to do at the end of a step do so; all threads of an island come here. `free`: nothing
    joins its particles."""
    hard = joint(sets)
    if len(hard) > 0:
        alone = free and len(hard) == len(sets)
        type(hard[0]).hasten(hard[0], hard, alone, parts, c, before, share, t, h)
        meet(share.gate, share.threads)
        conclude_together(hard, parts, c, before, share, t, h)
    for each in sets:
        if type(each).concludes:
            conclude_set(each, parts, c, before, share, t, h)
    others = sum([type(each).concludes for each in sets])
    if others > (0 if len(hard) > 0 else 1):  # one may have changed what another has seen
        leave_elements(sets)


def tired_elements(sets: Any) -> Any:
    """Whether steps should pause, for one of the sets that tire."""
    found = False
    for each in sets:
        if type(each).tires:
            found = found | type(each).tired(each)
    return found


def leave_elements(sets: Any) -> None:
    """Let sets forget what held only since they were concluded."""
    for each in sets:
        if type(each).concludes:
            type(each).leave(each)


@outlined
def add_set(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Add the forces of one set on particles [first, last)."""
    type(each).add_forces(each, c, total, first, last, t)


@outlined
def add_settled_set(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """`add_settled` for one set."""
    type(each).add_settled(each, c, total, first, last, t)


def add_elements(sets: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Add the forces of all sets on particles [first, last)."""
    for each in sets:
        add_set(each, c, total, first, last, t)


def new_forms(sets: Sequence[Interaction], dtype: Any, common: Sequence[Any] = ()) -> tuple[Any, ...]:
    """Arrays for the linearisations of sets; of those in `common` that threads have together."""
    if not common:
        return tuple(each.new_form(dtype) for each in sets)
    return tuple(
        theirs if each.together else each.new_form(dtype) for each, theirs in zip(sets, common, strict=True)
    )


@outlined
def stiffen_set(each: Any, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
    """`stiffen` for one set."""
    type(each).stiffen(each, form, c, s, first, last, t, reach)


@outlined
def stiffen_set_together(each: Any, form: Any, c: Any, s: Any, share: Any, t: Any, reach: Any) -> None:
    """`stiffen_together` for one set."""
    type(each).stiffen_together(each, form, c, s, share, t, reach)


def stiffen_elements(sets: Any, forms: Any, c: Any, s: Any, share: Any, t: Any, reach: Any) -> None:
    """Linearise all sets at the present state; all threads of an island come here, and all of it is in place."""
    for each, form in zip(sets, forms, strict=True):
        if type(each).together:
            stiffen_set_together(each, form, c, s, share, t, reach)
    if any(type(each).together for each in sets):
        meet(share.gate, share.threads)
    first, last = share.first, share.last
    for each, form in zip(sets, forms, strict=True):
        stiffen_set(each, form, c, s, first, last, t, reach)


@outlined
def multiply_set(each: Any, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
    """`multiply` for one set."""
    type(each).multiply(each, form, x, y, first, last)


@outlined
def multiply_set_together(each: Any, form: Any, x: Any, share: Any) -> None:
    """`multiply_together` for one set."""
    type(each).multiply_together(each, form, x, share)


def multiply_elements(sets: Any, forms: Any, x: Any, y: Any, share: Any) -> None:
    """Add to y, on the particles of a share, what all sets make of x; all threads of an island come here."""
    for each, form in zip(sets, forms, strict=True):
        if type(each).together:
            multiply_set_together(each, form, x, share)
    if any(type(each).together for each in sets):
        meet(share.gate, share.threads)
    first, last = share.first, share.last
    for each, form in zip(sets, forms, strict=True):
        multiply_set(each, form, x, y, first, last)


def give(total: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Add a force to particle i if it is among [first, last)."""
    if first <= i < last:
        total[0, i] += x
        total[1, i] += y
        total[2, i] += z


def take(s: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Subtract a force from the residual of particle i if it is among [first, last)."""
    if first <= i < last:
        s.residual[0, i] -= x
        s.residual[1, i] -= y
        s.residual[2, i] -= z


def add_square(s: Any, i: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> None:
    """Add w wᵀ to the block of particle i if it is among [first, last)."""
    if first <= i < last:
        s.block[0, i] += x * x
        s.block[1, i] += y * y
        s.block[2, i] += z * z
        s.block[3, i] += x * y
        s.block[4, i] += x * z
        s.block[5, i] += y * z


def rows_between(rows: Any, first: int, last: int) -> NDArray[np.bool_]:
    """Which columns of a table of rows [k, n] have one among particles [first, last)."""
    return np.asarray(((rows >= first) & (rows < last)).any(axis=0))


def rows_after(rows: Ints, place: Ints) -> tuple[Ints, NDArray[np.bool_]]:
    """Rows of interactions [k, n] after births and deaths (`Interaction.laid_again`) without those that lost a particle,
    and which are left [n]."""
    there = place[rows]
    left = np.asarray((there >= 0).all(axis=0))
    return np.ascontiguousarray(there[:, left]), left


def is_gone(each: Any, c: Any, q: Any) -> Any:
    """Whether a particle of column q of the rows of a set is not there any more; never where they do not die."""
    if each.mortal is None:
        return False
    gone = False
    for k in range(each.rows.shape[0]):
        gone = gone | (presence(c.clock, each.rows[k, q]) == 0)
    return gone


def clear_form(form: Any, q: Any) -> None:
    """Take column q out of the matrix of implicit methods."""
    for row in range(form.shape[0]):
        form[row, q] = 0


def states_of(c: Any, rows: Any) -> tuple[Floats, Floats]:
    """Positions [m] and velocities [m/s] of some particles in double precision, shapes [n, 3]."""
    x, v = (
        np.array([[float(column[i]) for column in part] for i in rows])
        for part in ((c.x, c.y, c.z), (c.vx, c.vy, c.vz))
    )
    return x, v


def all_states(c: Any) -> tuple[Floats, Floats]:
    """Positions [m] and velocities [m/s] of all particles in double precision, shapes [3, n]."""
    x, v = (
        np.stack([column.astype(float) for column in part]) for part in ((c.x, c.y, c.z), (c.vx, c.vy, c.vz))
    )
    return x, v
