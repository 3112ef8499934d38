"""The half-space behind a plane, as kernels see it.

Gap g = n·x − n·p − r for a particle of radius r; the legal side is g > 0. On overlap the particle is put back on the
surface, and if it approaches (v·n < 0) its velocity becomes (physics: impulse j = −(1 + e) m (v·n) n)

    v' = v − (1 + e) (v·n) n − k (v − (v·n) n)

with restitution e and tangential loss k. Planes whose normal is an axis have records of their own: the two other
components then drop out of the compiled loop.
"""

from __future__ import annotations

from typing import NamedTuple

from particlesim.laws.registry import PASS, Particle, contact, gap, law, moved_to


class PlaneRecord(NamedTuple):
    """Any plane: unit normal, n·p, 1 + e, k, outcome."""

    nx: float
    ny: float
    nz: float
    offset: float
    bounce: float
    loss: float
    outcome: int


class PlaneXRecord(NamedTuple):
    """A plane whose normal is side · x̂ with side = ±1; offset = side · (the plane's x)."""

    side: float
    offset: float
    bounce: float
    keep: float
    outcome: int


class PlaneYRecord(NamedTuple):
    """A plane whose normal is side · ŷ."""

    side: float
    offset: float
    bounce: float
    keep: float
    outcome: int


class PlaneZRecord(NamedTuple):
    """A plane whose normal is side · ẑ."""

    side: float
    offset: float
    bounce: float
    keep: float
    outcome: int


@law(gap, PlaneRecord)
def plane_gap(c: PlaneRecord, p: Particle) -> float:
    return p.x * c.nx + p.y * c.ny + p.z * c.nz - c.offset - p.r


@law(gap, PlaneXRecord)
def plane_x_gap(c: PlaneXRecord, p: Particle) -> float:
    return c.side * p.x - c.offset - p.r


@law(gap, PlaneYRecord)
def plane_y_gap(c: PlaneYRecord, p: Particle) -> float:
    return c.side * p.y - c.offset - p.r


@law(gap, PlaneZRecord)
def plane_z_gap(c: PlaneZRecord, p: Particle) -> float:
    return c.side * p.z - c.offset - p.r


# Selects, not branches: the loop over a block must stay vectorised.


@law(contact, PlaneRecord)
def plane_contact(c: PlaneRecord, p: Particle) -> tuple[Particle, int]:
    d = p.x * c.nx + p.y * c.ny + p.z * c.nz - c.offset - p.r
    vn = p.vx * c.nx + p.vy * c.ny + p.vz * c.nz
    below = d < 0
    hit = below & (vn < 0)
    # −(1 + e) v_n n − k (v − v_n n) = j n − k v
    j = (c.loss - c.bounce) * vn
    x = p.x - d * c.nx if below else p.x
    y = p.y - d * c.ny if below else p.y
    z = p.z - d * c.nz if below else p.z
    vx = p.vx + j * c.nx - c.loss * p.vx if hit else p.vx
    vy = p.vy + j * c.ny - c.loss * p.vy if hit else p.vy
    vz = p.vz + j * c.nz - c.loss * p.vz if hit else p.vz
    return moved_to(p, x, y, z, vx, vy, vz, p.t), c.outcome if below else PASS


@law(contact, PlaneXRecord)
def plane_x_contact(c: PlaneXRecord, p: Particle) -> tuple[Particle, int]:
    below = c.side * p.x - c.offset - p.r < 0
    hit = below & (c.side * p.vx < 0)
    x = c.side * (c.offset + p.r) if below else p.x
    vx = p.vx - c.bounce * p.vx if hit else p.vx
    vy = c.keep * p.vy if hit else p.vy
    vz = c.keep * p.vz if hit else p.vz
    return moved_to(p, x, p.y, p.z, vx, vy, vz, p.t), c.outcome if below else PASS


@law(contact, PlaneYRecord)
def plane_y_contact(c: PlaneYRecord, p: Particle) -> tuple[Particle, int]:
    below = c.side * p.y - c.offset - p.r < 0
    hit = below & (c.side * p.vy < 0)
    y = c.side * (c.offset + p.r) if below else p.y
    vx = c.keep * p.vx if hit else p.vx
    vy = p.vy - c.bounce * p.vy if hit else p.vy
    vz = c.keep * p.vz if hit else p.vz
    return moved_to(p, p.x, y, p.z, vx, vy, vz, p.t), c.outcome if below else PASS


@law(contact, PlaneZRecord)
def plane_z_contact(c: PlaneZRecord, p: Particle) -> tuple[Particle, int]:
    below = c.side * p.z - c.offset - p.r < 0
    hit = below & (c.side * p.vz < 0)
    z = c.side * (c.offset + p.r) if below else p.z
    vx = c.keep * p.vx if hit else p.vx
    vy = c.keep * p.vy if hit else p.vy
    vz = p.vz - c.bounce * p.vz if hit else p.vz
    return moved_to(p, p.x, p.y, z, vx, vy, vz, p.t), c.outcome if below else PASS
