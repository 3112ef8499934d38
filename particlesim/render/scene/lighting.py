"""Light, background, planes' grids and the tone curve."""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.render.kernels.records import Array, Backdrop, Light, Planes, triple
from particlesim.render.scene.camera import Viewpoint
from particlesim.render.scene.colormaps import luminance, to_linear, to_srgb
from particlesim.render.scene.source import PlaneShape
from particlesim.scenario.rendering import RenderSettings


def _f32(values: Any) -> Array:
    return np.ascontiguousarray(values, np.float32)


def choose_light(settings: RenderSettings, viewpoint: Viewpoint) -> Light:
    """A warm key light above the camera's left shoulder, a cool sky, a dim bounce from below."""
    up = viewpoint.up / np.linalg.norm(viewpoint.up)
    if settings.light is not None:
        direction = np.array(settings.light, float)
    else:
        axes = viewpoint.axes()
        level = axes[2] - (axes[2] @ up) * up
        norm = np.linalg.norm(level)
        level = level / norm if norm > 1e-6 else axes[1]
        direction = 1.0 * up - 0.55 * axes[0] - 0.42 * level
    direction = direction / np.linalg.norm(direction)
    return Light(
        triple(direction),
        triple([0.90, 0.86, 0.80]),
        triple([0.36, 0.40, 0.47]),
        triple([0.15, 0.145, 0.14]),
        triple(up),
    )


def choose_theme(settings: RenderSettings) -> Backdrop:
    """Colours of background, ground and grid."""
    if settings.background == "dark":
        return Backdrop(
            triple([0.006, 0.008, 0.013]),
            triple([0.028, 0.034, 0.046]),
            triple([0.052, 0.060, 0.076]),
            triple([0.15, 0.17, 0.21]),
        )
    if settings.background == "light":
        return Backdrop(
            triple([0.80, 0.84, 0.89]),
            triple([0.90, 0.91, 0.92]),
            triple([0.62, 0.63, 0.65]),
            triple([0.36, 0.38, 0.42]),
        )
    base = to_linear(settings.background)
    lift = 0.05 if base.mean() < 0.2 else -0.12
    return Backdrop(
        triple(base * 0.9),
        triple(base),
        triple(np.clip(base + lift, 0.01, 1)),
        triple(np.clip(base + 4 * lift, 0.02, 1)),
    )


def is_light(settings: RenderSettings) -> bool:
    """Whether dark text reads better on this background."""
    if isinstance(settings.background, str):
        return settings.background == "light"
    return float(to_linear(settings.background).mean()) > 0.2


def readable(colors: Array, on_light: bool, count: int = 512, *, shaded: bool = False) -> Array:
    """The stretch of a colour map, resampled to `count` colours, that stands out from the background.

    Ends that would vanish in it are cut off: of each at most a third. `shaded`: for thin lines and for surfaces, which
    have sides that the light does not reach, and need more contrast than spheres and dots.
    """
    y = luminance(colors)
    dim, bright = (0.085, 0.62) if shaded else (0.042, 0.72)
    good = np.flatnonzero(y < bright if on_light else y > dim)
    third = len(colors) // 3
    first, last = min(good[0], third), max(good[-1], len(colors) - 1 - third)
    return np.asarray(colors[np.linspace(first, last, count).round().astype(int)])


def grid_spacing(half_extent: float) -> float:
    """Distance of grid lines: 1, 2 or 5 times a power of ten, about six to the half extent (same unit)."""
    rough = half_extent / 6.0
    power = 10.0 ** np.floor(np.log10(rough))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if rough <= step * power * (1 + 1e-9)))


def grid_planes(shapes: tuple[PlaneShape, ...], center: Array, scale: float) -> Planes:
    """The planes in scene units, their grids through the plane's point nearest to the world's origin axes."""
    normal = np.array([s.normal for s in shapes], float).reshape(-1, 3)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    point = (np.array([s.point for s in shapes], float).reshape(-1, 3) - center) / scale
    height = np.einsum("ij,ij->i", point, normal)
    foot = height[:, None] * normal
    u = np.empty_like(normal)
    for k, n in enumerate(normal):
        side = np.cross([0.0, 0.0, 1.0], n) if abs(n[2]) < 0.8 else np.cross([0.0, 1.0, 0.0], n)
        u[k] = side / np.linalg.norm(side)
    return Planes(
        _f32(foot), _f32(normal), _f32(u), _f32(np.cross(normal, u)), np.zeros(len(normal), np.bool_),
        grid_spacing(scale) / scale,
    )  # fmt: skip


def tone_curve(count: int = 8192) -> Array:
    """Light √(v / 4) → sRGB 0 to 255: straight up to 0.7, then a shoulder that reaches white smoothly."""
    light = 4.0 * np.linspace(0, 1, count) ** 2
    knee = 0.7
    rolled = knee + (1 - knee) * -np.expm1(-(light - knee) / (1 - knee))
    return _f32(255.0 * to_srgb(np.where(light < knee, light, rolled)))
