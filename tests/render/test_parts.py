"""Settings, colour maps, camera, timeline, labels, and the kernels one by one."""

from __future__ import annotations

import itertools
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from PIL import ImageFont
from pydantic import ValidationError

from particlesim.errors import UsageError
from particlesim.render import Camera, PlaneShape, RenderSettings
from particlesim.render.kernels import project, raster
from particlesim.render.overlay import format_time, round_ticks, text_mask
from particlesim.render.scene import colormaps
from particlesim.render.scene.camera import FILL, Viewpoint, choose_viewpoint, room_corners
from particlesim.render.scene.coloring import choose_coloring, color_indices, values_of
from particlesim.render.scene.extents import survey
from particlesim.render.scene.lighting import grid_spacing, readable, tone_curve
from particlesim.render.timeline import timeline, video_speed

from .conftest import FLOOR, ArrayFrame, ArraySource, single


@pytest.mark.parametrize(
    "wrong",
    [
        {"size": (641, 480)},
        {"size": (8, 8)},
        {"size": (10000, 480)},
        {"look": "sphere"},
        {"colour": "red"},
        {"color_range": (2, 1)},
        {"color_range": (0, float("nan"))},
        {"light": (0, 0, 0)},
        {"camera": {"eye": (0, 0, 0), "target": (0, 0, 0)}},
        {"camera": {"up": (0, 0, 0)}},
        {"crf": 60},
        {"speed": 0},
        {"supersampling": 3},
        {"background": (0, 0, 2)},
    ],
)
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ValidationError):
        RenderSettings(**wrong)


def test_settings_need_no_compiler():
    code = "import sys, particlesim.render; sys.exit('llvmlite' in sys.modules or 'PIL' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_colormaps_have_the_published_colors():
    # S. van der Walt, N. Smith: viridis from #440154 through #21918c to #fde725.
    viridis = (colormaps.colormap("viridis") * 255).round().astype(int)
    assert viridis[0].tolist() == [0x44, 0x01, 0x54]
    assert viridis[-1].tolist() == [0xFD, 0xE7, 0x25]
    assert np.abs(viridis[128] - [0x21, 0x91, 0x8C]).max() <= 2


@pytest.mark.parametrize("name", colormaps.NAMES)
def test_colormaps_agree_with_matplotlib(name):
    if name in ("blackbody", "steel"):
        pytest.skip("made here; matplotlib has none")
    matplotlib = pytest.importorskip("matplotlib")
    exact = matplotlib.colormaps[name](np.arange(256))[:, :3]
    assert np.abs(colormaps.colormap(name) - exact).max() < 2.0 / 255


@pytest.mark.parametrize("name", ["viridis", "magma", "inferno", "blackbody"])
def test_luminance_rises(name):
    y = colormaps.luminance(colormaps.colormap(name, 64))
    assert (np.diff(y) > 0).all()


def test_blackbody_goes_from_red_to_white():
    colors = colormaps.colormap("blackbody")
    assert colors[20, 0] > 3 * max(colors[20, 2], 1e-3)
    assert colors[-1].min() > 0.9
    # 6500 K, near D65 daylight, is near white: its linear components differ by less than a tenth.
    white = colormaps._planck_rgb(np.array([6500.0]))[0]
    assert white.min() / white.max() > 0.9


def test_readable_part_stands_out():
    magma = colormaps.colormap("magma", 1024)
    assert colormaps.luminance(readable(magma, on_light=False)).min() > 0.04
    assert colormaps.luminance(readable(magma, on_light=True)).max() < 0.73
    turbo = readable(colormaps.colormap("turbo", 1024), on_light=False, shaded=True)
    assert colormaps.luminance(turbo[[0, -1]]).min() > 0.08, "both ends of it are dark"


def test_srgb_round_trip():
    s = np.linspace(0, 1, 101)
    assert np.allclose(colormaps.to_srgb(colormaps.to_linear(s)), s, atol=1e-7)


def test_tone_curve_is_exact_below_the_knee_and_never_falls():
    curve = tone_curve()
    assert (np.diff(curve) >= 0).all()
    index = round(np.sqrt(0.5 / 4) * (len(curve) - 1))
    assert curve[index] == pytest.approx(255 * colormaps.to_srgb(0.5), abs=0.1)
    assert curve[-1] > 254.9


def scene_of(points):
    source = single(points)
    return survey(source, lambda frame: None)


@pytest.mark.parametrize("shape", [(2, 1, 1), (10, 0.001, 10), (8, 5, 0), (0, 7, 0), (1e-7, 1e-7, 1e-7)])
@pytest.mark.parametrize("orbit", [0.0, 30.0])
def test_automatic_camera_shows_all_particles_and_fills_the_frame(shape, orbit):
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 1, (400, 3)) * shape + np.array([5, 0, -3]) * max(shape)
    scene = scene_of(points)
    radius = 0.01 * scene.half_extent
    seen = choose_viewpoint(Camera(orbit=orbit), scene, radius, (), 16 / 9)
    for turn in (0.0, 70.0, 200.0) if orbit else (0.0,):
        view = seen.turned(turn).view(scene.center, scene.half_extent, 1600, 900)
        arm = (points - scene.center) / scene.half_extent - np.array(view.eye)
        x, y, z = np.array(view.axes) @ arm.T
        assert (z > 0).all()
        across, along = np.abs(view.focal * x / z).max() / 800, np.abs(view.focal * y / z).max() / 450
        assert max(across, along) < FILL + 1e-6
        if not orbit:
            assert max(across, along) > 0.7
    assert seen.eye[1] >= points[:, 1].min(), "never below what it looks at"


def test_outliers_do_not_shrink_the_rest():
    points = np.random.default_rng(1).uniform(-1, 1, (5000, 3))
    points[:3] *= 1e4
    assert scene_of(points).half_extent < 2.0


def test_flat_motion_is_seen_face_on():
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3)) * [1, 1, 0]
    seen = choose_viewpoint(Camera(), scene_of(points), 0.01, (), 1.0)
    assert np.allclose(seen.axes()[2], [0, 0, -1])


def test_given_eye_and_target_are_kept():
    camera = Camera(eye=(1, 2, 3), target=(0, 1, 0), fov=60)
    seen = choose_viewpoint(camera, scene_of([[9.0, 9, 9]]), 0.1, (), 1.0)
    assert seen.eye.tolist() == [1, 2, 3]
    assert seen.target.tolist() == [0, 1, 0]


def test_room_corners():
    box = tuple(PlaneShape(tuple(s * a), tuple(-s * a)) for a in np.eye(3) for s in (1.0, -1.0))
    corners = room_corners(box, scene_of([[0.5, 0.5, 0.5], [-0.5, -0.5, -0.5]]))
    assert sorted(map(tuple, corners.round(9).tolist())) == [
        (x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)
    ]
    assert len(room_corners(FLOOR, scene_of([[0.0, 0, 0]]))) == 0
    assert len(room_corners(box[:5], scene_of([[0.0, 0, 0]]))) == 0, "open at one side"


@pytest.mark.parametrize(("half", "spacing"), [(6.0, 1.0), (7.0, 2.0), (0.03, 0.005), (3e11, 5e10), (50, 10)])
def test_grid_spacing_is_round(half, spacing):
    assert grid_spacing(half) == pytest.approx(spacing)


def test_timeline_of_equal_rates_is_one_to_one():
    times = 3.0 + np.arange(100) / 30
    assert timeline(times, RenderSettings()).tolist() == list(range(100))


def test_timeline_holds_and_skips():
    times = np.arange(11) / 10  # 10 per second
    assert timeline(times, RenderSettings(speed=1)).tolist()[:7] == [0, 0, 1, 1, 1, 2, 2]
    assert timeline(times, RenderSettings(speed=6)).tolist() == [0, 2, 4, 6, 8, 10]
    assert len(timeline(times, RenderSettings(speed=0.5))) == 61


def test_automatic_speed():
    assert video_speed(9 / 30, 10, RenderSettings()) == 1
    assert video_speed(9 / 60, 10, RenderSettings()) == 1
    assert video_speed(9 * 86400.0, 10, RenderSettings()) == pytest.approx(86400 * 30)
    assert timeline(np.arange(10) * 86400.0, RenderSettings()).tolist() == list(range(10))
    assert timeline(np.array([2.0]), RenderSettings()).tolist() == [0]


def test_absurd_video_is_refused():
    with pytest.raises(UsageError, match="frames"):
        timeline(np.arange(10.0), RenderSettings(speed=1e-9))


def test_coloring_values():
    source = single([[1, 2, 3], [4, 5, 6]], velocity=[[3, 4, 0], [0, 0, 1]], heat=[np.nan, 2.0])
    frame = source[0]
    speed = choose_coloring(source, "auto")
    assert (speed.name, speed.unit) == ("speed", "m/s")
    assert color_indices(frame, speed, 0, 10, 11).tolist() == [5, 1]
    assert color_indices(frame, choose_coloring(source, "y"), 0, 10, 11).tolist() == [2, 5]
    assert color_indices(frame, choose_coloring(source, "heat"), 0, 1, 11).tolist() == [0, 10]
    assert color_indices(frame, choose_coloring(source, "none"), 0, 1, 11).tolist() == [0, 0]


def test_misspelt_field_is_suggested():
    with pytest.raises(UsageError) as caught:
        choose_coloring(single([[0, 0, 0]], temperature=[1.0]), "temprature")
    assert "Did you mean 'temperature'?" in caught.value.hint


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [(0, 10, ["0", "5", "10"]), (0, 1, ["0.0", "0.5", "1.0"]), (0, 4e-7, None), (1e9, 5e9, None)],
)
def test_ticks_are_round_and_inside(low, high, labels):
    ticks = round_ticks(low, high, 4)
    assert 2 <= len(ticks) <= 9
    assert all(low - 1e-9 * abs(high) <= value <= high * (1 + 1e-9) for value, _ in ticks)
    assert len({text for _, text in ticks}) == len(ticks), "no two ticks read the same"
    if labels:
        assert {label.removesuffix(".0") for label in labels} <= {
            text.removesuffix(".0") for _, text in ticks
        }


def test_times_are_readable():
    assert format_time(1.25) == "1.25 s"
    assert format_time(0) == "0.00 s"
    assert format_time(2e-6) == "2.00 us"
    assert format_time(40 * 86400) == "40.00 d"
    assert format_time(1e-30) == "0.00 fs"


def test_a_film_keeps_one_unit_of_time():
    assert [format_time(t, 12e-3) for t in (0, 3e-3, 12e-3)] == ["0.00 ms", "3.00 ms", "12.00 ms"]
    assert [format_time(t, 9.0) for t in (0, 0.004, 9.0)] == ["0.00 s", "0.00 s", "9.00 s"]
    assert format_time(86_400.0, 730 * 86_400.0) == "1.00 d"
    assert format_time(0.3e-12, 12e-12) == "0.30 ps"


def test_text_sets_superscripts_small_and_high():
    flat, raised = text_mask("m2", 40), text_mask("m²", 40)
    assert raised.shape[1] < flat.shape[1]
    ink = np.nonzero(raised[:, -14:].max(axis=1))[0]
    assert len(ink) > 0
    assert ink.max() < 30


def test_the_font_has_what_numbers_are_written_with():
    font = ImageFont.load_default(24)
    missing = bytes(font.getmask("\u0e01"))
    for low, high in ((3e-3, 3.5e-3), (-2e7, 1e7), (0.0, 1.0)):
        for _, label in round_ticks(low, high, 3):
            assert all(bytes(font.getmask(c)) != missing for c in label if c not in "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def test_bands_hold_every_particle_once_and_in_order():
    box = np.array([[0, 5, 0, 40], [3, 4, 17, 18], [0, -1, 0, -1], [1, 1, 31, 32]], np.int32)
    first, items = project.bin_bands(box, np.array([3, 2, 1, 0], np.int32), 48)
    assert [items[a:b].tolist() for a, b in itertools.pairwise(first)] == [[0], [3, 1, 0], [3, 0]]


def test_far_to_near_is_a_stable_sort():
    sphere = np.zeros((5, 4), np.float32)
    sphere[:, 2] = [1, 3, 2, 3, 1]
    box = np.zeros((5, 4), np.int32)
    assert project.far_to_near(sphere, box).tolist() == [1, 3, 2, 0, 4]


def test_sky_moments_blur_keeps_the_mean_and_the_flat():
    depth = np.full((32, 32), np.inf, np.float32)
    depth[14:18, 14:18] = -1.0  # height 1
    mean, square = np.empty_like(depth), np.empty_like(depth)
    raster.sky_moments(depth, 0.0, 2, mean, square)
    assert mean.sum() == pytest.approx(16.0, rel=1e-5)
    assert square.sum() == pytest.approx(16.0, rel=1e-5)
    assert mean[0, 0] == 0.0
    depth[:] = -0.5
    raster.sky_moments(depth, 0.0, 3, mean, square)
    assert np.allclose(mean, 0.5, atol=1e-6)


def test_values_reach_from_percentile_to_percentile():
    values = np.concatenate([np.linspace(10, 20, 2000), [1e6]])
    frame = ArrayFrame(0.0, np.zeros((2001, 3)), {"heat": values})
    source = ArraySource([frame])
    low, high = survey(source, partial(values_of, coloring=choose_coloring(source, "heat"))).values
    assert low == pytest.approx(10, abs=0.3)
    assert 19.5 < high < 22


def test_positions_that_are_hardly_finite_do_not_spoil_the_picture():
    near = np.random.default_rng(1).normal(size=(50, 3))
    far = np.array([[1e308, 0, 0], [0, -1e308, 0], [0, 0, 1e120]])
    source = single(np.concatenate([near, far]), velocity=np.concatenate([near, 1e200 * np.ones((3, 3))]))
    coloring = choose_coloring(source, "speed")
    scene = survey(source, partial(values_of, coloring=coloring))
    assert (scene.low == near.min(axis=0)).all()
    assert (scene.high == near.max(axis=0)).all()
    assert scene.values[1] < 10
    assert (color_indices(source[0], coloring, *scene.values, 256)[-3:] == 255).all()


@pytest.mark.parametrize(
    ("eye", "up", "right", "upwards"),
    [
        ((0, 5, 0), (0, 1, 0), (1, 0, 0), (0, 0, -1)),
        ((0, -5, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 5), (0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((3, 2, 5), (0, 1, 0), None, None),
    ],
)
def test_cameras_stay_upright(eye, up, right, upwards):
    # From straight above as on a map; else the horizon is level: nothing that is upright leans to a side in the middle.
    axes = Viewpoint(np.array(eye, float), np.zeros(3), np.array(up, float), 40.0).axes()
    if right is None:
        assert axes[0] @ up == pytest.approx(0, abs=1e-15)
        assert axes[1] @ up > 0
    else:
        assert axes[:2] == pytest.approx(np.array([right, upwards]), abs=1e-15)
    assert np.cross(axes[0], axes[2]) == pytest.approx(axes[1])
