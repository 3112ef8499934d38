"""The numbers of an implicit method, and those of its first steps: a method that looks back has nothing to look at there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.implicit.krylov import General, Symmetric
from particlesim.engine.implicit.linear_system import told_all
from particlesim.engine.state.columns import type_of
from particlesim.engine.step.newton import ROUNDING
from particlesim.integrators import ImplicitMethod


class StagedImplicit(NamedTuple):
    """Numbers of an implicit method: γ, c, weights of the past and of the slope at the start, whether (X, V) is the middle;
    whether one linear solve is all; relative tolerance, and what rounding leaves; bounds on Newton and linear iterations;
    what equations the kernel can solve; what inertia counts for, and the part of a step that X₀ goes on with the velocity at
    the start: 1 and 0, but for a first step."""

    gamma: float
    node: float
    past: float
    slope: float
    middle: bool
    linear: bool
    tolerance: float
    rounding: float
    limit: int
    linear_limit: int
    solver: Symmetric | General
    mass: float = 1.0
    drift: float = 0.0


def staged_implicit(method: ImplicitMethod, dtype: Any, solver: Symmetric | General) -> StagedImplicit:
    """A method's numbers for the stage-wise kernel."""
    newton = method.record().newton
    return StagedImplicit(
        method.gamma,
        method.node,
        method.past,
        method.slope,
        method.ahead,
        newton is None,
        method.residual,
        ROUNDING * float(np.finfo(dtype).eps),
        1 if newton is None else newton.limit,
        method.max_linear_iterations,
        solver,
        1.0,
        0.0,
    )


def begun(method: Any, c: Any, work: Any, share: Any, h: Any) -> Any:
    """The method, or a first step where it remembers a past and no particle has one that fits."""
    if len(c.memory) == 0:
        return method
    known = False
    for i in range(share.first, share.last):
        known = known | (c.memory[6][i] == h)
    return method if told_all(known, work.system, share) else first_step(method)


def first_step(method: Any) -> StagedImplicit:
    """A method of one step: V = v + h a(X), X = x + h v + ½ h² a(X), by N. M. Newmark, J. Eng. Mech. Div. 85, 67 (1959),
    with β = ½ and γ = 1.

    It is exact under constant forces, and takes energy from every spring, however stiff. A past as under the force that acts
    now would give some, (ω h)² / 16 times what there is. As X = x + ½ h (v + V), it has half of the reach, in which half of
    the inertia gets the same velocity."""
    return StagedImplicit(
        0.5,
        method.node,
        0.0,
        0.0,
        method.middle,
        method.linear,
        method.tolerance,
        method.rounding,
        method.limit,
        method.linear_limit,
        method.solver,
        0.5,
        0.5,
    )


def begin_anew(work: Any, share: Any, h: Any) -> None:
    """X₀ and V₀ of a first step of what has inertia, from the state at its beginning."""
    s, half = work.system, type_of(h, 0.5) * h
    for k in range(3):
        for i in range(share.first, share.last):
            s.base[k, i] = work.before[k, i] + half * work.before[3 + k, i]
            s.base[3 + k, i] = work.before[3 + k, i]
