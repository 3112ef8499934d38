"""Forces of contacts and of rods together, in components of rods that touch colliders.

What contact does to one particle is known in closed form: from the velocity v it goes on with V = C(v), by an impulse P
along the normal n of a surface and friction along it,

    P ≥ 0,   n·V ≥ u,   one of both with equality;   |P_t| ≤ μ_s P at rest,   P_t = −μ_k P V_t/|V_t| where it slides,

V_t relative to the surface. What is not known are the multipliers λ of rods. With the rows J of these, and the directions K
along which their impulses are, they follow from

    F(λ) = J (C(v + M⁻¹ Kᵀ λ) − v) = 0,

by Newton's method for functions with kinks: C' M⁻¹ stands for M⁻¹ in the matrix of the rods, J C' M⁻¹ Kᵀ, which has the same
pattern. What holds still has no mobility, what slides without friction one across the normal. So one round costs about what
putting the rods right does, however many contacts there are, and however unlike masses are.

Without friction, or with friction that is bounded by given forces (Tresca), F is the gradient of a convex function, and a
step that is too long is cut where the slope along it vanishes. Coulomb's law has no such function: where Newton's method
does not settle, its bounds are those of the last pressure, until they do not change.

Sources: P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92, 353 (1991); L. Qi, J. Sun, Math. Program. 58, 353 (1993);
P. D. Panagiotopoulos, Ing.-Arch. 44, 421 (1975), for bounds in turns.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.constraints.shake_rattle import DEPENDENT, eliminate, solve

SETTLED, NEAR = 1e-13, 1e-6
"""Parts of the largest velocity: what is no longer looked at, and what is good enough where no more is found, as where
places that are off by rounding ask for what rods do not allow. Forces that leave as much to rounding hold nothing."""
ROUNDED = 2.0**-49
"""Rounding of a sum of velocities, as a part of the largest of them."""
SOON, ROUNDS, CUTS, BOUNDS, LONGER = 10, 60, 30, 60, 8.0
"""Rounds of Newton's method, at first, unless it is near then, and later; lengths of a step that are tried, and bounds of
friction, at most; how many times as long the next one is."""
FLAT, EDGE = 0.3, 0.1
"""The part of the slope at its beginning at which a step ends; the part of a bracket that is tried at least."""
SLIPS, SLIDES = 8, 1e-5
"""How often contacts are looked at that static friction may not hold; the part of the largest velocity that tells."""
FEW, SPARE = 32, 1024
"""Contacts of one particle, and those of a component beyond one for each particle, at most."""
WEDGED, SAME = 200, 1e-15
"""Turns for several contacts of one particle, at most, and the part of its velocity that is no change."""


class Touch(NamedTuple):
    """The contacts of a component, in the order of its slots; `first` says where those of each begin [slots + 1].

    Of contacts: slots and colliders; the normal, the direction of its impulses (`push`), the normal at the beginning of the
    step (`begun`) and the velocity of the surface [3, most]; the normal velocity that must be (`need`), that with which a
    place comes to the surface (`land`), that which is asked for (`goal`), and the place of the surface along the normal;
    coefficients of friction, and that which acts; the part of the tangential velocity that is kept. What is found: P/m, how
    fast it slides and the bound of its friction [m/s], and what the contact changes of the velocity [3, most].

    Of the contacts of one slot: the derivative of that, of each by itself (`slope`) and of all together (`effect`)
    [9, FEW]. Of slots: velocities before and after [3, slots], and C'/m [9, slots]. Of rods: their impulses, those of a
    kept look, F, and a step of Newton's method.
    """

    first: Any
    slot: Any
    collider: Any
    normal: Any
    push: Any
    begun: Any
    surface: Any
    need: Any
    land: Any
    goal: Any
    place: Any
    static: Any
    kinetic: Any
    acting: Any
    keep: Any
    press: Any
    slip: Any
    bound: Any
    given: Any
    slope: Any
    effect: Any
    base: Any
    after: Any
    mobility: Any
    force: Any
    kept: Any
    left: Any
    step: Any


def new_touch(slots: int, rods: int) -> Touch:
    """Room for a component of so many slots and rods."""
    most = slots + min(3 * slots, SPARE)
    numbers = (
        "need",
        "land",
        "goal",
        "place",
        "static",
        "kinetic",
        "acting",
        "keep",
        "press",
        "slip",
        "bound",
    )
    arrays = {
        "first": np.zeros(slots + 1, np.int64),
        **{name: np.zeros(most, np.int64) for name in ("slot", "collider")},
        **{name: np.zeros((3, most)) for name in ("normal", "push", "begun", "surface", "given")},
        **{name: np.zeros(most) for name in numbers},
        **{name: np.zeros((9, FEW)) for name in ("slope", "effect")},
        **{name: np.zeros((3, slots)) for name in ("base", "after")},
        "mobility": np.zeros((9, slots)),
        **{name: np.zeros(rods) for name in ("force", "kept", "left", "step")},
    }
    return Touch(**arrays)


@outlined
def find_forces(rods: Any, ways: Any, k: Any, rubs: Any) -> float:
    """The impulses of rods, along `ways` [3, rods], from those that there are, and the velocities after contact, of
    component k; what rods are stretched by then, as a part of the largest velocity, infinite if forces have not been found.
    Without `rubs` nothing acts along surfaces."""
    rig, touch = rods.rig, rods.blows.touch
    slots = rig.slots[k + 1] - rig.slots[k]
    count, largest = touch.first[slots], 0.0
    for m in range(count):
        touch.acting[m] = touch.static[m]
        largest = max(largest, lacking(touch, m, rubs))
    left = 0.0
    for _ in range(SLIPS):
        left = settle(rods, ways, k, rubs, False, largest, SOON if rubs else ROUNDS)
        if left == np.inf and rubs:  # from the pulls without friction, which often hold still what bears them
            settle(rods, ways, k, False, False, largest, ROUNDS)
            left = settle(rods, ways, k, True, False, largest, ROUNDS)
        if left == np.inf and rubs:
            left = settle_bounds(rods, ways, k, largest)
        if not (rubs and some_slip(touch, count, SLIDES * largest)):
            break
    for e in range(rig.rods[k], rig.rods[k + 1]):
        rods.bench.kept[e] = True
    return left


def lacking(touch: Any, m: Any, rubs: Any) -> Any:
    """The velocity that a contact changes at least [m/s], without rods."""
    at, n, normal, square = touch.slot[m], touch.normal, 0.0, 0.0
    if not touch.goal[m] > -np.inf:
        return 0.0
    for axis in range(3):
        normal += n[axis, m] * touch.base[axis, at]
    if rubs and (touch.static[m] > 0 or touch.keep[m] < 1):
        for axis in range(3):
            along = touch.base[axis, at] - n[axis, m] * normal - touch.surface[axis, m]
            square += along * along
    return max(abs(touch.goal[m] - normal), np.sqrt(square))


def some_slip(touch: Any, count: Any, least: Any) -> bool:
    """Let contacts slide by kinetic friction that static friction does not hold, as they are faster than something; whether
    there are any that had been held."""
    some = False
    for m in range(count):
        if touch.press[m] > 0 and touch.acting[m] > touch.kinetic[m] and touch.slip[m] > least:
            touch.acting[m], some = touch.kinetic[m], True
    return bool(some)


@outlined
def settle_bounds(rods: Any, ways: Any, k: Any, largest: Any) -> float:
    """Settle with bounds of friction that follow from the last pressure, until they do not change."""
    rig, touch = rods.rig, rods.blows.touch
    count, left = touch.first[rig.slots[k + 1] - rig.slots[k]], np.inf
    for m in range(count):
        touch.bound[m] = 0.0
    for e in range(rig.rods[k + 1] - rig.rods[k]):
        touch.force[e] = 0.0
    for _ in range(BOUNDS):
        left = settle(rods, ways, k, True, True, largest, ROUNDS)
        change = 0.0
        for m in range(count):
            bound = touch.acting[m] * touch.press[m]
            change = max(change, abs(bound - touch.bound[m]))
            touch.bound[m] = bound
        if not (left < np.inf and change > SETTLED * largest):
            break
    return left


@outlined
def settle(rods: Any, ways: Any, k: Any, rubs: Any, given: Any, largest: Any, rounds: Any) -> float:
    """Find the forces of rods with Newton's method; returns what `find_forces` does. `given`: bounds of friction are."""
    rig, bench, touch = rods.rig, rods.bench, rods.blows.touch
    begin, number = rig.rods[k], rig.rods[k + 1] - rig.rods[k]
    for e in range(number):
        touch.step[e] = 0.0
    worst, size, _, rounding = left_over(rods, ways, k, rubs, given, 0.0)
    for turn in range(ROUNDS):
        near = worst <= NEAR * largest
        if not worst > SETTLED * largest + rounding or (turn >= rounds and not near):
            break
        assemble(rig, bench, touch, ways, k)
        eliminate(rig, bench, k, True, DEPENDENT)
        for e in range(number):
            bench.side[begin + e] = -touch.left[e]
        solve(rig, bench, k)
        for e in range(number):
            touch.step[e] = bench.side[begin + e]
        part, worst, size, rounding = cut_step(rods, ways, k, rubs, given, size, near, NEAR * largest)
        if part == 0:  # nothing that contacts can do holds these rods, or holds them better
            break
        for e in range(number):
            touch.force[e] += part * touch.step[e]
    if worst <= rounding:
        return 0.0
    return float(worst / largest if worst <= NEAR * largest else np.inf)


@outlined
def cut_step(rods: Any, ways: Any, k: Any, rubs: Any, given: Any, size: Any, near: Any, coarse: Any) -> Any:
    """The part of a step that is made: all of it if F is less than `size` then, the sum of squares before it, or else where
    the slope along it has all but gone, be that beyond its end; 0 if there is no such place, or rounding is more than
    `coarse` there. What is `near` enough is not made longer. Also the largest of F then, the sum of all squares, and what is
    but rounding."""
    touch, least, low, high = rods.blows.touch, 0.0, 0.0, np.inf
    for e in range(rods.rig.rods[k + 1] - rods.rig.rods[k]):
        least += touch.left[e] * touch.step[e]
    part, below, above = 1.0, least, np.inf
    worst, total, slope, rounding = left_over(rods, ways, k, rubs, given, part)
    good = total < size
    for _ in range(CUTS):
        if good or (near and slope < 0):
            break
        if slope < 0:  # as long as both ends of a rod hold still, more does not change it
            low, below = part, slope
        else:
            high, above = part, slope
        if high == np.inf:
            part *= LONGER
        else:
            part = low + min(max(below / (below - above), EDGE), 1 - EDGE) * (high - low)
        worst, total, slope, rounding = left_over(rods, ways, k, rubs, given, part)
        good = abs(slope) <= FLAT * abs(least)
    if not (good and rounding <= coarse):
        part = 0.0
        worst, total, slope, rounding = left_over(rods, ways, k, rubs, given, part)
    return part, worst, total, rounding


@outlined
def left_over(rods: Any, ways: Any, k: Any, rubs: Any, given: Any, part: Any) -> Any:
    """F of the rods, after a part of a step: the largest velocity [m/s], the sum of all squares, the slope along the step,
    and what is but rounding."""
    rig, touch, arm = rods.rig, rods.blows.touch, rods.bench.arm
    first, begin, number = rig.slots[k], rig.rods[k], rig.rods[k + 1] - rig.rods[k]
    base, after, largest = touch.base, touch.after, 0.0
    for at in range(rig.slots[k + 1] - first):
        for axis in range(3):
            after[axis, at] = base[axis, at]
            largest = max(largest, abs(base[axis, at]))
    for e in range(number):
        i, j = rig.first[begin + e], rig.second[begin + e]
        size = touch.force[e] + part * touch.step[e]
        one, two = rig.inverse[i] * size, rig.inverse[j] * size
        for axis in range(3):
            way = ways[axis, begin + e]
            after[axis, i - first] += one * way
            after[axis, j - first] -= two * way
            largest = max(largest, abs(one * way), abs(two * way))
    for at in range(rig.slots[k + 1] - first):
        answer_all(touch, at, rig.inverse[first + at], rubs, given)
    worst, total, slope = 0.0, 0.0, 0.0
    for e in range(number):
        i, j = rig.first[begin + e] - first, rig.second[begin + e] - first
        left, length = 0.0, 0.0
        for axis in range(3):
            one, two = after[axis, i] - base[axis, i], after[axis, j] - base[axis, j]
            left += arm[axis, begin + e] * (one - two)
            length += arm[axis, begin + e] * arm[axis, begin + e]
        touch.left[e] = left
        size = left / np.sqrt(length)
        worst = max(worst, abs(size)) if size == size else np.inf
        total += size * size
        slope += left * touch.step[e]
    return worst, total, slope, ROUNDED * largest


def assemble(rig: Any, bench: Any, touch: Any, ways: Any, k: Any) -> None:
    """The matrix J C' M⁻¹ Kᵀ of a component; pivots that vanish are replaced by those without contact."""
    low, up, arm, first = bench.low, bench.up, bench.arm, rig.slots[k]
    begin, end = rig.rods[k], rig.rods[k + 1]
    for p in range(rig.pointer[begin], rig.pointer[end]):
        low[p] = 0
        up[p] = 0
    for e in range(begin, end):
        i, j, alone = rig.first[e], rig.second[e], 0.0
        for axis in range(3):
            alone += arm[axis, e] * ways[axis, e]
        there = through(touch, i - first, arm, e, ways, e) + through(touch, j - first, arm, e, ways, e)
        bench.pivot[e] = there
        bench.floor[e] = DEPENDENT * (rig.inverse[i] + rig.inverse[j]) * alone
    for n in range(rig.links[k], rig.links[k + 1]):
        e, f, p = rig.one[n], rig.other[n], rig.entry[n]
        i, sign = rig.first[e], 1.0 if rig.weight[n] > 0 else -1.0
        if i != rig.first[f] and i != rig.second[f]:
            i = rig.second[e]
        up[p] += sign * through(touch, i - first, arm, e, ways, f)
        low[p] += sign * through(touch, i - first, arm, f, ways, e)


def through(touch: Any, at: Any, a: Any, e: Any, b: Any, f: Any) -> Any:
    """What an impulse along one rod gives to a slot along another: a·C' M⁻¹ b."""
    w, total = touch.mobility, 0.0
    for row in range(3):
        way = w[3 * row, at] * b[0, f] + w[3 * row + 1, at] * b[1, f] + w[3 * row + 2, at] * b[2, f]
        total += a[row, e] * way
    return total


def answer_all(touch: Any, at: Any, inverse: Any, rubs: Any, given: Any) -> None:
    """What contacts do to a slot: its velocity after them, and how that follows from the one before, over its mass."""
    after, w, begin, end = touch.after, touch.mobility, touch.first[at], touch.first[at + 1]
    for n in range(9):
        w[n, at] = inverse if n % 4 == 0 else 0.0
    if end == begin:
        return
    if end == begin + 1:
        answer(touch, begin, 0, after[0, at], after[1, at], after[2, at], rubs, given)
        for n in range(9):
            w[n, at] += inverse * touch.slope[n, 0]
    else:
        wedge(touch, at, rubs, given)
        for m in range(begin, end):
            for n in range(9):
                w[n, at] += inverse * touch.effect[n, m - begin]
    for m in range(begin, end):
        for axis in range(3):
            after[axis, at] += touch.given[axis, m]


@outlined
def wedge(touch: Any, at: Any, rubs: Any, given: Any) -> None:
    """What several contacts do to one slot, each in turn with what the others do."""
    after, change, begin, end = touch.after, touch.given, touch.first[at], touch.first[at + 1]
    number, effect, slope = end - begin, touch.effect, touch.slope
    for o in range(number):
        for axis in range(3):
            change[axis, begin + o] = 0.0
        for n in range(9):
            effect[n, o] = 0.0
    for _ in range(WEDGED):
        worst, size = 0.0, 0.0
        for m in range(begin, end):
            x, y, z = after[0, at], after[1, at], after[2, at]
            for o in range(begin, end):
                if o != m:
                    x, y, z = x + change[0, o], y + change[1, o], z + change[2, o]
            a, b, c = change[0, m], change[1, m], change[2, m]
            answer(touch, m, m - begin, x, y, z, rubs, given)
            worst = max(worst, abs(change[0, m] - a), abs(change[1, m] - b), abs(change[2, m] - c))
            size = max(size, abs(x), abs(y), abs(z))
        if not worst > SAME * size:
            break
    for _ in range(WEDGED):
        worst = 0.0
        for m in range(number):
            for column in range(3):
                x, y, z = (1.0 if column == axis else 0.0 for axis in range(3))
                for o in range(number):
                    if o != m:
                        x, y, z = x + effect[column, o], y + effect[3 + column, o], z + effect[6 + column, o]
                for row in range(3):
                    new = slope[3 * row, m] * x + slope[3 * row + 1, m] * y + slope[3 * row + 2, m] * z
                    worst = max(worst, abs(new - effect[3 * row + column, m]))
                    effect[3 * row + column, m] = new
        if not worst > SETTLED:
            break


def answer(touch: Any, m: Any, o: Any, x: Any, y: Any, z: Any, rubs: Any, given: Any) -> None:
    """What contact m changes of a velocity, and the derivative of that, in place o; `given`: the bound of its friction
    is."""
    nx, ny, nz = touch.normal[0, m], touch.normal[1, m], touch.normal[2, m]
    px, py, pz = touch.push[0, m], touch.push[1, m], touch.push[2, m]
    facing = nx * px + ny * py + nz * pz
    press = (touch.goal[m] - (nx * x + ny * y + nz * z)) / facing
    presses = press > 0
    press = press if presses else 0.0
    touch.press[m], touch.slip[m] = press, 0.0
    hx, hy, hz = x + press * px, y + press * py, z + press * pz
    # What it has along the surface: z, of which it loses the part `lost`.
    sx, sy, sz, speed, lost, part, keep = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    bound, sticks = 0.0, False
    if rubs and (presses or given or touch.keep[m] < 1):
        sx, sy, sz = hx - touch.surface[0, m], hy - touch.surface[1, m], hz - touch.surface[2, m]
        inward = nx * sx + ny * sy + nz * sz
        sx, sy, sz = sx - inward * nx, sy - inward * ny, sz - inward * nz
        speed = np.sqrt(sx * sx + sy * sy + sz * sz)
        bound, keep = touch.bound[m] if given else touch.acting[m] * press, touch.keep[m]
        sticks = bound > 0 and keep * speed <= bound
        part = 0.0 if sticks or speed == 0 else bound / speed
        lost = 1.0 if sticks else 1 - keep + part
        touch.slip[m] = (1 - lost) * speed
    touch.given[0, m] = (hx - lost * sx) - x
    touch.given[1, m] = (hy - lost * sy) - y
    touch.given[2, m] = (hz - lost * sz) - z
    ux, uy, uz = (sx / speed, sy / speed, sz / speed) if speed > 0 else (0.0, 0.0, 0.0)
    grip = 0.0 if given or sticks else touch.acting[m]
    for column in range(3):
        dx, dy, dz = (1.0 if column == axis else 0.0 for axis in range(3))
        more = -(nx if column == 0 else (ny if column == 1 else nz)) / facing if presses else 0.0
        dx, dy, dz = dx + more * px, dy + more * py, dz + more * pz
        inward = nx * dx + ny * dy + nz * dz
        tx, ty, tz = dx - inward * nx, dy - inward * ny, dz - inward * nz
        drag = part * (ux * tx + uy * ty + uz * tz) - grip * more
        touch.slope[column, o] = dx - lost * tx + drag * ux - (1.0 if column == 0 else 0.0)
        touch.slope[3 + column, o] = dy - lost * ty + drag * uy - (1.0 if column == 1 else 0.0)
        touch.slope[6 + column, o] = dz - lost * tz + drag * uz - (1.0 if column == 2 else 0.0)
