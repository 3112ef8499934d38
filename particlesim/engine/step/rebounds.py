"""What bounces in a step gets no energy from forces that depend on its place.

Impacts are followed on a parabola, with the acceleration a of a particle of mass m that would not bounce. An impact leads
it elsewhere, by d, and forces pull otherwise there. Their energy changes by −∫ f·dd along the straight way, however many
particles bounce; Simpson's rule finds that from the forces without and with the impacts of the step and halfway between,
f, f' and f″. The parabola has counted −m a·d. The difference,

    G = m a·d − (f + 4 f″ + f')·d/6,

is taken from the velocity along d, which is that of the impact. Without it an elastic impact at a speed v gives k v² h²/6 in
the mean, with a stiffness k and a step of h. Dampers and other forces are in it, too.

Methods of second order that are reversible do not keep the energy, but to order h⁴

    E + α h² v·V″v + β h² Σ f²/m,

with α = 1/12 and β = −1/24 for leapfrogs, α = β = −1/24 for the implicit midpoint rule, and both 1/12 for the trapezoidal
rule (Hairer, Lubich, Wanner, Geometric Numerical Integration, IX; V″ is the matrix of second derivatives of the potential).
What an impact changes of it is in G, too: with w = (v + v')/2, Δ = v' − v and places halfway, forces f± at displacements
of ±h w − ½ (β/α) h² (f + f')/m give

    −α ((f₊ + f₋ − 2 f″)·d + h (f₊ − f₋)·Δ + h² (Δ²/d²) (f − 2 f″ + f')·d),

and the velocity along d counts as h² V″ says. Of terms of higher order only the size is known: they may give as much as
`UNSURE` (h² κ)³ of the energy along d, with κ the stiffness there over mass. Impacts give that away.

Velocities are those of the places: with symplectic Euler v + ½ h f/m, in which way its energy is kept (`engine.shadow`), and
with Störmer's rule u + ½ h f/m, u being that in the middle of the step. Impacts change forces at the end of a step, and not
these velocities. What they differ by from those on the parabola is in G, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.step.particle_step import BentRecord
from particlesim.engine.step.resting import dot
from particlesim.laws.registry import force, moved_to

LEAPFROG = 1 / 12, 1 / 4
"""α and −½ β/α of leapfrogs."""
SHORT = 10.0
"""Impacts that are nearer to the end of a step than this part of it (1 over it) count as if they were that far from it."""
UNSURE = 0.35
"""Of tetrahedra of elastic beads with ω h up to 1.2 none of the methods gains energy then, but for its own swing."""
MOST = 1.5
"""How much of its energy along the normal an impact may get back, of what forces have taken: twice the speed."""


@outlined
def slowed_along(
    d: Any, v: Any, w: Any, turn: Any, lateness: Any, forces: Any, ages: Any, series: Any, h: Any
) -> Any:
    """The velocity w at the end of a step h with impacts, v without, less what forces have given by these along the
    displacement d; all in double precision.

    On the parabola the velocity changes by `turn` in a unit of time, and lacks `lateness`. `forces`, over mass: without
    impacts, with them, halfway, and a step behind and ahead of there; the first three where `series`, α above, is 0.
    `ages`: by what parts of a step velocities are older than places at its end, and where one begins after contact.
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
    length, b, heavy, s = np.sqrt(square), 0.0, 1.0, 0.0
    if square > 0 and along != 0:
        part, b = h * h / square, along / length
        # Where other particles bounce as well, this is not their own stiffness alone: it is no more than this in a step
        # that is stable.
        stiff = min(max(part * dot(tuple(f - g for f, g in zip(free, hit, strict=True)), d), -1.0), 1.0)
        if len(forces) > 3:
            behind, ahead = forces[3:]
            both = tuple(x + y - m - m for x, y, m in zip(behind, ahead, between, strict=True))
            apart = tuple(x - y for x, y in zip(ahead, behind, strict=True))
            bend = tuple(f - m - m + g for f, m, g in zip(free, between, hit, strict=True))
            gain -= series * (dot(both, d) + h * dot(apart, change))
            gain -= series * dot(bend, d) * min(part * dot(change, change), SHORT * SHORT)
            b += series * (stiff * dot(change, d) - h * dot(apart, d)) / length
            heavy += 2 * series * stiff
        gain += 0.5 * UNSURE * b * b * max(stiff, 0.0) ** 3
        gain = max(gain, -MOST * b * b)
        # ½ heavy s² + b s + gain = 0
        root = np.sqrt(max(b * b - 2 * heavy * gain, 0.0))
        s = -2 * gain / (b + root if b > 0 else b - root) if root > 0 else -b / heavy
        s = s / length
    return tuple(b - g + s * axis for b, g, axis in zip(w, told, d, strict=True))


@outlined
def settled_alone(forces: Any, way: BentRecord, free: Any, hit: Any, h: Any) -> Any:
    """The end `hit` of a step of h along the `way` of a leapfrog, which would have ended at `free` without impacts, less the
    speed that forces have given it by these. All velocities are those of their places."""
    series, aside = LEAPFROG
    x, v, w = (hit.x, hit.y, hit.z), (free.vx, free.vy, free.vz), (hit.vx, hit.vy, hit.vz)
    d = tuple(b - a for a, b in zip((free.x, free.y, free.z), x, strict=True))
    mean = tuple(0.5 * (a + b) for a, b in zip(v, w, strict=True))
    half = moved_to(hit, *(b - 0.5 * s for b, s in zip(x, d, strict=True)), *mean, hit.t)
    f, g, m = _acceleration(forces, free), _acceleration(forces, hit), _acceleration(forces, half)
    fall = tuple(aside * h * h * (a + b) for a, b in zip(f, g, strict=True))
    behind = _acceleration(forces, _led(half, tuple(s - h * u for s, u in zip(fall, mean, strict=True))))
    ahead = _acceleration(forces, _led(half, tuple(s + h * u for s, u in zip(fall, mean, strict=True))))
    v = slowed_along(d, v, w, way.turn, way.late, (f, g, m, behind, ahead), (0.0, 0.0), series, h)
    return moved_to(hit, *x, *v, hit.t)


def _acceleration(forces: Any, p: Any) -> Any:
    fx, fy, fz = force(forces, p)
    return fx * p.w, fy * p.w, fz * p.w


def _led(p: Any, d: Any) -> Any:
    """A particle that is displaced by d."""
    return moved_to(p, p.x + d[0], p.y + d[1], p.z + d[2], p.vx, p.vy, p.vz, p.t)
