"""Inertial forces in a frame that turns with angular velocity ω(t) = ω₀ + α t about a point.

    f = −m ω × (ω × r) − 2 m ω × v − m α × r,   r = x − center

centrifugal, Coriolis and Euler force. For constant ω the centrifugal force derives from U = −½ m |ω × r|², and the
Coriolis force does no work. Source: Landau, Lifshitz, Mechanics, § 39.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

from particlesim.forces.base import Force
from particlesim.laws.registry import Matrix, Particle, Vector, force, force_dv, force_dx, law, potential
from particlesim.model.units import Metres, RadiansPerSecond, RadiansPerSecondSquared
from particlesim.model.units import Vector as Vector3


class RotatingFrame(Force):
    """Centrifugal, Coriolis and Euler forces, for a scene seen from a turning frame."""

    type: Literal["rotating_frame"] = "rotating_frame"
    angular_velocity: Vector3[RadiansPerSecond]
    """ω₀: the axis by the right-hand rule, its length the rate of turning."""
    angular_acceleration: Vector3[RadiansPerSecondSquared] = (0.0, 0.0, 0.0)
    """α: constant change of the angular velocity."""
    center: Vector3[Metres] = (0.0, 0.0, 0.0)
    """A point on the axis."""

    formula: ClassVar[str] = "f = −m ω×(ω×r) − 2 m ω×v − m α×r"
    by_place: ClassVar[bool] = True
    energy: ClassVar[str] = "U = −½ m |ω×r|² for constant ω; none while the rotation changes"

    def needs_velocity(self) -> bool:
        return True

    def changes(self) -> bool:
        return any(self.angular_acceleration)

    def record(self) -> RotatingFrameRecord | ChangingFrameRecord:
        if any(self.angular_acceleration):
            return ChangingFrameRecord(*self.center, *self.angular_velocity, *self.angular_acceleration)
        return RotatingFrameRecord(*self.center, *self.angular_velocity)


class RotatingFrameRecord(NamedTuple):
    """Center [m], ω [rad/s]."""

    x: float
    y: float
    z: float
    wx: float
    wy: float
    wz: float


class ChangingFrameRecord(NamedTuple):
    """Center [m], ω₀ [rad/s], α [rad/s²]."""

    x: float
    y: float
    z: float
    wx: float
    wy: float
    wz: float
    ax: float
    ay: float
    az: float


def inertial_force(f: Any, p: Particle, wx: float, wy: float, wz: float) -> Vector:
    """Centrifugal and Coriolis force: −m ω × (ω × r + 2 v)."""
    rx, ry, rz = p.x - f.x, p.y - f.y, p.z - f.z
    ux = wy * rz - wz * ry + (p.vx + p.vx)
    uy = wz * rx - wx * rz + (p.vy + p.vy)
    uz = wx * ry - wy * rx + (p.vz + p.vz)
    return p.m * (wz * uy - wy * uz), p.m * (wx * uz - wz * ux), p.m * (wy * ux - wx * uy)


def inertial_dx(m: float, wx: float, wy: float, wz: float) -> Matrix:
    """Centrifugal: m (ω² 1 − ω ωᵀ)."""
    w2 = wx * wx + wy * wy + wz * wz
    return (
        m * (w2 - wx * wx),
        -m * wx * wy,
        -m * wx * wz,
        -m * wy * wx,
        m * (w2 - wy * wy),
        -m * wy * wz,
        -m * wz * wx,
        -m * wz * wy,
        m * (w2 - wz * wz),
    )


def inertial_dv(m: float, wx: float, wy: float, wz: float) -> Matrix:
    """Coriolis: −2 m [ω]×."""
    return 0.0, 2 * m * wz, -2 * m * wy, -2 * m * wz, 0.0, 2 * m * wx, 2 * m * wy, -2 * m * wx, 0.0


@law(force, RotatingFrameRecord)
def rotating_frame_force(f: RotatingFrameRecord, p: Particle) -> Vector:
    return inertial_force(f, p, f.wx, f.wy, f.wz)


@law(potential, RotatingFrameRecord)
def rotating_frame_potential(f: RotatingFrameRecord, p: Particle) -> float:
    rx, ry, rz = p.x - f.x, p.y - f.y, p.z - f.z
    ux, uy, uz = f.wy * rz - f.wz * ry, f.wz * rx - f.wx * rz, f.wx * ry - f.wy * rx
    return -0.5 * p.m * (ux * ux + uy * uy + uz * uz)


@law(force_dx, RotatingFrameRecord)
def rotating_frame_dx(f: RotatingFrameRecord, p: Particle) -> Matrix:
    return inertial_dx(p.m, f.wx, f.wy, f.wz)


@law(force_dv, RotatingFrameRecord)
def rotating_frame_dv(f: RotatingFrameRecord, p: Particle) -> Matrix:
    return inertial_dv(p.m, f.wx, f.wy, f.wz)


@law(force, ChangingFrameRecord)
def changing_frame_force(f: ChangingFrameRecord, p: Particle) -> Vector:
    rx, ry, rz = p.x - f.x, p.y - f.y, p.z - f.z
    fx, fy, fz = inertial_force(f, p, f.wx + f.ax * p.t, f.wy + f.ay * p.t, f.wz + f.az * p.t)
    return (
        fx - p.m * (f.ay * rz - f.az * ry),
        fy - p.m * (f.az * rx - f.ax * rz),
        fz - p.m * (f.ax * ry - f.ay * rx),
    )


@law(force_dx, ChangingFrameRecord)
def changing_frame_dx(f: ChangingFrameRecord, p: Particle) -> Matrix:
    a = inertial_dx(p.m, f.wx + f.ax * p.t, f.wy + f.ay * p.t, f.wz + f.az * p.t)
    ex, ey, ez = p.m * f.ax, p.m * f.ay, p.m * f.az
    return a[0], a[1] + ez, a[2] - ey, a[3] - ez, a[4], a[5] + ex, a[6] + ey, a[7] - ex, a[8]


@law(force_dv, ChangingFrameRecord)
def changing_frame_dv(f: ChangingFrameRecord, p: Particle) -> Matrix:
    return inertial_dv(p.m, f.wx + f.ax * p.t, f.wy + f.ay * p.t, f.wz + f.az * p.t)
