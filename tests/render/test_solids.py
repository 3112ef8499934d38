"""Surfaces and lines: coverage, depth, normals, creases, shadows, strain, what breaks, threads."""

from __future__ import annotations

import numpy as np
import pytest

import particlesim as ps
from particlesim.errors import UsageError
from particlesim.layouts import Cloth, Jelly
from particlesim.process.threads import Team
from particlesim.render import Camera, RenderSettings, render_frame
from particlesim.render.film import mesh_shapes
from particlesim.render.scene.bodies import Bodies
from particlesim.render.scene.props import Props
from particlesim.render.scene.smooth_normals import is_closed, smooth_fans
from particlesim.sampling.random_streams import Streams
from particlesim.trajectory.topology import Topology

from .conftest import FLOOR, ArrayFrame, ArraySource, single

CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]], float)
SQUARE = np.array([[0, 1, 3], [0, 3, 2]])


def scene(position, *sets, time=0.0, **extra):
    """One frame of particles with a topology."""
    position = np.asarray(position, float)
    fields = {name: extra.pop(name) for name in ("group", "radius") if name in extra}
    frame = ArrayFrame(time, position, fields)
    return ArraySource([frame], topology={each.name: each for each in sets}, **extra)


def springs(pairs, rest, name="link", broke=None):
    pairs, rest = np.array(pairs), np.array(rest, float)
    broke = np.full(len(pairs), np.inf) if broke is None else np.array(broke, float)
    return Topology(name, pairs, rest, broke)


def cover(source, settings):
    """How much of each sample differs from the background, as a share of the largest difference, [h, w]."""
    picture = render_frame(source, 0, settings).astype(float)
    empty = render_frame(single(np.empty((0, 3))), 0, settings)
    change = np.abs(picture - empty).max(axis=2)
    return change / change.max()


@pytest.mark.parametrize("turn", [0.0, 0.2, 0.9])
def test_a_square_covers_its_projection_without_gaps(plain, turn):
    # Focal length 200, distance 10: a square of side 2 is 40 × 40 samples; turned about the line of sight its area stays.
    cos, sin = np.cos(turn), np.sin(turn)
    position = CORNERS @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    seen = cover(
        scene(position, Topology("sheet", triangles=SQUARE), groups=("sheet",)), plain(light=(0, 0, 1))
    )
    assert (seen > 0.7).sum() == pytest.approx(1600, rel=0.02), "0.7 in sRGB is half the light"
    assert seen[60, 80] > 0.9
    y, x = np.mgrid[:120, :160] + 0.5
    across, up = (x - 80) * cos - (y - 60) * sin, (x - 80) * sin + (y - 60) * cos
    inside = np.maximum(np.abs(across), np.abs(up)) < 19
    assert seen[inside].min() > 0.85, "no hole, above all not along the diagonal"
    if turn:
        edge = np.abs(np.maximum(np.abs(across), np.abs(up)) - 20) < 0.6
        assert len(np.unique((8 * seen[edge]).round())) > 4, "edges are smooth"


def test_a_line_is_as_thick_as_it_says_and_never_thinner_than_a_sample(plain):
    position = [[-1, -0.3, 0], [1, 0.4, 0]]
    source = scene(position, springs([[0, 1]], [2.0]))
    thick = (cover(source, plain(line_radius=0.1, light=(0, 0, 1))) > 0.4).sum()
    # A capsule of radius 2 samples and length 20 √(2² + 0.7²).
    assert thick == pytest.approx(4 * 20 * np.hypot(2, 0.7) + 4 * np.pi, rel=0.06)
    thin = cover(source, plain(line_radius=1e-6)) > 0.15
    assert thin[:, 62:98].any(axis=0).all(), "without gaps"


def test_links_go_between_points_of_bodies_and_the_world(plain):
    # From a point 0.5 m to the right of a body that is turned by 90°, which is then above it, to a place of the world.
    s = np.sqrt(0.5)
    turned = {"orientation": np.array([[s, 0, 0, s], [1, 0, 0, 0]])}
    frame = ArrayFrame(1.0, np.array([[-1.0, -0.5, 0], [1, -1, 0]]), turned)
    points = np.array([[[0.5, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0, 0]]])
    link = Topology(
        "link", np.array([[0, -1], [0, 1]]), np.array([1.0, 1]), np.array([np.inf, 0.5]), points=points
    )
    source = ArraySource([frame], topology={"link": link})
    links = Bodies(source, plain()).links
    ends, strain, owner = links.at(frame, Bodies(source, plain()).rows)
    assert ends == pytest.approx(np.array([[[-1, 0, 0], [1, 0, 0]]]), abs=1e-6)  # the other one is broken
    assert (strain.tolist(), owner.tolist()) == ([pytest.approx(1.0)], [0])
    seen = cover(source, plain(line_radius=0.1, light=(0, 0, 1)))
    assert (seen[58:62, 70:90] > 0.2).all()  # across the middle, where no particle is
    assert (seen[:50, 70:90] < 0.1).all()


def test_lines_have_the_radius_and_the_colour_of_their_name(plain):
    # Two lines of length 2 (20 samples a metre): at the top a red one with a radius of 3 samples, below a thin green one.
    position = [[-1, 0.5, 0], [1, 0.5, 0], [-1, -0.5, 0], [1, -0.5, 0]]
    thick, thin = springs([[0, 1]], [2.0], "rod.structural"), springs([[2, 3]], [2.0], "string")
    source = scene(position, thick, thin)
    settings = plain(
        color_by="none",
        colors={"rod": (1, 0, 0), "string": (0, 1, 0)},
        line_radius={"rod": 0.15, "string": 0.05},
        light=(0, 0, 1),
    )
    middle = render_frame(source, 0, settings)[:, 80].astype(int)
    red, green = middle[:, 0] - middle[:, 1] > 60, middle[:, 1] - middle[:, 0] > 60
    assert (red.sum(), green.sum()) == (pytest.approx(6, abs=1), pytest.approx(2, abs=1))
    assert np.flatnonzero(red).max() < 60 < np.flatnonzero(green).min()


def test_groups_have_the_colour_of_their_name(plain):
    group = np.array([0, 1])
    source = scene([[-0.7, 0, 0], [0.7, 0, 0]], group=group, groups=("a", "b"))
    settings = plain(color_by="x", colors={"b": (1, 0, 0)}, particle_radius=0.3)
    row = render_frame(source, 0, settings)[60].astype(int)
    warm = row[:, 0] - row[:, 2] > 60
    assert not warm[:80].any()
    assert warm[90:98].all()


def test_surfaces_are_plain_unless_a_colour_is_asked_for(plain):
    # Speeds that a colour map would show as blue and yellow; "auto" shows cloth, whether its group is recorded or not.
    sheet, speed = Topology("sheet", triangles=SQUARE), np.array([0.0, 1.0, 2.0, 3.0])
    frame = ArrayFrame(0.0, CORNERS, {"velocity": np.stack([speed, 0 * speed, 0 * speed], axis=1)})
    source = ArraySource([frame], topology={"sheet": sheet}, groups=("sheet",))
    facing = {"light": (0, 0, 1), "legend": True}
    cloth = render_frame(source, 0, plain(**facing))[45:75, 65:95].reshape(-1, 3).astype(int)
    assert np.ptp(cloth, axis=0).max() < 40, "one colour, but for the light"
    assert (cloth[:, 0] > cloth[:, 2]).all(), "linen"
    red = plain(**facing, colors={"sheet": (1, 0, 0)})
    cloth = render_frame(source, 0, red)[45:75, 65:95].reshape(-1, 3).astype(int)
    assert (cloth[:, 0] - cloth[:, 2] > 60).all(), "a single group has the colour of its name, too"
    bare = render_frame(source, 0, plain(**facing, title=False))
    assert np.array_equal(bare, render_frame(source, 0, plain(light=(0, 0, 1)))), (
        "nothing to explain in a legend"
    )
    shown = (
        render_frame(source, 0, plain(**facing, color_by="speed"))[45:75, 65:95].reshape(-1, 3).astype(int)
    )
    assert np.ptp(shown, axis=0).max() > 80


def test_opacity_shows_what_is_behind(plain):
    # A red ball half behind a blue sheet: beside it unchanged, behind it between the pictures with and without the sheet.
    position = np.concatenate([CORNERS, [[-1, 0, -1.0]]])
    group, radius = np.array([0, 0, 0, 0, 1]), np.array([np.nan] * 4 + [0.5])
    source = scene(
        position, Topology("sheet", triangles=SQUARE), group=group, radius=radius, groups=("sheet", "ball")
    )
    colors = {"sheet": (0, 0, 1), "ball": (1, 0, 0)}
    look = {"color_by": "none", "colors": colors, "light": (0, 0, 1), "shadows": True}
    clear, half, full = (
        render_frame(source, 0, plain(**look, opacity={"sheet": share})).astype(int) for share in (0, 0.5, 1)
    )
    assert np.array_equal(full, render_frame(source, 0, plain(**look)))
    without = render_frame(source, 0, plain(**look, styles={"sheet": "hidden"}))
    assert clear[56:64, 62:68] == pytest.approx(without[56:64, 62:68], abs=3), "it throws no shadow either"
    assert np.abs(half - (clear + full) / 2)[:, 62:].max() <= 1
    red, blue = half[60, 64, 0], half[60, 64, 2]
    assert red > 60
    assert blue > 60


def test_a_legend_stays_legible_over_what_is_drawn(plain):
    # White dots everywhere: behind the legend they are dim.
    rng = np.random.default_rng(1)
    position = np.concatenate([rng.uniform([-4, -3, -1], [4, 3, 0], (4000, 3)), [[0, 0, 0]]])
    x = np.append(np.full(4000, 1.0), 0.0)
    look = {"color_by": "c", "size": (320, 240), "particle_radius": 0.1}
    with_it, without = (
        render_frame(single(position, c=x), 0, plain(**look, legend=legend)).astype(int)
        for legend in (True, False)
    )
    changed = (with_it != without).any(axis=2)
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    assert np.median(with_it[box].max(axis=2)) < 0.5 * np.median(without[box].max(axis=2))


def test_what_is_near_hides_what_is_far(plain):
    # A line through a sheet: its front half is seen, its far half is not.
    position = np.concatenate([CORNERS, [[-0.5, 0, 2.0], [0.5, 0, -2.0]]])
    group = np.array([0, 0, 0, 0, 1, 1])
    settings = plain(color_by="group", line_radius=0.06)
    sheet, line = Topology("sheet", triangles=SQUARE), springs([[4, 5]], [4.0], "rod")
    picture = render_frame(scene(position, sheet, line, group=group, groups=("sheet", "rods")), 0, settings)
    red = picture[60, :, 0].astype(int) - picture[60, :, 2]
    assert (red[69:78] > 30).all(), "orange before the sheet"
    assert (red[82:90] < 0).all(), "the sheet is blue"


def test_spheres_dots_and_surfaces_hide_each_other(plain):
    position = np.concatenate([CORNERS, [[-0.5, 0, 1.0], [0.5, 0, -1.0]]])
    group = np.array([0, 0, 0, 0, 1, 1])
    for look in ("spheres", "dots"):
        settings = plain(color_by="group", look=look, particle_radius=0.2)
        source = scene(position, Topology("sheet", triangles=SQUARE), group=group, groups=("sheet", "balls"))
        picture = render_frame(source, 0, settings)
        red = picture[60, :, 0].astype(int) - picture[60, :, 2]
        assert red[69] > 30
        assert red[91] < 0


def test_normals_of_a_sphere_of_triangles_point_outwards():
    # Area-weighted normals of a regular grid of latitude and longitude err by the square of its step.
    n = 40
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n), np.linspace(0.3, np.pi - 0.3, n))
    position = np.stack([np.sin(v) * np.cos(u), np.cos(v), -np.sin(v) * np.sin(u)], axis=-1).reshape(-1, 3)
    index = np.arange(2 * n * n).reshape(n, 2 * n)
    a, b, c, d = (x.ravel() for x in (index[1:, :-1], index[1:, 1:], index[:-1, 1:], index[:-1, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    source = scene(position, Topology("ball", triangles=triangles), groups=("ball",))
    bodies = Bodies(source, RenderSettings())
    corner, whole = bodies.surface(source[0])
    with Team(2) as team:
        normal = bodies.normals(position.astype(np.float32), corner, whole, team)
    inner = np.isin(corner, index[1:-1, 1:-1])
    cosine = np.einsum("ij,ij->i", normal[bodies.fans.shade[inner]], position[corner[inner]])
    assert cosine.min() > 1 - (np.pi / n) ** 2


def test_a_cube_keeps_its_edges_and_a_bent_sheet_does_not():
    jelly = Jelly(size=(1, 1, 1), resolution=(3, 3, 3))
    triangles = jelly.triangles()
    corners = jelly.place(Streams(0, "jelly"), 0, 27).position.T[triangles]
    fans = smooth_fans(triangles, corners)
    assert fans.shade.max() + 1 == 6 * 9, "nine normals on each side, none shared between sides"
    assert is_closed(triangles)
    cloth = Cloth(size=(1, 1), resolution=(4, 4))
    sheet = cloth.triangles()
    flat = cloth.place(Streams(0, "cloth"), 0, 16).position.T
    bent = flat + [[0, 0, 1]] * np.abs(flat[:, :1] - 0.5) * 0.3
    assert smooth_fans(sheet, bent[sheet]).shade.max() + 1 == 16
    assert not is_closed(sheet)


def test_a_sheet_shades_the_floor_and_itself(plain):
    camera = Camera(eye=(0, 5, 7), target=(0, 0.4, 0), fov=40)
    level = CORNERS[:, [0, 2, 1]] * [0.8, 1, 0.8]
    position = np.concatenate([level + np.array([0, 0.6, 0]), 0.4 * level + np.array([0, 1.2, 0])])
    both = Topology("sheet", triangles=np.concatenate([SQUARE, SQUARE + 4]))
    settings = plain(camera=camera, shadows=True, light=(0, 1, 0), size=(320, 240))
    source = scene(position, both, groups=("sheet",))
    dark = render_frame(source, 0, settings, planes=FLOOR).astype(int)
    lit = render_frame(source, 0, settings.model_copy(update={"shadows": False}), planes=FLOOR).astype(int)
    forward, up = np.array([0, -4.6, -7]) / np.hypot(4.6, 7), np.array([0, 7, -4.6]) / np.hypot(4.6, 7)
    focal = 120 / np.tan(np.radians(20))

    def ratio(p):
        arm = np.array(p, float) - [0, 5, 7]
        at = int(120 - focal * (arm @ up) / (arm @ forward)), int(160 + focal * arm[0] / (arm @ forward))
        return dark[at].sum() / lit[at].sum()

    assert ratio((0.0, 0, 0.78)) < 0.8, "the floor in the shadow of the larger sheet"
    assert ratio((0.0, 0.6, 0.3)) < 0.8, "the larger sheet in the shadow of the smaller one"
    assert ratio((0.6, 0.6, 0.6)) > 0.93, "but not in its own"
    assert ratio((0.2, 1.2, 0.2)) > 0.93
    assert ratio((1.6, 0, 1.0)) > 0.93


def test_both_sides_of_a_cloth_are_lit(plain):
    # Of two sheets that differ in which side is the front one sees the same.
    settings = plain(light=(0, 0.5, 1))
    front = render_frame(scene(CORNERS, Topology("s", triangles=SQUARE), groups=("s",)), 0, settings)
    back = render_frame(scene(CORNERS, Topology("s", triangles=SQUARE[:, ::-1]), groups=("s",)), 0, settings)
    assert np.abs(front.astype(int) - back).max() <= 1
    behind = plain(light=(0, 0.5, -1))
    glow = render_frame(scene(CORNERS, Topology("s", triangles=SQUARE), groups=("s",)), 0, behind)
    assert glow[60, 80].sum() < front[60, 80].sum()


def test_strain_colours_lines_and_surfaces(plain):
    # Springs stretched to 1.2 and pressed to 0.9 of their rest length; a corner sees √((0.2² + 0.1²)/2).
    position = [[0, 0, 0], [1.2, 0, 0], [0, 0.9, 0]]
    source = scene(position, springs([[0, 1], [0, 2]], [1.0, 1.0]))
    bodies = Bodies(source, RenderSettings())
    assert bodies.strains(source[0]) == pytest.approx([0.2, -0.1])
    assert bodies.strain_at(source[0]) == pytest.approx([np.sqrt(0.025), 0.2, 0.1])
    settings = plain(color_by="strain", colormap="coolwarm", color_range=(-0.2, 0.2), line_radius=0.05)
    picture = render_frame(source, 0, settings).astype(int)
    stretched, pressed = picture[60, 80 + 12], picture[60 - 9, 80]
    assert stretched[0] > stretched[2] + 40, "red"
    assert pressed[2] > pressed[0] + 20, "blue"


def test_strain_needs_springs(plain):
    with pytest.raises(UsageError, match="no springs"):
        render_frame(single(CORNERS), 0, plain(color_by="strain"))


def test_broken_springs_and_torn_triangles_disappear(plain):
    link = springs([[0, 1], [2, 3]], [2.0, 2.0], broke=[1.0, np.inf])
    for time, left in ((0.5, 2), (1.0, 1), (3.0, 1)):
        source = scene(CORNERS, link, time=time)
        assert len(Bodies(source, RenderSettings()).line_ends(source[0])[0]) == left
    edges = springs([[0, 1], [2, 3], [0, 2]], [2.0] * 3, "sheet.structural", broke=[np.inf, np.inf, 1.0])
    sheet = Topology("sheet", triangles=SQUARE)
    for time, left in ((0.5, [True, True]), (1.0, [True, False])):
        source = scene(CORNERS, edges, sheet, time=time, groups=("sheet",))
        assert Bodies(source, RenderSettings()).surface(source[0])[1].tolist() == left
    area = (cover(source, plain(light=(0, 0, 1))) > 0.5).sum()
    assert area == pytest.approx(800, rel=0.04)


def test_particles_may_die_and_change_rows(plain):
    # Particle 1 is gone and the others have other rows: the line 2–3 stays where it is.
    class Frame(ArrayFrame):
        id = np.array([7, 3, 2, 0])

    link = springs([[0, 1], [2, 3]], [2.0, 2.0])
    source = scene(CORNERS, link)
    source.frames.append(Frame(1.0, np.concatenate([[[5.0, 5, 5]], CORNERS[[3, 2, 0]]])))
    ends, strain, _ = Bodies(source, RenderSettings()).line_ends(source[1])
    assert ends.tolist() == [[2, 1]]
    assert strain == pytest.approx([0.0])


def test_ids_that_are_not_there_cost_nothing(plain):
    """A damaged file may name any: a table of that many would be terabytes."""
    link = springs([[0, 1], [2, 2**40], [-5, 3]], [2.0, 2.0, 2.0])
    source = scene(CORNERS, link)
    ends, _, _ = Bodies(source, RenderSettings()).line_ends(source[0])
    assert ends.tolist() == [[0, 1]]
    render_frame(source, 0, plain())


def test_styles_choose_what_is_drawn():
    edges = springs([[0, 1], [1, 3]], [2.0, 2.0], "sheet.structural")
    inner = springs([[0, 3]], [3.0], "sheet.shear")
    sheet = Topology("sheet", triangles=SQUARE)

    def drawn(**styles):
        source = scene(CORNERS, edges, inner, sheet, groups=("sheet",))
        bodies = Bodies(source, RenderSettings(styles=styles))
        hidden = bodies.concealed(source[0], np.zeros(4, bool))
        return len(bodies.triangles), len(bodies.lines.pairs), int((~hidden).sum())

    assert drawn() == (2, 0, 0)
    assert drawn(sheet="lines") == (0, 2, 1), "particle 2 is joined to nothing: a sphere"
    assert drawn(sheet="points") == (0, 0, 4)
    assert drawn(sheet="hidden") == (0, 0, 0)


def test_joints_with_a_size_are_spheres(plain):
    source = scene(CORNERS, springs([[0, 1]], [2.0]), radius=np.array([0.1, 0.0, 0.0, 0.2]))
    bodies = Bodies(source, RenderSettings())
    assert bodies.concealed(source[0], np.array([True, False, False, True])).tolist() == [
        False,
        True,
        False,
        False,
    ]


def test_same_bits_for_any_number_of_threads():
    cloth = Cloth(size=(2, 2), resolution=(90, 90))
    position = cloth.place(Streams(0, "cloth"), 0, 8100).position.T.copy()
    position[:, 2] = 0.3 * np.sin(4 * position[:, 0]) * np.cos(5 * position[:, 1])
    rope = np.stack([np.linspace(0, 2, 30), np.full(30, 1.0), np.linspace(-0.5, 0.5, 30)], axis=1)
    pairs = 8100 + np.stack([np.arange(29), np.arange(1, 30)], axis=1)
    everything = np.concatenate([position, rope, [[1.0, 2.3, 0.4]]])
    source = scene(
        everything,
        Topology("cloth", triangles=cloth.triangles()),
        springs(cloth.edges("structural"), np.full(2 * 90 * 89, 2 / 89), "cloth.structural"),
        springs(pairs, np.full(29, 0.07), "rope"),
        group=np.repeat([0, 1, 2], [8100, 30, 1]),
        groups=("cloth", "rope", "ball"),
        radius=np.repeat([0.0, 0.2], [8130, 1]),
    )
    settings = RenderSettings(size=(320, 200), color_by="strain", trails=False)
    pictures = [render_frame(source, 0, settings, planes=FLOOR, threads=k) for k in (1, 2, 3)]
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])
    assert pictures[0].std() > 10


def test_positions_that_are_no_numbers_leave_holes(plain):
    position = CORNERS.copy()
    position[2, 1] = np.nan
    source = scene(position, Topology("s", triangles=SQUARE), springs([[0, 2]], [2.0]), groups=("s",))
    picture = render_frame(source, 0, plain(shadows=True), planes=FLOOR)
    assert picture[60, 96].sum() > 0


def test_the_surface_of_a_fluid_is_as_large_as_the_scene_and_shows_what_is_below(plain):
    # Two balls of which one is below the surface at y = 0.5: it is seen, dimmed; the other is as it was.
    floating = {"type": "buoyancy", "fluid": "water", "surface": 0.5}
    settings = plain(
        camera=Camera(eye=(0, 10, 0.1), target=(0, 0, 0), fov=30), color_by="none", light=(0, 1, 0)
    )
    source = single([[-1, 0, 0], [1, 1, 0]], radius=[0.4, 0.4])
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 0.1},
            "particles": [{"radius": 0.4, "layout": {"type": "points", "position": [[-1, 0, 0]]}}],
            "forces": [floating],
        }
    )
    (water,) = mesh_shapes(scenario)
    sheet = water.spread(np.array([0.0, 3.0, 1.0]), 2.0)
    assert sheet.corners.min(axis=0) == pytest.approx([-2, 0.5, -1])
    assert sheet.corners.max(axis=0) == pytest.approx([2, 0.5, 3])
    dry, wet = (render_frame(source, 0, settings, meshes=meshes).astype(int) for meshes in ((), (water,)))
    change = np.abs(wet - dry).max(axis=2)
    assert change[60, 100:110].max() < 12  # above the surface, in the middle of its ball
    assert (change[60, 50:60] > 5).all()
    seen = dry[60, 40:70] - dry[5, 5]
    below = wet[60, 40:70] - wet[60, 80]
    assert np.abs(below).max() > 0.25 * np.abs(seen).max()  # and still to be seen


def test_what_reaches_below_all_particles_is_as_bright_there(plain):
    # A slope towards the camera, from above the particles to below them: it had been dark at its lower end.
    turned = {"axis": [1, 0, 0], "angle": 45}
    slope = {"type": "box", "size": [3, 0.1, 3], "orientation": turned}
    scenario = ps.Scenario.model_validate(
        {
            "simulation": {"duration": 1, "dt": 0.1, "integrator": "velocity_verlet"},
            "particles": [{"layout": {"type": "points", "position": [[-2, 0, 0], [2, 0.3, 0]]}}],
            "colliders": [slope],
        }
    )
    settings = plain(shadows=True, color_by="none", particle_radius=0.05)
    source = single([[-2, 0, 0], [2, 0.3, 0]])
    picture = render_frame(source, 0, settings, meshes=mesh_shapes(scenario)).astype(int)
    upper, lower = picture[51, 80], picture[63, 80]
    assert np.abs(upper - lower).max() <= 3


def test_a_solid_without_a_surface_is_not_drawn() -> None:
    """Of a cut that takes off all there is no triangle: pictures had ended with a mistake of psim."""
    cut = {
        "type": "difference",
        "of": [{"type": "box", "size": [1, 1, 1]}, {"type": "box", "size": [1, 2, 2]}],
    }
    rod = {"type": "capsule", "start": [0, 0, 0], "end": [0, 1, 0], "radius": 0.2}
    simulation = {"duration": 1, "dt": 0.1}
    dust = {"layout": {"type": "points", "position": [[0, 3, 0]]}}
    made = {"format": 1, "simulation": simulation, "colliders": [cut, rod], "particles": [dust]}
    scenario = ps.from_table(made)
    empty, solid = mesh_shapes(scenario)
    assert len(empty.triangles) == 0
    assert len(Props((empty, solid), np.zeros(3), 1.0, None).faces) == len(solid.triangles)
