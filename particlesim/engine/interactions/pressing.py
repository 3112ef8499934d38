"""A soft contact of two surfaces: force, torques, and the memory of the contact.

With n the normal from the second to the first, Ω = r₁ ω₁ + r₂ ω₂ and the lever arms a = s r, s = |l|/(r₁ + r₂), the surfaces
slide over each other at v_t = v − (v·n) n − s Ω × n. A tangential spring and damper pull with f_t = −k_t ξ − γ_t v_t,
ξ' = v_t, but not with more than μ_s (N − γ_n v·n); a sliding contact has μ_k in place of μ_s, and its spring is shortened so
that it pulls with no more than that by itself. The torque on each is −a n × f_t: as the arms end at one point, angular
momentum is kept.

Where k_t grows with the overlap, ξ is shortened by as much as k_t has grown since the step began, so that the force of what
was stretched stays: kept, the spring would give back more than it has taken. Where k_t falls, ξ is kept.

ξ is the tangential part of the anchor and of l, less s A × n with A = r₁ α₁ + r₂ α₂ of the angles of rotation since the step
began. So forces within a step depend on positions alone, but for that growth, and every method sees the same spring.

Source: D. Elata, J. G. Berryman, Mech. Mater. 24, 229 (1996), for springs that grow stiffer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler.roots import inverse_sqrt, root
from particlesim.engine.interactions.contact_lists import HOLDS, SLIDES
from particlesim.engine.state.columns import type_of
from particlesim.interactions.contact import HertzRecord, LinearRecord
from particlesim.laws.contact import reduced_radius, touch

LEAST = 1e-30
"""An overlap that is less than rounding leaves of any [m]."""


class Held(NamedTuple):
    """The memory of a contact: whether and how it touched, and its anchor [m]."""

    state: Any
    x: Any
    y: Any
    z: Any


class Turning(NamedTuple):
    """How both surfaces turn: s, Ω [m/s] and A [m]."""

    arm: Any
    w: Any
    a: Any


class Rolling(NamedTuple):
    """How one rolls on the other: ω₁ − ω₂ [rad/s], α₁ − α₂ [rad], and the way ρ that it has rolled [m]."""

    w: Any
    a: Any
    way: Any


class Pressed(NamedTuple):
    """Force on the first [N]; s n × f_t [N], which times −r is the torque on each of the two; the moment of rolling friction
    on the first [N m]; and what the contact remembers from now on: its state, the anchor, and the way rolled. Then the
    force of the potential along n [N], the rate at which it opens [m/s], and the energy [J]."""

    force: Any
    twist: Any
    moment: Any
    held: Any
    rolled: Any
    push: Any
    rate: Any
    energy: Any


def cross(a: Any, b: Any) -> Any:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def dot(a: Any, b: Any) -> Any:
    """a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def press(
    law: Any, p: Any, n: Any, overlap: Any, held: Any, turning: Any, rolling: Any, ago: Any = 0.0
) -> Any:
    """A contact of a law between a pair p, in a step that began `ago` [s]; `held` is None without friction, `turning` where
    nothing turns, and `rolling` without rolling friction."""
    at, none = touch(law, p, overlap), overlap - overlap
    v, zeros = (p.vx, p.vy, p.vz), (none, none, none)
    rate = dot(v, n)
    firm = at.push - at.damping * rate
    along = firm - at.pull
    force = (along * n[0], along * n[1], along * n[2])
    if law.friction is None:
        if held is not None:
            held = Held(type_of(none, HOLDS), none, none, none)
        return Pressed(force, zeros, zeros, held, zeros, at.push - at.pull, rate, at.energy)
    pressed, known = max(firm, none), held.state > 0
    slip = tuple(u - rate * axis for u, axis in zip(v, n, strict=True))
    stretch = (held.x + p.x, held.y + p.y, held.z + p.z)
    if turning is not None:
        turn, angle = cross(turning.w, n), cross(turning.a, n)
        slip = tuple(u - turning.arm * w for u, w in zip(slip, turn, strict=True))
        stretch = tuple(x - turning.arm * a for x, a in zip(stretch, angle, strict=True))
    grown = growth(law, p, at, overlap, overlap + type_of(none, ago) * rate)
    stretch = eased(flattened(stretch, n, known), slip, grown if known else none, ago)
    holds, then = law.friction.static, law.friction.kinetic
    first = then if held.state == SLIDES else holds
    kept, rub, slides = limited(at, stretch, slip, pressed, first, then)
    anchor = tuple(kept * x - d for x, d in zip(stretch, (p.x, p.y, p.z), strict=True))
    state = type_of(none, SLIDES) if slides else type_of(none, HOLDS)
    force = tuple(f + g for f, g in zip(force, rub, strict=True))
    twist, moment, way = zeros, zeros, zeros
    if turning is not None:
        twist = tuple(turning.arm * f for f in cross(n, rub))
    if rolling is not None:
        radius = reduced_radius(p)
        turn, angle = cross(rolling.w, n), cross(rolling.a, n)
        way = tuple(x + radius * a for x, a in zip(rolling.way, angle, strict=True))
        rolls = tuple(radius * w for w in turn)
        way = eased(flattened(way, n, known), rolls, grown if known else none, ago)
        kept, drag, _ = limited(at, way, rolls, pressed, law.rolling, law.rolling)
        moment = tuple(radius * f for f in cross(n, drag))
        way = tuple(kept * x for x in way)
    return Pressed(force, twist, moment, Held(state, *anchor), way, at.push - at.pull, rate, at.energy)


def flattened(v: Any, n: Any, known: Any) -> Any:
    """The tangential part of a vector; zero for a contact that has just begun."""
    up = dot(v, n)
    return tuple(x - up * axis if known else up - up for x, axis in zip(v, n, strict=True))


def growth(law: Any, p: Any, at: Any, overlap: Any, before: Any) -> Any:
    """By which part of itself the stiffness along the surfaces has grown since the overlap was another one, 0 if it fell."""
    none, one = overlap - overlap, type_of(overlap, 1)
    if isinstance(law, LinearRecord):
        return none
    if isinstance(law, HertzRecord):  # as the root of the overlap, which of two that just touch may be none
        return one - root(min(max(before / max(overlap, type_of(none, LEAST)), none), one))
    return one - min(touch(law, p, before).stiffness / at.stiffness, one)


def eased(stretch: Any, slip: Any, grown: Any, ago: Any) -> Any:
    """A stretch of which that from before the step is shortened, as its spring has grown stiffer by a part of what it is."""
    ago = type_of(grown, ago)
    return tuple(x - grown * (x - ago * u) for x, u in zip(stretch, slip, strict=True))


def limited(at: Any, stretch: Any, slip: Any, pressed: Any, first: Any, then: Any) -> Any:
    """A slider on a spring with a stretch and a damper of a slip: the part of the stretch that is kept, the force, and
    whether it slides. It begins to at `first` times what presses, and feels `then` times that.

    What slides has the force of the spring that it keeps, with the damper, and not more than it may feel: so the same force
    is found again from what is remembered."""
    one, length2 = type_of(pressed, 1), dot(stretch, stretch)
    pull = pulled(at, stretch, slip)
    bar, most = first * pressed, then * pressed
    slides = dot(pull, pull) > bar * bar
    load2 = at.stiffness * at.stiffness * length2
    gives = slides & (load2 > most * most)
    kept = most * inverse_length(load2 if gives else one) if gives else one
    pull = pulled(at, tuple(kept * x for x in stretch), slip)
    # a static coefficient below the kinetic one must not speed up what slides
    size2 = dot(pull, pull)
    over = slides & (size2 > most * most)
    part = most * inverse_length(size2 if over else one) if over else one
    return kept, tuple(part * f for f in pull), slides


def pulled(at: Any, stretch: Any, slip: Any) -> Any:
    """The force of the spring and the damper along the surfaces [N]."""
    return tuple(-(at.stiffness * x + at.rub * u) for x, u in zip(stretch, slip, strict=True))


def inverse_length(square: Any) -> Any:
    """1/√ of the square of a length, by products, as divisions and roots would take most of the time of a contact."""
    return type_of(square, 1) / np.sqrt(square) if isinstance(square, np.float32) else inverse_sqrt(square)
