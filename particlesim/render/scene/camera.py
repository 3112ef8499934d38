"""Where to look from: the camera of the settings, completed so that the particles fill the frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from particlesim.render.kernels.records import Array, View, axes_of, triple
from particlesim.render.scene.extents import Survey
from particlesim.render.scene.props import extent
from particlesim.render.scene.source import BallShape, MeshShape, PlaneShape
from particlesim.scenario.rendering import Camera

FILL = 0.84
"""Share of the frame's width or height that the particles take."""


@dataclass(frozen=True)
class Viewpoint:
    """Camera position, the point in the picture's middle, the up direction (metres), vertical field of view
    [degrees]."""

    eye: Array
    target: Array
    up: Array
    fov: float

    def turned(self, degrees: float) -> Viewpoint:
        """The camera carried round the target, about the up direction (Rodrigues' rotation)."""
        k = self.up / np.linalg.norm(self.up)
        arm, angle = self.eye - self.target, np.radians(degrees)
        arm = arm * np.cos(angle) + np.cross(k, arm) * np.sin(angle) + k * (k @ arm) * (1 - np.cos(angle))
        return replace(self, eye=self.target + arm)

    def axes(self) -> Array:
        """Unit vectors right, up, forward as rows."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        if np.linalg.norm(right) < 1e-9 * np.linalg.norm(
            self.up
        ):  # looking along `up`: as on a map, x to the right
            along_z = abs(forward[2]) > 0.9
            right = np.cross(forward, [0.0, 1.0, 0.0] if along_z else [0.0, 0.0, -1.0])
            right *= 1.0 if right[0] >= 0 else -1.0
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    def view(self, center: Array, scale: float, width: int, height: int) -> View:
        """The kernels' camera for a picture of width × height samples."""
        focal = 0.5 * height / np.tan(0.5 * np.radians(self.fov))
        eye = (self.eye - center) / scale
        return View(triple(eye), axes_of(self.axes()), float(focal), width, height)


def choose_viewpoint(
    camera: Camera,
    scene: Survey,
    radius: float,
    planes: tuple[PlaneShape, ...],
    aspect: float,
    balls: tuple[BallShape, ...] = (),
    meshes: tuple[MeshShape, ...] = (),
) -> Viewpoint:
    """Complete the camera. `radius`: drawn radius [m]; `aspect`: width over height."""
    up = np.array(camera.up, float)
    stage = among(extent(meshes, 0.0), scene)
    points = np.concatenate([scene.points, room_corners(planes, scene), ball_poles(balls, scene), stage])
    if not len(points):
        points = np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    if camera.eye is not None:
        target = middle if camera.target is None else np.array(camera.target)
        eye = np.array(camera.eye)
        if np.array_equal(eye, target):
            target = target - np.array([0.0, 0.0, scene.half_extent])
        return Viewpoint(eye, target, up, camera.fov)
    direction = _direction(low, high, up, bool(planes))
    if camera.orbit:
        points = _swept(points, middle if camera.target is None else np.array(camera.target), up)
    margin = max(radius, 0.03 * scene.half_extent)
    start = Viewpoint(middle + direction, middle, up, camera.fov)
    if (
        camera.target is not None or camera.orbit
    ):  # an orbit turns about its target, which has to stay on the axis
        target = middle if camera.target is None else np.array(camera.target)
        return _back_off(start, target, points, margin, aspect)
    return _fit(start, points, margin, aspect)


def _direction(low: Array, high: Array, up: Array, planes: bool) -> Array:
    """Unit vector towards the camera: motion in a plane is seen face on, anything else from above at an
    angle."""
    size = high - low
    flat = int(np.argmin(size))
    longest = float(size.max())
    is_flat = longest > 0 and size[flat] < 0.02 * longest and np.sort(size)[1] > 0.02 * longest
    k = up / np.linalg.norm(up)
    side = np.cross(k, [0.0, 0.0, 1.0])
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < 1e-6 else side / np.linalg.norm(side)
    front = np.cross(side, k)
    azimuth, elevation = 32.0, 20.0
    in_line = longest > 0 and np.sort(size)[1] <= 0.02 * longest
    if in_line or (is_flat and abs(k[flat]) < 0.5):
        azimuth, elevation = (
            (90.0 if not in_line and abs(side[flat]) > 0.5 else 0.0),
            (9.0 if planes else 0.0),
        )
        if in_line and int(np.argmax(size)) == 2:
            azimuth = 90.0
    elif is_flat:
        azimuth, elevation = 25.0, 48.0
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.asarray(np.cos(e) * (np.sin(a) * side + np.cos(a) * front) + np.sin(e) * k)


def _swept(points: Array, middle: Array, up: Array) -> Array:
    """The points' cylinder about the axis of an orbit: what any camera on it has to show."""
    k = up / np.linalg.norm(up)
    arm = points - middle
    height = arm @ k
    reach = float(np.linalg.norm(arm - height[:, None] * k, axis=1).max())
    a = np.cross(k, [1.0, 0.0, 0.0] if abs(k[0]) < 0.9 else [0.0, 1.0, 0.0])
    a /= np.linalg.norm(a)
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)[:, None]
    ring = reach * (np.cos(turn) * a + np.sin(turn) * np.cross(k, a))
    return np.concatenate([middle + ring + h * k for h in (height.min(), height.max())])


def _slopes(fov: float, aspect: float) -> tuple[float, float]:
    tan = FILL * np.tan(0.5 * np.radians(fov))
    return float(tan * aspect), float(tan)


def _fit(start: Viewpoint, points: Array, margin: float, aspect: float) -> Viewpoint:
    """The closest camera with this direction that has every sphere inside the frame's share `FILL`.

    In camera axes a camera at (c, −d) with slope k sees x when |x − c| ≤ k (z + d) − m, m = margin √(1 +
    k²). Both sides together: the extremes a = max(x − k z), b = max(−x − k z) give k d = (a + b) / 2 + m, c
    = (a − b) / 2.
    """
    axes = start.axes()
    x, y, z = axes @ (points - start.target).T
    shift, back = [], []
    for across, slope in zip((x, y), _slopes(start.fov, aspect), strict=True):
        a, b = float(np.max(across - slope * z)), float(np.max(-across - slope * z))
        shift.append(0.5 * (a - b))
        back.append((0.5 * (a + b) + margin * np.hypot(1.0, slope)) / slope)
    target = start.target + shift[0] * axes[0] + shift[1] * axes[1]
    return replace(start, eye=target - max(back) * axes[2], target=target)


def _back_off(start: Viewpoint, target: Array, points: Array, margin: float, aspect: float) -> Viewpoint:
    """The closest camera with this direction and `target` in its middle that sees every sphere."""
    axes = start.axes()
    x, y, z = axes @ (points - target).T
    back = 0.0
    for across, slope in zip((x, y), _slopes(start.fov, aspect), strict=True):
        back = max(back, float(np.max(np.abs(across) - slope * z) + margin * np.hypot(1.0, slope)) / slope)
    return replace(start, eye=target - back * axes[2], target=target)


def ball_poles(balls: tuple[BallShape, ...], scene: Survey) -> Array:
    """The ends of the balls along the axes, shape [k, 3], where they are among the particles; none of those far larger."""
    ends = np.concatenate([np.eye(3), -np.eye(3)])
    points = np.concatenate(
        [np.empty((0, 3)), *(np.array(ball.center) + ball.radius * ends for ball in balls)]
    )
    return among(points, scene)


def among(points: Array, scene: Survey) -> Array:
    """Those of some points that lie among the particles, or not far from them, shape [k, 3]."""
    return points[(np.abs(points - scene.center) <= 1.5 * scene.half_extent).all(axis=1)]


def room_corners(planes: tuple[PlaneShape, ...], scene: Survey) -> Array:
    """Corners of the room that the planes enclose around the particles, shape [k, 3]; none when it is open
    or huge.

    A corner is where three planes meet on the legal side of all the others.
    """
    normals = np.array([p.normal for p in planes], float).reshape(-1, 3)
    if len(normals) < 4 or len(normals) > 24:
        return np.empty((0, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", normals, np.array([p.point for p in planes], float) - scene.center)
    corners = []
    for three in combinations(range(len(normals)), 3):
        rows = normals[list(three)]
        if abs(np.linalg.det(rows)) > 1e-6:
            corner = np.linalg.solve(rows, offsets[list(three)])
            if (normals @ corner - offsets > -1e-6 * scene.half_extent).all():
                corners.append(corner)
    found = np.array(corners).reshape(-1, 3)
    closed = len(found) >= 4 and (normals.max(axis=0) > 0).all() and (normals.min(axis=0) < 0).all()
    if not closed or np.abs(found).max() > 4.0 * scene.half_extent:
        return np.empty((0, 3))
    return found + scene.center
