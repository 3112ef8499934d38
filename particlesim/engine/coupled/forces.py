"""Total forces on a thread's share of an island, and moves that particles make while they are still in the cache.

Forces are added up in a fixed order: first the one-particle forces, then bond after bond, then all other
interactions. Every thread owns whole chunks of particles, and writes to them alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.bonds import add_bonds, chunks_of
from particlesim.engine.interactions.interaction import add_elements, add_settled_set, prepare_elements
from particlesim.engine.state.columns import block_of, fetch, in_step, span, type_of
from particlesim.engine.state.prescribed import drive
from particlesim.engine.step.particle_step import Newtonian
from particlesim.engine.step.program import BLOCK
from particlesim.laws.registry import force, velocity


def bring(motions: Any, c: Any, share: Any, t: Any) -> None:
    """Bring the driven particles of a share to time t; returns when those of all shares are there."""
    if len(motions) > 0:
        drive(motions, c.x, c.y, c.z, c.vx, c.vy, c.vz, t)
        meet(share.gate, share.threads)


def add_forces(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any) -> None:
    """Sum of the one-particle forces on particles [lo, hi), and no torques; sets `total` [3 or 6, hi − lo]."""
    if c.spin is not None:
        for k in range(3, 6):
            for i in range(hi - lo):
                total[k, i] = 0
    for part in parts:
        first, last = max(lo, part.first), min(hi, part.last)
        if first < last:
            _set_forces(part.forces, block_of(c, first, last), total[:, first - lo : last - lo], t)


def _set_forces(forces: Any, q: Any, total: Any, t: Any) -> None:
    """The one-particle forces on the particles of a block."""
    gx, gy, gz = total[0], total[1], total[2]
    for i in range(gx.size):
        fx, fy, fz = force(forces, fetch(q, i, t))
        gx[i] = fx
        gy[i] = fy
        gz[i] = fz


def begin_forces(parts: Any, c: Any, total: Any, t: Any, lo: Any, hi: Any, chunk: Any) -> int:
    """Set the total force on particles [lo, hi), chunk after chunk, to the one-particle forces; returns where that ended."""
    while lo < hi:
        end = min(lo + chunk, hi)
        add_forces(parts, c, total[:, lo:end], t, lo, end)
        lo = end
    return int(lo)


def rates(parts: Any, c: Any, total: Any, slope: Any, t: Any, lo: Any, hi: Any) -> None:
    """Time derivative of position and velocity of particles [lo, hi), into slope [6, n]."""
    for part in parts:
        first, last = max(lo, part.first), min(hi, part.last)
        if first < last:
            _set_rates(part.dynamics, c, total, slope, t, first, last)


def _set_rates(dynamics: Any, c: Any, total: Any, slope: Any, t: Any, first: Any, last: Any) -> None:
    """`rates` for particles of one kind of dynamics; tracers are never coupled."""
    if isinstance(dynamics, Newtonian):
        m = c.m[first:last]
        for k, v in enumerate((c.vx, c.vy, c.vz)):
            own, glide = v[first:last], slope[k, first:last]
            f, out = total[k, first:last], slope[3 + k, first:last]
            for i in range(m.size):
                glide[i] = own[i]
                out[i] = f[i] / m[i]
        if c.spin is not None:
            _set_turning(block_of(c, first, last), total[3:, first:last], slope[6:, first:last])
    else:
        for i in range(first, last):
            wx, wy, wz = velocity(dynamics.flow, fetch(c, i, t))
            slope[0, i] = wx + total[0, i] / dynamics.gamma
            slope[1, i] = wy + total[1, i] / dynamics.gamma
            slope[2, i] = wz + total[2, i] / dynamics.gamma
            for k in range(3):
                slope[3 + k, i] = 0


def _set_turning(q: Any, torque: Any, slope: Any) -> None:
    """Time derivative of angle and angular velocity of a block, into slope [6, n]."""
    for k, w in enumerate((q.spin.wx, q.spin.wy, q.spin.wz)):
        glide, out = slope[k], slope[3 + k]
        for i in range(w.size):
            glide[i] = w[i]
            out[i] = torque[k, i] * inverse_inertia(q, i)


def inverse_inertia(q: Any, i: Any) -> Any:
    """1/I of a sphere, I = 2/5 m r² [1/(kg m²)]; 0 of a point."""
    inertia = type_of(q.x[i], 0.4) * q.m[i] * q.r[i] * q.r[i]
    one = type_of(inertia, 1)
    return one / (inertia if inertia > 0 else one) if inertia > 0 else one - one


def felt(clock: Any, hi: Any, g: Any) -> Any:
    """A force on a particle that moves for a time hi; none on one that does not move, be it infinite."""
    if clock is None:
        return g
    return g if hi > 0 else type_of(g, 0)


def kick(q: Any, gx: Any, gy: Any, gz: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """v += weight · h f/m for all particles of a block with total forces g."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        k = weight * hi / q.m[i]
        q.vx[i] += k * felt(q.clock, hi, gx[i])
        q.vy[i] += k * felt(q.clock, hi, gy[i])
        q.vz[i] += k * felt(q.clock, hi, gz[i])


def drift(q: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """x += weight · h v for all particles of a block."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        s = weight * hi
        q.x[i] += s * q.vx[i]
        q.y[i] += s * q.vy[i]
        q.z[i] += s * q.vz[i]


def twist(q: Any, gx: Any, gy: Any, gz: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """ω += weight · h τ/I for all spheres of a block with total torques g."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        k = weight * hi * inverse_inertia(q, i)
        q.spin.wx[i] += k * felt(q.clock, hi, gx[i])
        q.spin.wy[i] += k * felt(q.clock, hi, gy[i])
        q.spin.wz[i] += k * felt(q.clock, hi, gz[i])


def roll(q: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """Angles += weight · h ω for all spheres of a block."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        s = weight * hi
        q.spin.ax[i] += s * q.spin.wx[i]
        q.spin.ay[i] += s * q.spin.wy[i]
        q.spin.az[i] += s * q.spin.wz[i]


def roll_anew(q: Any, weight: Any, t: Any, end: Any, h: Any) -> None:
    """Angles = weight · h ω for all spheres of a block."""
    for i in range(q.x.size):
        _, hi = span(q.clock, i, t, end, h)
        s = weight * hi
        q.spin.ax[i] = s * q.spin.wx[i]
        q.spin.ay[i] = s * q.spin.wy[i]
        q.spin.az[i] = s * q.spin.wz[i]


def all_finite(q: Any) -> bool:
    """Whether all positions and velocities of a block are finite."""
    wild = False
    for i in range(q.x.size):
        drop = (q.x[i] - q.x[i]) + (q.y[i] - q.y[i]) + (q.z[i] - q.z[i])
        drop += (q.vx[i] - q.vx[i]) + (q.vy[i] - q.vy[i]) + (q.vz[i] - q.vz[i])
        if q.spin is not None:
            s = q.spin
            drop += (s.wx[i] - s.wx[i]) + (s.wy[i] - s.wy[i]) + (s.wz[i] - s.wz[i])
        wild |= drop != 0
    return not wild


def look(before: Any, c: Any, lo: Any, hi: Any, share: Any) -> None:
    """Mark the share if a number of particles [lo, hi) is not finite after their last move in a step, while they are in the
    cache; where a step's beginning is kept, `end_step` looks when contacts are done."""
    if before is None and not all_finite(block_of(c, lo, hi)):
        share.wild[8 * share.number] = 1


class Move(NamedTuple):
    """A stage, maybe the last one, of a composition in the step from t to `end` of length h: weights of its kick and of its
    drift, 0 where there is none, and whether angles count from there on, as in the first drift of a step."""

    push: Any
    glide: Any
    anew: Any
    last: Any
    t: Any
    end: Any
    h: Any


def kick_and_drift(move: Any, c: Any, work: Any, share: Any, first: Any, last: Any) -> None:
    """A stage of a composition for particles [first, last) of a share."""
    for lo in range(first, last, BLOCK):
        hi = min(lo + BLOCK, last)
        move_block(move, c, work.force[:, lo:hi], work.before, share, lo, hi)


def move_block(move: Any, c: Any, force: Any, before: Any, share: Any, lo: Any, hi: Any) -> None:
    """The same for a block with total forces [3 or 6, hi − lo]."""
    q, t, end, h = block_of(c, lo, hi), move.t, move.end, move.h
    if move.push != 0:
        kick(q, force[0], force[1], force[2], move.push, t, end, h)
        if q.spin is not None:
            twist(q, force[3], force[4], force[5], move.push, t, end, h)
    if move.glide != 0:
        drift(q, move.glide, t, end, h)
        if q.spin is not None:
            if move.anew:
                roll_anew(q, move.glide, t, end, h)
            else:
                roll(q, move.glide, t, end, h)
    if move.last:
        look(before, c, lo, hi, share)


def move_on(move: Any, c: Any, work: Any, share: Any, done: Any, ready: Any) -> Any:
    """Chunks of a share, from number `done` to `ready` in its order, make a move. Returns how many have made it."""
    if move is None:
        return done
    for k in range(done, ready):
        lo = share.order.ready[k]
        kick_and_drift(move, c, work, share, lo, min(lo + share.chunk, share.last))
    return int(max(done, ready))


@outlined
def evaluate(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, move: Any) -> None:
    """Total force on the particles of a share; returns when those of all shares are known, with a `Move` its own.

    All positions and velocities must be in place, but for those of driven particles, which are brought to time t. With a
    `Move` particles make it as soon as the forces on them are known and no sum needs their old positions any more, while
    they are still in the cache. It is None otherwise.
    """
    bring(share.motions, c, share, t)
    prepare_elements(share.elements, c, share, t)
    if move is not None and len(bonds) == 0 and all(type(each).settled for each in share.elements):
        here = on_stack(6, BLOCK, work.force.dtype)  # those of all particles would go through main memory
        for lo in range(share.first, share.last, BLOCK):
            hi = min(lo + BLOCK, share.last)
            total = here[:, : hi - lo]
            add_forces(parts, c, total, t, lo, hi)
            for each in share.elements:
                add_settled_set(each, c, total, lo, hi, t)
            move_block(move, c, total, work.before, share, lo, hi)
        return
    order, begun, done = share.order, share.first, 0
    for chunk in range(chunks_of(bonds)):
        begun = begin_forces(parts, c, work.force, t, begun, order.front[chunk], share.chunk)
        add_bonds(bonds, c, work.force, work.pull, chunk)
        done = move_on(move, c, work, share, done, order.after[chunk])
    begin_forces(parts, c, work.force, t, begun, share.last, share.chunk)
    add_elements(share.elements, c, work.force, share.first, share.last, t)
    meet(share.gate, share.threads)
    move_on(move, c, work, share, done, order.ready.size)


@kernel
def island_forces(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> None:
    """Total force on every particle of an island, into work.force; `share` is the whole island."""
    evaluate(parts, bonds, in_step(c, t, t), work, share, t, None)


@kernel
def forces_in_step(parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any) -> None:
    """The same in the step that the clock of the columns knows (`in_step`): what is there in a part of it counts so much."""
    evaluate(parts, bonds, c, work, share, t, None)
