"""What is seen where: projection, depth order, shadows, coverage, scale, threads."""

from __future__ import annotations

import numpy as np
import pytest

from particlesim.errors import UsageError
from particlesim.render import BallShape, Camera, PlaneShape, render_frame

from .conftest import FLOOR, ArrayFrame, ArraySource, single


def difference(picture, settings):
    """Where the picture differs from the empty background, bool [h, w]."""
    empty = render_frame(single(np.empty((0, 3))), 0, settings)
    return np.abs(picture.astype(int) - empty.astype(int)).max(axis=2) > 24


@pytest.mark.parametrize("position", [(0, 0, 0), (1.5, -1.0, 2.0), (-2.0, 1.2, -4.0)])
def test_sphere_covers_its_projection(plain, position):
    # A pinhole at distance d sees a sphere of radius r as an ellipse; near the axis its area is
    # π (f r)² / (d² − r²) up to 1/cos³ of the angle to the axis, and its centre is at f x / d.
    x, y, z = position
    r, d, f = 0.4, 10 - z, 200.0
    settings = plain(color_by="none")
    seen = difference(render_frame(single([position], radius=[r]), 0, settings), settings)
    rows, columns = np.nonzero(seen)
    cosine = d / np.sqrt(d * d + x * x + y * y)
    area = np.pi * (f * r) ** 2 / (d * d - r * r) / cosine**3
    assert seen.sum() == pytest.approx(area, rel=0.12)
    assert columns.mean() + 0.5 == pytest.approx(80 + f * x / d, abs=0.6)
    assert rows.mean() + 0.5 == pytest.approx(60 - f * y / d, abs=0.6)


@pytest.mark.parametrize("look", ["spheres", "dots"])
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_nearest_wins(plain, look, order):
    positions = np.array([[0, 0, 2.0], [0, 0, -2.0]])[list(order)]
    groups = np.array([0, 1])[list(order)]
    source = single(positions, group=groups)
    source.groups = ("near", "far")
    picture = render_frame(source, 0, plain(look=look, color_by="group", particle_radius=0.5))
    red, _, blue = picture[60, 80].astype(int)
    assert blue > red + 40, "the near sphere (group 0) is blue, the far one orange"


def test_sphere_occludes_by_its_surface_not_its_center(plain):
    # The big sphere's centre is nearer to the camera than the small one's, but the small one sits before its
    # flank.
    source = single([[0, 0, 1.0], [1.05, 0, 0.9]], radius=[1.0, 0.1], group=[0, 1])
    source.groups = ("big", "small")
    picture = render_frame(source, 0, plain(color_by="group")).astype(int)
    column = int(80 + 200 * 1.05 / 9.1)
    assert picture[60, column, 0] > picture[60, column, 2] + 40


@pytest.mark.parametrize("look", ["spheres", "dots"])
def test_a_ball_that_particles_collide_with_covers_its_projection_and_what_is_behind_it(plain, look):
    r, d, f = 1.0, 10.0, 200.0
    settings = plain(color_by="none", look=look, particle_radius=0.3)
    behind, before = (single([[0, 0, z]], radius=[0.3]) for z in (-3.0, 3.0))
    ball = (BallShape((0.0, 0.0, 0.0), r),)
    hidden = render_frame(behind, 0, settings, balls=ball)
    assert difference(hidden, settings).sum() == pytest.approx(
        np.pi * (f * r) ** 2 / (d * d - r * r), rel=0.12
    )
    stone, particle = (
        render_frame(source, 0, settings, balls=ball)[60, 80].astype(int) for source in (behind, before)
    )
    assert abs(stone[0] - stone[2]) < 25, "grey"
    assert particle[2] > particle[0] + 40, "blue"
    without = render_frame(behind, 0, settings.model_copy(update={"ground": False}), balls=ball)
    np.testing.assert_array_equal(without, render_frame(behind, 0, settings))


def test_a_ball_is_cut_off_at_the_ground(plain):
    # From above the floor y = 0: a ball that is all below it is not seen, of one that is half below it the upper half.
    settings = plain(camera=Camera(eye=(0, 3, 10), target=(0, 0, 0), fov=40), shadows=False)
    source = single([[50.0, 50.0, 50.0]], radius=[0.1])
    floor = (PlaneShape((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),)
    empty, sunk, half, whole = (
        render_frame(source, 0, settings, planes=floor, balls=balls).astype(int)
        for balls in ((), *((BallShape((0.0, y, 0.0), 1.0),) for y in (-1.5, 0.0, 1.5)))
    )
    seen = [int((np.abs(picture - empty).max(axis=2) > 8).sum()) for picture in (sunk, half, whole)]
    assert seen[0] == 0
    assert 0.4 * seen[2] < seen[1] < 0.75 * seen[2]


def test_shadow_lies_where_the_light_is_blocked(plain):
    # Light from straight above: the shadow of a sphere at height 1 is right below it.
    camera = Camera(eye=(0, 4, 8), target=(0, 0, 0), fov=40)
    position = np.array([[0.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [2.0, 1.0, 0.0]])
    source = single(position, radius=[0.3, 0.3, 0.3])
    settings = plain(camera=camera, shadows=True, light=(0, 1, 0), size=(320, 240))
    lit = render_frame(source, 0, settings.model_copy(update={"shadows": False}), planes=FLOOR).astype(int)
    dark = render_frame(source, 0, settings, planes=FLOOR).astype(int)
    forward = np.array([0, -4, -8]) / np.hypot(4, 8)
    up = np.array([0, 8, -4]) / np.hypot(4, 8)
    focal = 120 / np.tan(np.radians(20))

    def pixel(p):
        arm = np.asarray(p, float) - [0, 4, 8]
        depth = arm @ forward
        return int(120 - focal * (arm @ up) / depth), int(160 + focal * arm[0] / depth)

    under, beside = pixel((0, 0, 0)), pixel((1.0, 0, 1.2))
    assert dark[under].sum() < 0.75 * lit[under].sum()
    assert dark[beside].sum() > 0.9 * lit[beside].sum()


def test_walls_between_camera_and_room_are_not_drawn(plain):
    walls = tuple(
        PlaneShape(tuple(sign * axis), tuple(-sign * axis)) for axis in np.eye(3) for sign in (1.0, -1.0)
    )
    source = single([[0, 0, 0]], radius=[0.3])
    settings = plain(color_by="none")
    open_air, room = render_frame(source, 0, settings), render_frame(source, 0, settings, planes=walls)
    assert np.array_equal(open_air[60, 80], room[60, 80]), "the particle in the room stays visible"
    assert room[60, 80 + 14].sum() > open_air[60, 80 + 14].sum(), "the back wall is drawn"
    assert np.array_equal(room[60, 2], open_air[60, 2]), "nothing outside the room"


def test_tiny_particle_is_visible_and_round_edges_are_smooth(plain):
    settings = plain(color_by="none")
    tiny = render_frame(single([[0, 0, 0]], radius=[1e-9]), 0, settings)
    assert 1 <= difference(tiny, settings).sum() <= 12
    big = render_frame(single([[0, 0, 0]], radius=[2.0]), 0, settings)
    row = big[60, :80].astype(int).sum(axis=1)
    rise = np.abs(np.diff(row))
    assert rise.max() < 0.9 * (row.max() - row.min()), "an antialiased edge takes more than one step"


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e11])
def test_scale_does_not_matter(scale):
    from particlesim.render import RenderSettings

    settings = RenderSettings(size=(160, 120), color_by="none", legend=False, time_label=False)
    points = np.array([[0, 0, 0], [1, 0.5, 0.2], [-1, 0.8, 0.5], [0.3, 0.9, -1]], float)
    reference = render_frame(single(points, radius=np.full(4, 0.1)), 0, settings)
    scaled = render_frame(single(points * scale, radius=np.full(4, 0.1) * scale), 0, settings)
    assert np.abs(reference.astype(int) - scaled.astype(int)).max() <= 2


def test_far_from_the_origin(plain):
    settings = plain(color_by="none", camera=Camera())
    points = np.array([[0, 0, 0], [1, 0.5, 0.2], [-1, 0.8, 0.5]], float)
    here = render_frame(single(points), 0, settings)
    there = render_frame(single(points + 2.0**24), 0, settings)
    assert np.abs(here.astype(int) - there.astype(int)).max() <= 2


@pytest.mark.parametrize("look", ["spheres", "dots"])
def test_same_bits_for_any_number_of_threads(cloud, plain, look):
    settings = plain(look=look, shadows=True, camera=Camera(), size=(320, 200), trails=True)
    pictures = [render_frame(cloud, 5, settings, planes=FLOOR, threads=k) for k in (1, 2, 3)]
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])


def test_supersampling_agrees_with_plain_sampling(cloud, plain):
    one = render_frame(cloud, 0, plain(camera=Camera()))
    two = render_frame(cloud, 0, plain(camera=Camera(), supersampling=2))
    assert not np.array_equal(one, two)
    assert np.abs(one.astype(float) - two).mean() < 4


def test_trails_show_where_a_particle_was(plain):
    frames = [ArrayFrame(k / 30, np.array([[k / 10 - 2.0, 0.0, 0.0]]), {}) for k in range(41)]
    settings = plain(color_by="none", trails="auto")
    picture = render_frame(ArraySource(frames), 40, settings)
    seen = np.abs(picture[60].astype(int) - picture[30].astype(int)).max(axis=1) > 24
    assert seen[60:118].all(), "from its past to its present place at column 80 + 20 · 2 = 120"
    assert not seen[:35].any()
    without = render_frame(ArraySource(frames), 40, settings.model_copy(update={"trails": False}))
    assert np.abs(without[60, 80].astype(int) - without[30, 80]).max() < 12


@pytest.mark.parametrize("look", ["spheres", "dots"])
def test_nothing_and_nonsense_is_survived(plain, look):
    settings = plain(camera=Camera(), look=look, shadows=True, legend=True)
    assert render_frame(single(np.empty((0, 3))), 0, settings, planes=FLOOR).shape == (120, 160, 3)
    picture = render_frame(single([[np.nan, 0, 0], [np.inf, 1, 1], [0, 0.5, 0]]), 0, settings, planes=FLOOR)
    alone = render_frame(single([[0, 0.5, 0]]), 0, settings, planes=FLOOR)
    assert picture.std() > 0
    assert alone.std() > 0


def test_unrecorded_field_is_named(cloud, plain):
    with pytest.raises(UsageError) as caught:
        render_frame(cloud, 0, plain(color_by="temperature"))
    assert "velocity" in caught.value.hint
    assert "output.fields" in caught.value.hint


def test_unknown_frame(cloud, plain):
    with pytest.raises(UsageError, match="no frame 12"):
        render_frame(cloud, 12, plain())
