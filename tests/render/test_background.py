"""The background of a picture: gradient, planes with their grid, shadows, and the darkening below things."""

from __future__ import annotations

import numpy as np
import pytest

from particlesim.render import PlaneShape, RenderSettings
from particlesim.render.kernels import raster
from particlesim.render.kernels.background import paint_background
from particlesim.render.kernels.records import BLOCK, ShadowMap, SkyMap, axes_of
from particlesim.render.kernels.shade import TILE, light_at
from particlesim.render.scene.camera import Viewpoint
from particlesim.render.scene.lighting import choose_light, choose_theme, grid_planes

AXES = axes_of(np.eye(3))


def depths(size: int, discs: int, seed: int = 0) -> np.ndarray:
    """A map with some discs at depths between 0 and 1, and nothing elsewhere."""
    random = np.random.default_rng(seed)
    depth = np.full((size, size), np.inf, np.float32)
    y, x = np.mgrid[:size, :size]
    for u, v, r, d in random.uniform((0, 0, 1, 0), (size, size, size / 12, 1), (discs, 4)):
        inside = (x - u) ** 2 + (y - v) ** 2 < r * r
        depth[inside] = np.minimum(depth[inside], d)
    return depth


@pytest.mark.parametrize("size", [16, 40, 67])
def test_the_least_depth_around_a_block(size: int) -> None:
    depth = depths(size, 9)
    least = raster.least_around(depth)
    for j, i in np.ndindex(least.shape):
        rows, columns = (slice(max(k * BLOCK - 1, 0), (k + 1) * BLOCK + 2) for k in (j, i))
        assert least[j, i] == depth[rows, columns].min()


def test_one_test_for_many_gives_the_light_of_all_tests() -> None:
    # A point is tested against 4 × 4 texels, unless nothing near its block can be over it.
    depth = depths(67, 12)
    looked = ShadowMap(depth, raster.least_around(depth), AXES, 1.0)
    always = looked._replace(least=np.full_like(looked.least, -np.inf))
    random = np.random.default_rng(1)
    shares = []
    for u, v, deep in random.uniform((1, 1, 0), (63.999, 63.999, 1.2), (4000, 3)):
        shares.append(light_at(looked, u, v, deep))
        assert shares[-1] == pytest.approx(light_at(always, u, v, deep), abs=1e-12)
    assert min(shares) == 0
    assert sum(0.01 < share < 0.99 for share in shares) > 100
    assert sum(share == 1.0 for share in shares) > 1000


def scene(width: int, height: int) -> tuple:
    """The corner of a room: a floor and a wall that face the camera and one that does not, under a map with discs."""
    shapes = (
        PlaneShape((0, -0.5, 0), (0, 1, 0)),
        PlaneShape((-0.8, 0, 0), (1, 0, 0)),
        PlaneShape((0, 0, 1.2), (0, 0, -1)),
    )
    viewpoint = Viewpoint(np.array([1.0, 0.8, 2.5]), np.zeros(3), np.array([0.0, 1, 0]), 50.0)
    view = viewpoint.view(np.zeros(3), 1.0, width, height)
    planes = grid_planes(shapes, np.zeros(3), 1.0)._replace(facing=np.array([True, True, False]))
    settings = RenderSettings()
    depth, down = depths(64, 12), axes_of([[1, 0, 0], [0, 0, -1], [0, -1, 0]])
    shadow = ShadowMap(depth, raster.least_around(depth), down, 20.0)
    mean = np.where(np.isfinite(depths(64, 6, 3)), 0.4, 0.0).astype(np.float32)
    sky = SkyMap(mean, 0.5 * mean, down, 20.0, -0.5, 0.2)
    return view, planes, choose_light(settings, viewpoint), choose_theme(settings), shadow, sky


def painted(paint, width: int, height: int, **changes) -> np.ndarray:
    view, planes, *rest = scene(width, height)
    image = np.full((height, width, 3), np.nan, np.float32)
    paint(0, view, planes._replace(**changes), *rest, image)
    return image


def test_vectors_paint_what_plain_python_paints() -> None:
    # A tile and a part of one; all of rounding is in the last place of light that is about 0.1.
    width, height = TILE + 21, 8
    with np.errstate(all="ignore"):  # what planes that are not met would look like
        one, other = (painted(paint, width, height) for paint in (paint_background, paint_background.python))
    assert np.isfinite(one).all()
    assert one == pytest.approx(other, abs=1e-6)


def test_every_part_is_there() -> None:
    def rows(**changes) -> np.ndarray:
        view, planes, light, theme, shadow, sky = scene(300, 160)
        parts = {"light": light, "shadow": shadow, "sky": sky, "planes": planes, **changes}
        image = np.empty((160, 300, 3), np.float32)
        for row in range(0, 160, 16):
            paint_background(
                row,
                view,
                parts["planes"],
                parts["light"],
                theme,
                parts["shadow"],
                parts["sky"],
                image[row : row + 16],
            )
        return image

    _, planes, _, _, shadow, sky = scene(300, 160)
    flat = np.full((1, 1), np.inf, np.float32)
    whole = rows()
    none = rows(planes=planes._replace(facing=np.zeros(3, bool)))
    seen = (whole != none).any(axis=2)
    assert 0.4 < seen.mean() < 1
    bare = rows(shadow=shadow._replace(depth=flat, least=flat))
    assert (bare >= whole - 1e-6).all()
    assert (bare > whole + 0.01).any(axis=2).mean() > 0.02
    open_ = rows(sky=sky._replace(mean=flat, square=flat))
    assert (open_ >= whole - 1e-6).all()
    assert (open_ > whole + 0.001).any(axis=2).mean() > 0.005
    uncut = rows(planes=planes._replace(point=planes.point * np.array([[1], [1], [1e3]], np.float32)))
    assert (uncut != whole).any(axis=2)[~seen].any(), "a plane that is not drawn cuts the others off"
