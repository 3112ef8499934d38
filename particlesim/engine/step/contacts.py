"""The colliders that a particle may touch, and functions of all of them: smallest gaps, and their rounding errors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, ride
from particlesim.colliders.plane import PlaneXRecord, PlaneYRecord, PlaneZRecord
from particlesim.colliders.response import along, at_rest, called, crossable, opposite, under_late, yielded
from particlesim.compiler import outlined
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import PASS, contact, gap, gap_and_normal, least_gap

MANY = 4
"""Colliders up to which what is asked of each of them is written out everywhere; of more it is a function, as kernels would
take long to compile."""
SHALLOW = 2.0**-3
"""Part of `rounding` that gaps are off by at most: twice the rounding error of the numbers that they are made of."""


class Simple(NamedTuple):
    """Colliders met once after each step: none, one, or several that are perpendicular or parallel; and those that yield."""

    colliders: tuple[Any, ...]
    soft: tuple[Any, ...] = ()


class Careful(NamedTuple):
    """Colliders that need more: a time of impact (continuous), or several passes in a corner.

    `resting` are the continuous ones without rebound; `tolerance` is the relative rounding error of a position, and `reach`
    the size of the other numbers from which gaps are computed [m].
    """

    continuous: tuple[Any, ...]
    resting: tuple[Any, ...]
    discrete: tuple[Any, ...]
    tolerance: float
    reach: float
    one_by_one: tuple[()] | None = None
    """An empty tuple where gaps take so long that each particle is looked at by itself, and only if it must be."""
    soft: tuple[Any, ...] = ()
    sized_by: tuple[Any, ...] | None = None
    """The colliders that say which coordinates rounding errors come from, where they are not `continuous`: what is set aside
    must have the same bits as what is not."""


def by_calls(contacts: Any) -> Any:
    """The same contacts for one particle by itself: with many colliders that are not planes, what is asked of one is a
    function."""
    if isinstance(contacts, Simple) or contacts.one_by_one is None or len(contacts.continuous) <= MANY:
        return contacts
    return Careful(
        tuple(called(c) for c in contacts.continuous),
        tuple(called(c) for c in contacts.resting),
        tuple(called(c) for c in contacts.discrete),
        contacts.tolerance,
        contacts.reach,
        contacts.one_by_one,
        contacts.soft,
        contacts.sized_by,
    )


def late_contacts(contacts: Careful) -> Careful:
    """The same contacts for velocities that are not those of the places."""
    return Careful(
        tuple(under_late(c) for c in contacts.continuous),
        tuple(under_late(c) for c in contacts.resting),
        contacts.discrete,
        contacts.tolerance,
        contacts.reach,
        contacts.one_by_one,
        contacts.soft,
        contacts.sized_by,
    )


def meet(colliders: Any, p: Any) -> Any:
    """The particle after every collider, one after the other, and the strongest outcome."""
    return (_meet_many if len(colliders) > MANY else _meet)(colliders, p)


@outlined
def _meet_many(colliders: Any, p: Any) -> Any:
    return _meet(colliders, p)


def _meet(colliders: Any, p: Any) -> Any:
    if len(colliders) == 0:
        return p, PASS
    if len(colliders) == 1:
        return contact(colliders[0], p)
    q, first = contact(colliders[0], p)
    r, rest = _meet(colliders[1:], q)
    return r, max(first, rest)


def pushed(colliders: Any, p: Any, h: Any) -> Any:
    """The particle after a step of h, with what colliders that yield do to it."""
    for c in colliders:
        p = yielded(c, p, h)
    return p


def nearest(colliders: Any, p: Any) -> Any:
    """The smallest gap to any collider [m]; positive where there are none."""
    return _nearest_of_many(colliders, p) if len(colliders) > MANY else _nearest(colliders, p)


@outlined
def _nearest_of_many(colliders: Any, p: Any) -> Any:
    return _nearest(colliders, p)


def _nearest(colliders: Any, p: Any) -> Any:
    if len(colliders) == 0:
        return 1.0
    if len(colliders) == 1:
        return gap(colliders[0], p)
    half = len(colliders) // 2
    return min(_nearest(colliders[:half], p), _nearest(colliders[half:], p))


def ahead(contacts: Any, on: Any, p: Any) -> Any:
    """The smallest gap to continuous colliders other than those on which the particle lies [m]; positive where there are
    none, and where the particle is no deeper than by a rounding error, as after a bounce, and does not move in: it would hit
    what it does not come to, as often as it may."""
    return (_ahead_of_many if len(contacts.continuous) > MANY else _ahead_of)(contacts, on, p)


@outlined
def _ahead_of_many(contacts: Any, on: Any, p: Any) -> Any:
    return _ahead_of(contacts, on, p)


def _ahead_of(contacts: Any, on: Any, p: Any) -> Any:
    return _ahead(contacts.continuous, on, p, shallow(contacts, p))


def _ahead(colliders: Any, on: Any, p: Any, noise: Any) -> Any:
    if len(colliders) == 0:
        return type_of(p.x, 1)
    free = type_of(p.x, 1) if on[0] else _room(colliders[0], p, noise)
    return min(free, _ahead(colliders[1:], on[1:], p, noise))


def _room(c: Any, p: Any, noise: Any) -> Any:
    g = gap(c, p)
    if (g < 0) & (g >= -noise):
        g = _touching(c, p, g)
    return g


@outlined
def _touching(c: Any, p: Any, g: Any) -> Any:
    """The gap of a collider that a particle is in by a rounding error: positive where it does not move in."""
    rest, q = c, p
    if isinstance(c.shape, MovingRecord):
        rest, q = at_rest(c), ride(c.shape, p)
    _, n = gap_and_normal(rest, q)
    return abs(g) if along(n, q) >= 0 else g


def sunk(colliders: Any, on: Any, p: Any, q: Any, slack: Any) -> Any:
    """Whether the end q of a step from p is deeper than `slack` in a collider on which the particle lies, or behind it."""
    if len(colliders) == 0:
        return False
    below = (gap(colliders[0], q) < -slack) | _behind(colliders[0], p, q)
    return (on[0] & below) | sunk(colliders[1:], on[1:], p, q, slack)


def loose(colliders: Any, on: Any, p: Any, q: Any, slack: Any) -> Any:
    """Whether the end q of a step from p is off, in or behind a collider on which the particle should lie by more than
    `slack`, as another moved it."""
    if len(colliders) == 0:
        return False
    off = (abs(gap(colliders[0], q)) > slack) | _behind(colliders[0], p, q)
    return (on[0] & off) | loose(colliders[1:], on[1:], p, q, slack)


def _behind(c: Any, p: Any, q: Any) -> Any:
    """Whether q is on the other side of a collider, such as a thin sheet, where gaps are positive again."""
    return opposite(c, p, q) if crossable(c) else False


def inside(colliders: Any, on: Any, p: Any, alone: bool = False) -> Any:
    """Whether the particle is in a collider other than those on which it lies. A test in vectors is cheaper than a gap, but
    not where each is looked at `alone`, since gaps take a search."""
    if len(colliders) == 0:
        return False
    others = inside(colliders[1:], on[1:], p, alone)
    if alone and on[0]:
        return others
    return ((gap(colliders[0], p) < 0) & (not on[0])) | others


def touches(colliders: Any, on: Any, p: Any, slack: Any) -> Any:
    """Whether a particle touches a collider on which it does not lie."""
    if len(colliders) == 0:
        return False
    others = touches(colliders[1:], on[1:], p, slack)
    return others or (not on[0] and gap(colliders[0], p) <= slack)


def nowhere(colliders: Any) -> Any:
    """That the particle lies on none of some colliders."""
    return tuple(False for _ in colliders)


def ends_inside(contacts: Any, q: Any) -> Any:
    """Whether a step ends inside of a collider that no way crosses: a plane, or a discrete one."""
    planes = tuple(c for c in contacts.continuous if not crossable(c))
    sunk_in = sinks(planes, q, rounding(contacts, q), contacts.tolerance)
    return sunk_in | inside(contacts.discrete, nowhere(contacts.discrete), q)


def sinks(planes: Any, q: Any, slack: Any, tolerance: Any) -> Any:
    """Whether a step that ends at q leads into one of some planes."""
    if len(planes) == 0:
        return False
    return presses(*gap_and_normal(planes[0], q), q, slack, tolerance) | sinks(
        planes[1:], q, slack, tolerance
    )


def pressed(colliders: Any, p: Any, q: Any, slack: Any, tolerance: Any, alone: bool) -> Any:
    """Whether a step from p to q leads into one of some colliders by what presses, more than by the velocity of p. Where
    each is looked at `alone`, since gaps take a search, a bound of the gap comes first."""
    if len(colliders) == 0:
        return False
    others = pressed(colliders[1:], p, q, slack, tolerance, alone)
    if alone:
        return others or _pressed(colliders[0], p, q, slack, tolerance, alone)
    return others | _pressed(colliders[0], p, q, slack, tolerance, alone)


def _pressed(c: Any, p: Any, q: Any, slack: Any, tolerance: Any, alone: bool) -> Any:
    if isinstance(c.shape, MovingRecord):
        return _pressed(at_rest(c), ride(c.shape, p), ride(c.shape, q), slack, tolerance, alone)
    if alone and least_gap(c.shape, q, slack) > slack:
        return False
    g, n = gap_and_normal(c, q)
    deep = presses(g, n, q, slack, tolerance) & (along(n, p) >= type_of(g, 0.5) * along(n, q))
    # Where places are rounded much, what flies in would fall on until it is `slack` deep, and be given the way back.
    return (deep | ((g < 0) & (along(n, q) < 0))) if coarse(tolerance) else deep


def coarse(tolerance: Any) -> bool:
    """Whether places are kept in single precision, by the type of the tolerance of contacts."""
    return isinstance(tolerance, np.float32)


def presses(g: Any, n: Any, q: Any, slack: Any, tolerance: Any) -> Any:
    """Whether a particle with this gap and normal is inside, or moves in where the gap is but a rounding error: in single
    precision steps may sink by less than places are rounded."""
    if coarse(tolerance):
        return g < (slack if along(n, q) < 0 else type_of(g, 0))
    return g < 0  # no step is that short in double precision, and looks would double the cost of six planes


def extent(contacts: Any, x: Any, y: Any, z: Any) -> Any:
    """|x| + |y| + |z|, without the coordinates that no gap depends on: those along planes whose normal is an axis."""
    total = type_of(x, 0)
    colliders = contacts.continuous if contacts.sized_by is None else contacts.sized_by
    for v, along_it in ((x, (PlaneYRecord, PlaneZRecord)), (y, (PlaneZRecord, PlaneXRecord)), (z, FLAT)):
        if not all(isinstance(c.shape, along_it) for c in colliders):
            total = total + abs(v)
    return total


ALONG_AXES = (PlaneXRecord, PlaneYRecord, PlaneZRecord)
"""Planes whose normal is an axis."""
FLAT = ALONG_AXES[:2]
"""Planes along the z axis."""


def rounding(contacts: Any, p: Any) -> Any:
    """Gaps that are nothing but rounding errors [m]."""
    return contacts.tolerance * (extent(contacts, p.x, p.y, p.z) + p.r + contacts.reach)


def shallow(contacts: Any, p: Any) -> Any:
    """A bound of the rounding error of a gap itself [m], of which `rounding` is a safe multiple."""
    return type_of(p.x, SHALLOW) * rounding(contacts, p)


def rounding_of_step(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """Gaps that are nothing but rounding errors in a step from p to q [m]."""
    way = extent(contacts, p.vx, p.vy, p.vz) + extent(contacts, q.vx, q.vy, q.vz)
    return rounding(contacts, p) + contacts.tolerance * h * way


def farther(contacts: Any, p: Any, q: Any) -> Any:
    """Rounding errors of gaps along the way from p to q [m]."""
    return max(rounding(contacts, p), rounding(contacts, q))
