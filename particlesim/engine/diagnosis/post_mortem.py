"""The post-mortem of a run that has gone wrong: the first sign of it.

A number that is not finite is the end of a divergence, not its beginning: by then all particles near it are affected. So the
last interval is run again from its beginning, on a copy, to find by bisection the first step at which a particle was much
faster than its speed and the forces at that beginning could make it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.diagnosis.strongest_force import strongest
from particlesim.engine.diagnosis.undefined_paths import astray, left_by_collider
from particlesim.engine.faults import Fault
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.stability.limits import explicit_sets, remedy
from particlesim.engine.stability.linearised import IslandModel
from particlesim.engine.state.columns import Columns, fetch
from particlesim.engine.step.step_size import MOST_STEPS, NOT_FINITE, TOO_MANY, TOO_SHORT
from particlesim.engine.world import World
from particlesim.errors import DivergenceError, PostMortem
from particlesim.integrators.regions import largest_step
from particlesim.laws.registry import Particle

TOO_FAST = 100.0
"""Times the speed that an interval's beginning explains, beyond which a particle has run away."""
RUINED = 1000.0
"""Times that a step would have to be shorter beyond which the interval began in ruins, where no step is worth a hint."""

WHY = {
    NOT_FINITE: (
        "feels a force that is not finite at t = {t:.9g} s",
        "keep it away from where a force has no value",
    ),
    TOO_SHORT: (
        "needs steps below {least:.3g} s at t = {t:.9g} s",
        "a force grows without bound there, or jumps, or begins at a touch: soften it, or allow more error (tolerance) or "
        "shorter steps (minimum_step)",
    ),
    TOO_MANY: (
        f"has taken {MOST_STEPS:,} steps within one dt by t = {{t:.9g}} s",
        "allow more error (tolerance), use a method of higher order, or a smaller dt",
    ),
}
"""The message about a particle that could not go on with its own steps, and its hint."""

UNCLOSED = (
    "try a smaller dt; bodies may turn by less than about a quarter of a turn in a step, and what is pulled with a force T, "
    "as links of the mass m and the length l, asks for dt < sqrt(m l/(3 T)), also where it cracks like a whip"
)
"""What to do about joints of bodies."""
UNHELD = (
    "try a smaller dt; where rods leave no way to move, as a straight chain between two pins or a braced square that is "
    "bent out of its plane, no step is small enough: leave a rod out, or use springs"
)
"""What to do about rods that could not be held."""


class Sign(NamedTuple):
    """The first sign: its step, the row, the particle before that step, its place in the columns, columns and
    interactions."""

    step: int
    row: int
    particle: Particle
    place: int
    interactions: tuple[Any, ...]
    columns: Columns


def not_finite(world: World, number: int, fault: Fault, first: int) -> DivergenceError:
    """The post-mortem of an island in which a number stopped being finite in an interval that began at step `first`."""
    island = world.islands[number]
    last = fault.step + 1
    if (lost := astray(world, last) or left_by_collider(world, last)) is not None:
        return lost
    if island.kept_from is not None:
        first = island.kept_from  # further back than the piece that failed, where every step is booked
    row = fault.row + sum(state.count for state in island.states[: fault.member])
    dt = world.grid.dt
    time = fault.step * dt
    if fault.stop is not None:
        what, hint = WHY[fault.stop.why]
        sign = _stopped(island, row, fault, first)
        text = f"particle {{who}} {what.format(t=fault.stop.time, least=fault.stop.least)}; it was"
        return _report(world, number, sign, "not finite", fault.stop.time, text, hint)
    columns, interactions, rows = island.replay(row, first, fault.step - first)
    if (missed := fault.unsolved) is not None:
        place = row - rows.start
        sign = Sign(fault.step, row, _particle(columns, place, time), place, interactions, columns)
        spent = f"{missed.iterations} Newton iterations"
        if missed.linear:
            spent += f" with {missed.linear} iterations of the linear solver"
        text = (
            f"{missed.method} found no solution of the step from t = {time:.9g} s: after {spent} the "
            f"imbalance of forces was {missed.residual:.3g} times the first one, most of it at particle {{who}}, which was"
        )
        hint = "try a smaller dt, a larger tolerance, or more iterations"
        return _report(world, number, sign, "not solved", time, text, hint)
    if (rod := fault.unheld) is not None:
        place = row - rows.start
        sign = Sign(fault.step, row, _particle(columns, place, time), place, interactions, columns)
        ends = " and ".join(f"{k} of {name!r}" for k, name in zip(rod.particles, rod.groups, strict=True))
        short = f"by {rod.misfit * rod.length:.3g} m" if math.isfinite(rod.misfit) else "altogether"
        text = (
            f"rods {rod.name!r} could not be held in the step from t = {time:.9g} s: the one between particles {ends} "
            f"missed its length of {rod.length:.6g} m {short}; particle {{who}} was"
        )
        return _report(world, number, sign, "not held", time, text, UNHELD)
    if (joint := fault.unclosed) is not None:
        place = row - rows.start
        sign = Sign(fault.step, row, _particle(columns, place, time), place, interactions, columns)
        text = f"joint {joint.name!r} could not be held in the step from t = {time:.9g} s; body {{body}} was"
        return _report(world, number, sign, "not held", time, text, UNCLOSED)
    over = f"no longer finite after the step from t = {time:.9g} s"
    early = _first_sign(world, number, row, first, fault.step)
    if early is None:
        place = row - rows.start
        sign = Sign(fault.step, row, _particle(columns, place, time), place, interactions, columns)
        return _report(world, number, sign, "not finite", time, f"particle {{who}} is {over}; it was")
    text = (
        f"particle {{who}} ran away at t = {early.particle.t:.9g} s, faster than {TOO_FAST:g} times what forces could "
        f"give it, and numbers were {over}; it was"
    )
    return _report(world, number, early, "not finite", time, text)


def _stopped(island: BaseIsland, row: int, fault: Fault, first: int) -> Sign:
    """Where a method that chooses its steps could not go on."""
    assert fault.stop is not None
    columns, interactions, rows = island.stopped(row, first, fault.step - first)
    return Sign(fault.step, row, fault.stop.particle, row - rows.start, interactions, columns)


def overflowed(world: World, quantity: str) -> DivergenceError:
    """The post-mortem of a world with finite numbers whose ledger has a quantity that is not."""
    if (lost := astray(world, world.step) or left_by_collider(world, world.step)) is not None:
        return lost
    fastest = [
        (_speeds(columns).max(initial=0.0), number)
        for number, island in enumerate(world.islands)
        for columns in island.columns()
    ]
    number = max(fastest)[1]
    over = f"the ledger's {quantity} is no longer finite at t = {world.time:.9g} s"
    sign = _looked_back(world, number)
    if sign is None:
        sign, text = _fastest_now(world, number), f"{over}; particle {{who}} was"
    else:
        text = f"{over}: particle {{who}} ran away first, at t = {sign.particle.t:.9g} s; it was"
    hint = f"try a smaller step than dt = {world.grid.dt:.6g} s, or smaller forces"
    return _report(world, number, sign, "not finite", world.time, text, hint)


def _looked_back(world: World, number: int) -> Sign | None:
    """The first sign in the interval up to the present step; None where there is none, or no way to look."""
    island = world.islands[number]
    adaptive = world.graph.islands[number].method.adaptive
    if island.kept_from is None or adaptive or island.kept_from >= world.step:
        return None
    return _first_sign(world, number, 0, island.kept_from, world.step)


def ran_away(
    world: World, number: int, cause: str, size: float, most: float, hint: str | None = None
) -> DivergenceError:
    """The post-mortem of an island that has gained energy from nothing [J], or speed beyond reason [m/s], by the present
    step. `most`: the part of its energy, or the times its speed, that it may gain; `hint` says what to do about it, if that
    is known."""
    island = world.islands[number]
    names = " and ".join(repr(state.name) for state in island.states)
    if cause == "energy":
        fed = "with nothing to feed it" if island.books is None else "beyond all work that was done"
        why = f"{names} had gained {size:.3g} J of energy {fed}, more than {100 * most:g} % of what there was"
        hint = hint or _better(world, number)
    else:
        why = f"speeds in {names} had grown a thousandfold since the last frame, to {size:.3g} m/s"
    sign = _looked_back(world, number)
    if sign is None:
        sign = _fastest_now(world, number)
        text = f"by t = {world.time:.9g} s {why}; particle {{who}} was"
    else:
        first = f"particle {{who}} ran away first, at t = {sign.particle.t:.9g} s"
        text = f"{first}; by t = {world.time:.9g} s {why}; it was"
    return _report(world, number, sign, cause, world.time, text, hint)


def _better(world: World, number: int) -> str | None:
    """A hint at what keeps the energy of an island better; None where only a smaller step does."""
    structure = world.graph.islands[number]
    if any(each.lifts() for colliders in structure.colliders for each in colliders):
        return 'detection = "continuous" adds no energy when particles bounce; or try a smaller dt'
    if structure.method.adaptive:
        return "allow less error: a smaller tolerance"
    return None


def _fastest_now(world: World, number: int) -> Sign:
    """The particle of an island that is fastest at present."""
    island = world.islands[number]
    columns = island.island_columns()
    row = int(np.argmax(_speeds(columns)))
    return Sign(world.step, row, _particle(columns, row, world.time), row, island.interactions, columns)


def _first_sign(world: World, number: int, row: int, first: int, last: int) -> Sign | None:
    """The step in (first, last] at which a particle was first too fast; None if there was none."""
    island, dt = world.islands[number], world.grid.dt
    if last <= first:
        return None
    start = island.replay(row, first, 0)[0]
    after = island.replay(row, first, 1)[0]
    with np.errstate(over="ignore", invalid="ignore"):
        change = after._replace(**{v: getattr(after, v) - getattr(start, v) for v in ("vx", "vy", "vz")})
    speed, kick = (float(_speeds(c).max(initial=0.0)) for c in (start, change))

    def too_fast(step: int) -> bool:
        allowed = TOO_FAST * (speed + (kick if math.isfinite(kick) else 0.0) * (step - first))
        return bool((_speeds(island.replay(row, first, step - first)[0]) > allowed).any())

    if not too_fast(last):
        return None
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if too_fast(middle) else (middle, high)
    columns, interactions, rows = island.replay(row, first, high - first)
    index = int(np.argmax(_speeds(columns)))
    return Sign(high, rows.start + index, _particle(columns, index, high * dt), index, interactions, columns)


def _speeds(c: Columns) -> NDArray[np.float64]:
    """Speeds of all particles [m/s], infinite where they are no numbers."""
    with np.errstate(over="ignore", invalid="ignore"):
        vx, vy, vz = (column.astype(float) for column in (c.vx, c.vy, c.vz))
        return np.asarray(np.nan_to_num(np.hypot(np.hypot(vx, vy), vz), nan=np.inf))


def _particle(c: Columns, i: int, time: float) -> Particle:
    """Particle i of columns, in plain Python."""
    return Particle(*map(float, fetch(c, i, time)))


def _report(
    world: World,
    number: int,
    sign: Sign,
    cause: str,
    noticed: float,
    text: str,
    hint: str | None = None,
) -> DivergenceError:
    """Message, hint and data of a post-mortem. `text` says what happened to {who} or {body}, up to where it
    was."""
    island = world.islands[number]
    member = int(np.searchsorted(np.cumsum([s.count for s in island.states]), sign.row, side="right"))
    state, p = island.states[member], sign.particle
    row = sign.row - sum(other.count for other in island.states[:member])
    dt = world.grid.dt
    name, size = strongest(world, number, member, p, sign.place, sign.interactions, sign.columns)
    stable = _stable_step(world, number, member, p)
    found = PostMortem(
        cause,
        noticed,
        int(state.id[row]),
        state.name,
        p.t,
        (p.x, p.y, p.z),
        (p.vx, p.vy, p.vz),
        name,
        size,
        dt,
        stable,
    )
    where = f"({p.x:.6g}, {p.y:.6g}, {p.z:.6g}) m with velocity ({p.vx:.6g}, {p.vy:.6g}, {p.vz:.6g}) m/s"
    # bodies are counted in their group, as by the pairs of joints; particles have ids
    message = text.replace("{who}", f"{found.particle} of {found.group!r}").replace(
        "{body}", f"{row} of {found.group!r}"
    )
    message += f" at {where}"
    if name is not None:
        message += f", and the strongest force on it was {name} with {size:.6g} N"
    if stable is not None and math.isfinite(stable):
        limit = f"{stable:.3g} s" if stable > 0 else "none"
        when = "was" if world.graph.islands[number].coupled else "there is"
        message += f"; dt = {dt:.6g} s, and the largest stable step {when} {limit}"
        if when == "was":
            message += " as the interval began"
    hint = hint or f"try a smaller step than dt = {dt:.6g} s"
    if stable is not None and dt / RUINED < stable < dt:
        structure = world.graph.islands[number]
        hint += (
            f": {remedy(stable, limited=bool(structure.constraints) or bool(explicit_sets(world, number)))}"
        )
    return DivergenceError(message, hint, found)


def _stable_step(world: World, number: int, member: int, p: Particle) -> float | None:
    """The largest stable step of an island of springs when the interval began, or of a single particle at its place [s]."""
    island, structure = world.islands[number], world.graph.islands[number]
    if not structure.method.by_modes:
        return math.inf
    island.go_back()
    try:
        model = IslandModel(world.scenario, structure, island, p.t)
        with np.errstate(all="ignore"):
            system = model.linearise().together if structure.coupled else model.single(member, p)
            return largest_step(structure.method, system)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError):
        return None  # numbers too wild to tell
