"""Which particles meet colliders in a step, and which of them lie there and need no search for an impact.

Everything here is selects, so that a loop over a block stays vectorised; where that does not pay, each particle is looked
at by itself (`rest_alone`).
"""

from __future__ import annotations

from typing import Any

from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.response import crossable
from particlesim.compiler import outlined
from particlesim.engine.state.columns import chosen, type_of
from particlesim.engine.step.contacts import (
    ALONG_AXES,
    Simple,
    by_calls,
    ends_inside,
    farther,
    inside,
    loose,
    meet,
    nowhere,
    pressed,
    rounding,
    rounding_of_step,
)
from particlesim.engine.step.crossing import all_apart, straight
from particlesim.engine.step.lateness import along_contacts, hastened
from particlesim.engine.step.lying import no_higher, settled, settled_one
from particlesim.engine.step.particle_step import kick
from particlesim.engine.step.resting import glides_in, stays, turns
from particlesim.laws.registry import PASS, moved_to


def overlapped(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """Whether the step of h from p to q may meet a collider; never for simple contacts."""
    if isinstance(contacts, Simple):
        return False
    met = ends_inside(contacts, q)
    if not any(crossable(c) for c in contacts.continuous):
        return met
    nothing = nowhere(contacts.continuous)
    met |= not all_apart(contacts.continuous, nothing, p, q, h, farther(contacts, p, q))
    # A way that ends inside by less than rounding errors crosses nothing. What lies there must be held all the same: it
    # would fall freely from step to step until it is deeper.
    colliders, alone = tuple(c for c in contacts.continuous if crossable(c)), contacts.one_by_one is not None
    return met | pressed(colliders, p, q, rounding(contacts, q), contacts.tolerance, alone)


def rest(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """The end of a step from p that meets a collider before q, and whether it is rest, without an impact, so that there
    is nothing to trace."""
    slack, alone = rounding_of_step(contacts, p, q, h), contacts.one_by_one is not None
    look = settled_one if alone else settled
    r, on, turn = look(contacts.continuous, p, q, h, contacts.tolerance, slack, False)
    r = no_higher(contacts.continuous, on, p, q, r, h, contacts.tolerance, slack)
    calm = any(on) & (turn >= 1)
    if len(contacts.continuous) > 1 or crossable(
        contacts.continuous[0]
    ):  # else nothing has moved it off the plane
        calm &= not loose(contacts.continuous, on, p, r, slack)
    if rough(contacts.continuous):
        still = (r.x == p.x) & (r.y == p.y) & (r.z == p.z) & (r.vx == 0) & (r.vy == 0) & (r.vz == 0)
        calm &= still | (sum(on) <= 1)
    calm &= not inside(contacts.continuous + contacts.discrete, on + nowhere(contacts.discrete), r, alone)
    if any(crossable(c) for c in contacts.continuous):
        calm &= all_apart(contacts.continuous, on, straight(p, r, h), r, h, farther(contacts, p, r), alone)
    return unmoved(contacts, p, r, slack), calm


def unmoved(contacts: Any, p: Any, r: Any, slack: Any) -> Any:
    """The end r of a step of what lies on colliders; where it began, at p, if only rounding has moved it. It would go to and
    fro for ever by that, and no step would be the same as another (`repeats`)."""
    if any(map(runs, contacts.continuous)) or isinstance(contacts, Simple):
        return r
    still = (p.vx == 0) & (p.vy == 0) & (p.vz == 0) & (r.vx == 0) & (r.vy == 0) & (r.vz == 0)
    far = max(abs(r.x - p.x), abs(r.y - p.y), abs(r.z - p.z))
    return chosen(still & (far <= slack), moved_to(r, p.x, p.y, p.z, r.vx, r.vy, r.vz, r.t), r)


@outlined
def rest_alone(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """`rest` for where each particle is looked at by itself."""
    return rest(by_calls(contacts), p, q, h)


def _rest(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    return rest(contacts, p, q, h) if contacts.one_by_one is None else rest_alone(contacts, p, q, h)


def turning(contacts: Any) -> bool:
    """Whether what presses may change along the way of what lies on some collider, none of which runs but round ones that
    are led."""
    turn = any(c.response.turning is not None or turns(c) for c in contacts.continuous)
    return turn and all(not runs(c) or glides_in(c) for c in contacts.continuous)


def rest_behind(forces: Any, contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """`rest` for velocities that are half a step behind places, where what presses may change along the way. With which a
    step ends and the next one begins agree to rounding."""
    half = type_of(h, 0.5)
    a = half * (q.vx - p.vx), half * (q.vy - p.vy), half * (q.vz - p.vz)
    late, _ = along_contacts(contacts, p, a, False)
    # The step of velocity Verlet, which has the same places, but for what contact takes up of the velocity.
    begun = hastened(p, late)
    x, y, z = (b - h * (whole - part) for b, whole, part in zip((q.x, q.y, q.z), a, late, strict=True))
    end = moved_to(q, x, y, z, begun.vx + a[0], begun.vy + a[1], begun.vz + a[2], q.t)
    r, calm = _rest(contacts, begun, kick(half, forces, end, h), h)
    ahead = kick(half, forces, r, h)
    late, _ = along_contacts(contacts, r, (ahead.vx - r.vx, ahead.vy - r.vy, ahead.vz - r.vz), False)
    return hastened(r, tuple(-v for v in late)), calm


def rough(colliders: Any) -> bool:
    """Whether friction may act between several colliders: it knows what presses on all of them only if they are looked at
    together, also where they are at right angles."""
    return len(colliders) > 1 and any(c.response.friction is not None for c in colliders)


def keeps_still(contacts: Any) -> bool:
    """Whether `stay` can tell anything: all colliders are planes along an axis that do not run."""
    if isinstance(contacts, Simple) or len(contacts.continuous) == 0 or len(contacts.discrete) > 0:
        return False
    return all(isinstance(c.shape, ALONG_AXES) and c.response.belt is None for c in contacts.continuous)


def stay(contacts: Any, p: Any, q: Any, h: Any) -> Any:
    """As `rest`, in half of its time, for particles that were at rest on one plane before; of others it is not sure."""
    slack, r = rounding_of_step(contacts, p, q, h), q
    on: tuple[Any, ...] = ()
    for c in contacts.continuous:
        here, there = stays(c, p, q, h, contacts.tolerance, slack)
        r, on = chosen(here, there, r), (*on, here)
    return r, (sum(on) == 1) & (not inside(contacts.continuous, on, r))


def runs(c: Any) -> bool:
    """Whether the surface of a collider moves."""
    return isinstance(c.shape, MovingRecord) or c.response.belt is not None


def respond(contacts: Any, p: Any) -> Any:
    """Simple contacts at the end of a step; careful ones leave the particle to `trace`."""
    if isinstance(contacts, Simple):
        return meet(contacts.colliders, p)
    return p, PASS
