"""What bounces in a step gets no energy from forces that depend on its place.

Impacts are followed on a parabola, with the acceleration a of a particle of mass m that would not bounce. An impact leads
it elsewhere, by d, and forces pull otherwise there. Their energy changes by −∫ f·dd along the straight way, however many
particles bounce; Simpson's rule finds that from the forces without and with the impacts of the step and halfway between,
f, f' and f″. The parabola has counted −m a·d. The difference,

    G = m a·d − (f + 4 f″ + f')·d/6,

is taken from the velocity along d, which is that of the impact. Without it an elastic impact at a speed v gives k v² h²/6 in
the mean, with a stiffness k and a step of h. Dampers and other forces are in it, too.

Methods of second order that are reversible do not keep the energy, but to order h⁴

    E + α h² v·V″v + β h² Σ f²/m + γ h⁴ Σ f·V″f/m²,

with α = 1/12 and β = −1/24 for leapfrogs, α = β = −1/24 for the implicit midpoint rule, and both 1/12 for the trapezoidal
rule (Hairer, Lubich, Wanner, Geometric Numerical Integration, IX; V″ is the matrix of second derivatives of the potential).
Where forces are linear, γ = −1/48 makes it exact for leapfrogs, which keep E − ⅛ h² Σ f²/m then, and this times
1 + h² V″/6m; it is 0 for the other two, which keep E.
What an impact changes of it is in G, too: with w = (v + v')/2, Δ = v' − v and places halfway, forces f± at displacements
of ±n h w − ½ (β/α) n² h² (f + f')/m, with n = `NEAR`, give

    −α (F·d + h (f₊ − f₋)·Δ/n + h² (Δ²/d²) B·d) + γ (α/β) h² F·(f' − f),  F = (f₊ + f₋ − 2 f″)/n²,  B = f − 2 f″ + f',

and the velocity along d counts as h² V″ says. Of other terms only the size is known: with κ the stiffness along d over mass,
they may give `UNSURE` (h² κ)⁵ of the energy there, and as much as `BENT` (h² κ)² times the part of the force that is not
linear; with methods of which only the order is known, `UNKNOWN` (h² κ)³. As κ changes along the way in a step, they may
give `SWAY` times the last part of the first term, times the part that is not linear over h Δ; and `SWING` |F| |d| times that
over h w, without what of F is linear, for what goes as far in a step as forces reach. Impacts give that away.

A fast particle may end so far from where forces pull that the velocity along d does not pay for it: that across gives the
rest, and one that steps alone does not rebound in this step.

Velocities are those of the places: with symplectic Euler v + ½ h f/m, in which way its energy is kept (`engine.shadow`), and
with Störmer's rule u + ½ h f/m, u being that in the middle of the step. Impacts change forces at the end of a step, and not
these velocities. What they differ by from those on the parabola is in G, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.step.lateness import leaps
from particlesim.engine.step.particle_step import BentRecord
from particlesim.engine.step.resting import NOISE, at_place, dot
from particlesim.integrators.base import CompositionRecord
from particlesim.laws.registry import force

LEAPFROG = 1 / 12, 1 / 4, 1 / 24
"""α, −½ β/α and γ α/β of leapfrogs."""


def kept_by(method: Any) -> Any:
    """α and γ α/β of a method, those of h² V″ and its square that are added to the latter; None where they are not known."""
    if leaps(method):
        return LEAPFROG[0], LEAPFROG[2]
    if isinstance(method, CompositionRecord) and method.keeps is not None:
        return (0.0, *(-c for c in method.keeps))
    return None


SHORT = 10.0
"""Impacts that are nearer to the end of a step than this part of it (1 over it) count as if they were that far from it."""
STIFFEST = 4.0
"""(h ω)² at the limit of stability of leapfrogs."""
UNSURE, BENT, SWAY, SWING, UNKNOWN = 0.1, 1.0, 0.1, 0.1, 0.35
"""Of tetrahedra of elastic beads none gains energy then, but for its own swing, with ω h up to 1.2, or up to 0.8 with
methods of which it is not known what they keep. In wells that are far from linear, of 256 particles in each of 80 scenes
none gains a hundredth more than what flies swings there, in 3000 steps with ω h up to 0.5; without the two in the middle one
a quarter, and fast ones in a bowl beside the well as much as they had."""
COMPOSED = 3.0
"""By how much more of the three in the middle methods of higher order give away, whose steps are made of longer ones."""
NEAR = 0.5
"""How far from halfway forces are looked at, of a step. At 1, α V″ lacks three times as much; nearer, rounding counts."""
SOFT = 0.2
"""(h ω)² up to which impacts divide the steps of methods of higher order, and keep that: up to there it gives less, in 2000
steps a thousandth with ω h = 0.3, but for the method's own swing."""
MOST = 1.5
"""How much of its energy along the normal an impact may get back, of what forces have taken: twice the speed."""


@outlined
def slowed_along(
    d: Any, v: Any, w: Any, turn: Any, lateness: Any, forces: Any, ages: Any, series: Any, h: Any
) -> Any:
    """The velocity w at the end of a step h with impacts, v without, less what forces have given by these along the
    displacement d, and whether that was too little; all in double precision.

    On the parabola the velocity changes by `turn` in a unit of time, and lacks `lateness`. `forces`, over mass: without
    impacts, with them, halfway, and half a step behind and ahead of there, and maybe in the middle of these two; the first
    three where `series` (α and γ α/β above) is 0. `ages`: by what parts of a step velocities are older than places at its
    end, and where one begins after contact.
    """
    free, hit, between = forces[:3]
    old, begun = h * ages[0], h * ages[1]
    # What a step begins with after contact is not old with Störmer's rule, as that is with which one ends.
    lost = tuple(old * f - (old - begun) * a for f, a in zip(free, turn, strict=True))
    told = tuple(begun * g for g in hit)
    w = tuple(b + g + (old - begun) * (f - a) for b, g, f, a in zip(w, told, free, turn, strict=True))
    change = tuple(b - (c + s) for b, c, s in zip(w, v, lost, strict=True))
    mean = tuple((f + 4 * m + g) / 6 for f, m, g in zip(free, between, hit, strict=True))
    # (w² − (w + late − lost)² − v² + (v + late − lost)²)/2, with the velocities on the parabola
    gain = dot(tuple(a - f for a, f in zip(turn, mean, strict=True)), d)
    gain -= dot(tuple(b - s for b, s in zip(lateness, lost, strict=True)), change)
    square, along = dot(d, d), dot(w, d)
    s, lack = 0.0, 0.0
    if square > 0 and along != 0:
        length, part = np.sqrt(square), h * h / square
        differ = tuple(g - f for f, g in zip(free, hit, strict=True))
        bend = _bend(free, between, hit)
        steep, b, heavy = -dot(differ, d), along / length, 1.0
        stiff = min(max(part * steep, -STIFFEST), STIFFEST)
        firm = max(stiff, 0.0)
        unsure = UNKNOWN * firm**3
        if len(forces) > 3:
            gain += _beyond_energy(d, change, forces, series, stiff, h)
            behind, ahead = forces[3:5]
            apart = _change_of(ahead, behind)
            b += series[0] * (stiff * dot(change, d) - h * dot(apart, d)) / length
            heavy += 2 * series[0] * stiff
            bent, part = abs(dot(bend, d)), _part_of_step(change, d, h)
            warp = bent / abs(steep) if bent < abs(steep) else 1.0
            rough = COMPOSED if len(series) > 2 else 1.0
            unsure = UNSURE * firm**5 + rough * BENT * warp * stiff * stiff
            much, whole = part * dot(bend, bend), dot(differ, differ)
            gain += rough * SWAY * part * bent * (np.sqrt(much / whole) if much < whole else 1.0)
            if len(forces) > 5:
                both = _near(_bend(behind, forces[5], ahead))
                much, whole = dot(both, both), dot(apart, apart)
                gain += rough * SWING * length * (much / np.sqrt(whole) if much < whole else np.sqrt(much))
        gain += 0.5 * unsure * b * b
        gain = max(gain, -MOST * b * b)
        # ½ heavy s² + b s + gain = 0
        enough = b * b - 2 * heavy * gain
        lack = -min(enough, 0.0) / heavy
        root = np.sqrt(max(enough, 0.0))
        s = -2 * gain / (b + root if b > 0 else b - root) if root > 0 else -b / heavy
        s = s / length
    ends = tuple(b + s * axis for b, axis in zip(w, d, strict=True))
    if lack > 0:
        # What the velocity along d has not, that across it gives.
        along = dot(ends, d) / square
        across = tuple(b - along * axis for b, axis in zip(ends, d, strict=True))
        had = dot(across, across)
        kept = np.sqrt(max(had - lack, 0.0) / had) if had > 0 else 0.0
        ends = tuple(along * axis + kept * b for b, axis in zip(across, d, strict=True))
    return tuple(b - g for b, g in zip(ends, told, strict=True)), lack > 0


def _beyond_energy(d: Any, change: Any, forces: Any, series: Any, stiff: Any, h: Any) -> Any:
    """What a displacement d and a change of the velocity give to what a method keeps beside the energy, over mass."""
    free, hit, between, behind, ahead = forces[:5]
    both = _near(_bend(behind, between, ahead))
    differ = tuple(g - f for f, g in zip(free, hit, strict=True))
    given = dot(both, d) + h * dot(_change_of(ahead, behind), change)
    given += _part_of_step(change, d, h) * dot(_bend(free, between, hit), d)
    most = series[1]
    if len(series) > 2:
        most += stiff * (series[2] + stiff * series[3])
    return most * h * h * dot(both, differ) - series[0] * given


def _bend(f: Any, between: Any, g: Any) -> Any:
    """By how much forces at both ends of a line together differ from twice that in the middle."""
    return tuple(a - m - m + b for a, m, b in zip(f, between, g, strict=True))


def _near(bend: Any) -> Any:
    """What such a bend would be a whole step away."""
    return tuple(each / (NEAR * NEAR) for each in bend)


def _change_of(ahead: Any, behind: Any) -> Any:
    """How forces change over two steps, as they do near halfway."""
    return tuple((a - b) / NEAR for a, b in zip(ahead, behind, strict=True))


def _part_of_step(change: Any, d: Any, h: Any) -> Any:
    """(h Δ)² over d²."""
    square = dot(d, d)
    return min(h * h * dot(change, change), SHORT * SHORT * square) / square if square > 0 else 0.0


def _looks(forces: Any, free: Any, hit: Any, h: Any, known: Any) -> Any:
    """Displacement and change of the velocity by impacts, and accelerations as `slowed_along` has them."""
    x, v, w = (hit.x, hit.y, hit.z), (free.vx, free.vy, free.vz), (hit.vx, hit.vy, hit.vz)
    d = tuple(b - a for a, b in zip((free.x, free.y, free.z), x, strict=True))
    change = tuple(b - a for a, b in zip(v, w, strict=True))
    mean = tuple(0.5 * (a + b) for a, b in zip(v, w, strict=True))
    half = at_place(hit, tuple(b - 0.5 * s for b, s in zip(x, d, strict=True)), mean)
    f, g, m = _acceleration(forces, free), _acceleration(forces, hit), _acceleration(forces, half)
    if known is None:
        return d, change, (f, g, m)
    near = NEAR * h
    fall = tuple(LEAPFROG[1] * near * near * (a + b) for a, b in zip(f, g, strict=True))
    behind = _acceleration(forces, _led(half, tuple(s - near * u for s, u in zip(fall, mean, strict=True))))
    ahead = _acceleration(forces, _led(half, tuple(s + near * u for s, u in zip(fall, mean, strict=True))))
    return d, change, (f, g, m, behind, ahead, _acceleration(forces, _led(half, fall)))


@outlined
def settled_alone(forces: Any, way: BentRecord, free: Any, hit: Any, h: Any, known: Any) -> Any:
    """The end `hit` of a step of h along the `way` of a method, of which it is `known` what it keeps or not (None), less the
    speed that forces have given it by impacts; it would have ended at `free` without them. And whether that was too little.
    All velocities are those of their places."""
    d, _, looks = _looks(forces, free, hit, h, known)
    v, w = (free.vx, free.vy, free.vz), (hit.vx, hit.vy, hit.vz)
    ends, lacks = slowed_along(
        d, v, w, way.turn, way.late, looks, (0.0, 0.0), known if known is not None else (0.0, 0.0), h
    )
    # between impacts it may have slid, where the parabola does not keep its energy
    ends, more = _no_faster(d, v, w, ends, looks, h, known)
    return at_place(hit, (hit.x, hit.y, hit.z), ends), lacks | more


@outlined
def lain_alone(forces: Any, free: Any, hit: Any, h: Any, known: Any) -> Any:
    """As `settled_alone`, of what lies on something: no faster than what a step without contact would have kept allows."""
    d, _, looks = _looks(forces, free, hit, h, known)
    v, w = (free.vx, free.vy, free.vz), (hit.vx, hit.vy, hit.vz)
    ends, lacks = _no_faster(d, v, w, w, looks, h, known)
    return at_place(hit, (hit.x, hit.y, hit.z), ends), lacks


def _no_faster(d: Any, v: Any, seen: Any, w: Any, looks: Any, h: Any, known: Any) -> Any:
    """The velocity w at a displacement d from where a step without contact ends with v, or the part of it with which what
    the method keeps is no more than there; and whether none would do. Forces have been `seen` with that velocity."""
    square, (f, g, m) = dot(w, w), looks[:3]
    mean = tuple((a + 4 * b + c) / 6 for a, b, c in zip(f, m, g, strict=True))
    gain = (square - dot(v, v)) / 2 - dot(mean, d)
    if known is not None:
        along = dot(d, d)
        steep = dot(tuple(a - b for a, b in zip(f, g, strict=True)), d)
        stiff = min(max(h * h * steep / along, -STIFFEST), STIFFEST) if along > 0 else 0.0
        change = tuple(b - a for a, b in zip(v, w, strict=True))
        gain += _beyond_energy(d, change, looks, known, stiff, h)
        gain += known[0] * stiff * dot(tuple(b - a for a, b in zip(seen, w, strict=True)), change)
    lacks = 2 * gain > square + NOISE * dot(v, v)
    k = np.sqrt(max(square - 2 * gain, 0.0) / square) if (gain > 0) & (square > 0) else 1.0
    return tuple(k * each for each in w), lacks


@outlined
def balanced_alone(forces: Any, free: Any, hit: Any, h: Any, known: Any) -> Any:
    """The end `hit` of a step that elastic impacts have divided, with a velocity along their direction by which the method
    keeps what it keeps; it would have ended at `free` without them."""
    d, _, looks = _looks(forces, free, hit, h, known)
    v, w = (free.vx, free.vy, free.vz), (hit.vx, hit.vy, hit.vz)
    square = dot(d, d)
    part = 0.5 * (dot(w, w) - dot(v, v)) / square if square > 0 else 0.0
    turn, none = tuple(part * axis for axis in d), tuple(axis - axis for axis in d)
    ends, _ = slowed_along(d, v, w, turn, none, looks, (0.0, 0.0), known, h)
    return at_place(hit, (hit.x, hit.y, hit.z), ends)


@outlined
def is_soft(forces: Any, free: Any, hit: Any, h: Any) -> Any:
    """Whether a step is short for how forces change along the displacement of its end by impacts."""
    d = hit.x - free.x, hit.y - free.y, hit.z - free.z
    differ = tuple(
        a - b for a, b in zip(_acceleration(forces, free), _acceleration(forces, hit), strict=True)
    )
    return h * h * dot(differ, d) <= SOFT * dot(d, d)


def _acceleration(forces: Any, p: Any) -> Any:
    fx, fy, fz = force(forces, p)
    return fx * p.w, fy * p.w, fz * p.w


def _led(p: Any, d: Any) -> Any:
    """A particle that is displaced by d."""
    return at_place(p, (p.x + d[0], p.y + d[1], p.z + d[2]), (p.vx, p.vy, p.vz))
