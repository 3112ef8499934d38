"""Motions: pinned particles led along a path that is given in time, under any forces.

A path is three expressions of the time t and of the place (x, y, z) where a particle was laid out, or a list of times with
offsets from that place. Between waypoints the offset is a cubic polynomial (Hermite) with a continuous velocity, whose
slopes are Catmull and Rom's for unequal intervals and zero at both ends; or it is a straight line.
Source: E. Catmull, R. Rom, A class of local interpolating splines (1974).
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge
from pydantic import Field, field_validator, model_validator

from particlesim.colliders.moving import SpinRecord
from particlesim.expressions.operations import VARIABLES, Node, Ray, Time, X, Y, Z, slope, value
from particlesim.expressions.parser import ExpressionError, parse, reads
from particlesim.forces.field import Expression, check_constant
from particlesim.groups.selection import Selection
from particlesim.laws.registry import Particle, law, path
from particlesim.model.arrays import Floats
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Number, RadiansPerSecond, Seconds, Vector
from particlesim.model.vectors import unit


class Waypoint(Model):
    """Where to be at a time."""

    time: Annotated[Seconds, Ge(0)]
    """When."""
    offset: Vector[Metres]
    """How far from the place at the start."""


class Spin(Model):
    """A steady turn, right-handed about its axis."""

    axis: Vector[float]
    """Direction of the axis; its length does not matter."""
    rate: RadiansPerSecond
    """How fast."""

    @field_validator("axis")
    @classmethod
    def _has_direction(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        unit(axis)
        return axis

    def record(self) -> SpinRecord:
        """The turn as kernels take it."""
        return SpinRecord(*unit(self.axis), self.rate)


class Motion(Model):
    """Pinned particles of a group, or a collider, led along a path given in time."""

    name: Name | None = None
    """Name for messages and overrides."""
    on: Name | None = None
    """The group."""
    collider: Name | None = None
    """Instead of a group: the name of the collider that moves. Its path is that of its center, the middle of its axis, the
    origin of its file, or the point of a plane. Particles feel the velocity of its surface."""
    spin: Spin | None = None
    """A turn of the collider, about an axis through that place. It may take the place of a path, or come with it."""
    particles: Selection | None = None
    """Which of its particles: a name or several ("left", where the layout has it), indices, or those inside a box, ball or
    shell at the start. They are pinned by this. All that the group pins unless given."""
    path: tuple[Expression, Expression, Expression] | None = None
    """Position in metres, as expressions of t, of the place x, y, z at the start, and the constants."""
    constants: dict[Name, Number] = Field(default_factory=dict)
    """Numbers by name, for use in the path."""
    waypoints: tuple[Waypoint, ...] | None = Field(default=None, min_length=2)
    """Instead of a path: times, in order, and offsets. Before the first and after the last the particles rest."""
    interpolation: Literal["smooth", "linear"] = "smooth"
    """Between waypoints: with a continuous velocity, or at a constant one."""

    @model_validator(mode="after")
    def _one_way(self) -> Motion:
        if (self.on is None) == (self.collider is None):
            raise invalid(
                "leads particles of a group or a collider, one of the two",
                at=None if self.on is None else ("collider",),
                allowed='on = "group", or collider = "name"',
            )
        for name in ("spin",) if self.collider is None else ("particles",):
            if getattr(self, name) is not None:
                whom = "colliders" if self.collider is None else "groups"
                key = "collider" if self.collider is None else "on"
                raise invalid(f"{name} is for {whom}", at=(name,), allowed=f'with {key} = "name"')
        if self.spin is not None and self.path is None and self.waypoints is None:
            if self.constants:
                raise invalid("constants are for a path", at=("constants",))
            return self
        if (self.path is None) == (self.waypoints is None):
            spins = "" if self.collider is None or self.path is not None else "a spin, "
            turn = 'spin = { axis = [0, 0, 1], rate = "30 rpm" }, '
            raise invalid(
                f"needs {spins}a path or waypoints" + ("" if spins else ", one of the two"),
                at=None if self.path is None else ("waypoints",),
                allowed=(turn if spins else "")
                + 'path = ["x + 0.1*sin(t)", "y", "z"], or waypoints = [{ time = 0, offset = [0, 0, 0] }, ...]',
            )
        if self.waypoints is not None and self.constants:
            raise invalid("constants are for a path", at=("constants",), also=[(("waypoints",), "no path")])
        for k, (a, b) in enumerate(pairwise(self.waypoints or ())):
            if b.time <= a.time:
                raise invalid(
                    f"{b.time:g} s is not after {a.time:g} s",
                    at=("waypoints", k + 1, "time"),
                    also=[(("waypoints", k, "time"), "the one before")],
                    allowed=f"a time after {a.time:g} s",
                )
        return self

    @model_validator(mode="after")
    def _parses(self) -> Motion:
        if self.path is not None:
            for name in self.constants:
                check_constant(name)
        for k in range(3 if self.path is not None else 0):
            try:
                node = self._node(k)
            except ExpressionError as error:
                raise invalid(
                    error.message, at=("path", k), hint=error.hint, within=(error.offset, error.length)
                ) from None
            for name, variable in VARIABLES.items():
                if type(variable) not in (X, Y, Z, Time) and reads(node, type(variable)):
                    raise invalid(
                        f"a path cannot depend on {name}",
                        at=("path", k),
                        allowed="t, the place x, y, z at the start, and the constants",
                    )
        return self

    def _node(self, axis: int) -> Node:
        assert self.path is not None
        return parse(self.path[axis], self.constants)

    @property
    def label(self) -> str:
        """What messages call it."""
        return self.name or "motion"

    def describe(self) -> str:
        """What is led and how, in a few words."""
        way = "path" if self.path is not None else f"{len(self.waypoints or ())} waypoints"
        if self.collider is None:
            return way
        ways = [way] if self.path is not None or self.waypoints is not None else []
        ways += [f"{self.spin.rate:g} rad/s"] if self.spin is not None else []
        return f"collider {self.collider}: {' and '.join(ways)}"

    def record(self) -> PathRecord | WaypointsRecord:
        """The path as kernels take it."""
        if self.waypoints is None:
            return PathRecord(*(self._node(k) for k in range(3)))
        time = np.array([point.time for point in self.waypoints])
        offset = np.array([point.offset for point in self.waypoints])
        return WaypointsRecord(time, offset, *_slopes(time, offset, self.interpolation == "smooth"))


def _slopes(time: Floats, offset: Floats, smooth: bool) -> tuple[Floats, Floats]:
    """Velocities at the beginning and at the end of every interval [m/s], shape [intervals, 3]."""
    secant = np.diff(offset, axis=0) / np.diff(time)[:, None]
    if not smooth:
        return secant, secant
    at = np.zeros_like(offset)
    at[1:-1] = (offset[2:] - offset[:-2]) / (time[2:] - time[:-2])[:, None]
    return at[:-1], at[1:]


class PathRecord(NamedTuple):
    """Expressions of the position [m]."""

    x: Any
    y: Any
    z: Any


class WaypointsRecord(NamedTuple):
    """Times [s], shape [n]; offsets [m], shape [n, 3]; velocities at both ends of every interval [m/s], [n − 1, 3]."""

    time: Any
    offset: Any
    leaving: Any
    arriving: Any


@law(path, PathRecord)
def led_by_expressions(f: PathRecord, p: Particle) -> tuple[float, float, float, float, float, float]:
    ray = Ray(p, Particle(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))  # d/dt
    return value(f.x, p), value(f.y, p), value(f.z, p), slope(f.x, ray), slope(f.y, ray), slope(f.z, ray)


@law(path, WaypointsRecord)
def led_by_waypoints(f: WaypointsRecord, p: Particle) -> tuple[float, float, float, float, float, float]:
    last = len(f.time) - 1
    k = 0
    while k < last - 1 and p.t >= f.time[k + 1]:
        k += 1
    h = f.time[k + 1] - f.time[k]
    inside = f.time[0] <= p.t < f.time[last]
    s = min(max((p.t - f.time[k]) / h, 0.0), 1.0)
    a, b = f.offset[k], f.offset[k + 1]
    # Hermite's basis: 1 − 3s² + 2s³, s(1 − s)², 3s² − 2s³, −s²(1 − s), and their derivatives.
    e, g, w = 3 * s * s - 2 * s * s * s, s * (1 - s) * (1 - s) * h, -s * s * (1 - s) * h
    de = 6 * s * (1 - s) / h if inside else 0.0
    dg = (1 - s) * (1 - 3 * s) if inside else 0.0
    dw = s * (3 * s - 2) if inside else 0.0
    u, v = f.leaving[k], f.arriving[k]
    return (
        p.x + a[0] + e * (b[0] - a[0]) + g * u[0] + w * v[0],
        p.y + a[1] + e * (b[1] - a[1]) + g * u[1] + w * v[1],
        p.z + a[2] + e * (b[2] - a[2]) + g * u[2] + w * v[2],
        de * (b[0] - a[0]) + dg * u[0] + dw * v[0],
        de * (b[1] - a[1]) + dg * u[1] + dw * v[1],
        de * (b[2] - a[2]) + dg * u[2] + dw * v[2],
    )
