"""Nets, hair, bridges and meshes from files: where their particles are, what joins them, and what is no mesh."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import G, simulate

import particlesim as ps
from particlesim.layouts import LAYOUTS, Bridge, Disc, Hair, Net, Plummer, SurfaceFile
from particlesim.layouts.mesh import is_closed
from particlesim.layouts.mesh_formats import read_surface
from particlesim.sampling.random_streams import Streams


def lengths(layout: Any, kind: str, streams: Any = None) -> Any:
    x = layout.place(streams, 0, layout.number()).position
    i, j = layout.edges(kind).T
    assert len({frozenset(pair) for pair in layout.edges(kind).tolist()}) == len(i), "no spring twice"
    return np.linalg.norm(x[:, i] - x[:, j], axis=0)


def test_a_net_is_made_of_strings() -> None:
    # 3 × 2 openings with 4 links between knots: 4 upright strings of 8 links, 3 level ones of 12; 12 knots.
    net = Net(size=(3.0, 2.0), meshes=(3, 2), segments=4)
    assert net.number() == 12 + 3 * (4 * 2 + 3 * 3)
    structural, bend = lengths(net, "structural"), lengths(net, "bend")
    assert len(structural) == 4 * 8 + 3 * 12
    assert len(bend) == 4 * 7 + 3 * 11
    np.testing.assert_allclose(structural, 0.25)
    np.testing.assert_allclose(bend, 0.5)
    x = net.place(None, 0, net.number()).position  # type: ignore[arg-type]
    parts = [net.place(None, k, 7).position for k in range(0, 21, 7)]  # type: ignore[arg-type]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), x[:, :21])
    np.testing.assert_array_equal(x[:2, net.places()["corners"]].T, [[0, 0], [3, 0], [0, 2], [3, 2]])
    assert (x[1, net.places()["top"]] == 2).all()
    assert len(net.places()["top"]) == 13


def test_hair_grows_out_of_its_surface() -> None:
    hair = Hair(strands=50, count=5, length=0.2, roots={"type": "sphere", "center": [1, 2, 3], "radius": 0.5})
    streams = Streams(7, "hair")
    x = hair.place(streams, 0, 250).position
    away = np.linalg.norm(x - np.array([[1], [2], [3]]), axis=0).reshape(50, 5)
    np.testing.assert_allclose(away, np.tile(0.5 + np.linspace(0, 0.2, 5), (50, 1)), rtol=1e-12)
    np.testing.assert_array_equal(hair.place(streams, 33, 91).position, x[:, 33:124])
    np.testing.assert_allclose(lengths(hair, "structural", streams), 0.05)
    assert len(hair.edges("structural")) == 50 * 4
    assert hair.hinges("angle")[:4].tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4], [5, 6, 7]]
    assert hair.pins().tolist() == list(range(0, 250, 5))
    assert hair.places()["clamped"].tolist()[:4] == [0, 1, 5, 6]


def test_hair_of_varied_lengths_is_the_same_from_any_start() -> None:
    hair = Hair(
        strands=400,
        count=5,
        length=0.2,
        variation=0.5,
        roots={"type": "sphere", "center": [0, 0, 0], "radius": 0.5},
    )
    streams = Streams(7, "hair")
    whole = np.sort(lengths(hair, "structural", streams).reshape(400, 4).sum(axis=1))
    # Evenly spread from half the length to all of it: order statistics of 400 stray by less than 4 × 0.1/√400 / 2.
    np.testing.assert_allclose(whole, np.linspace(0.1, 0.2, 400), atol=0.01)
    x = hair.place(streams, 0, 2000).position
    np.testing.assert_array_equal(hair.place(streams, 33, 91).position, x[:, 33:124])


def test_a_clamped_hair_bends_as_a_chain_of_angles() -> None:
    # A level strand of n links of length l under gravity, its first link clamped: by small angles, the angle at node i
    # carries the moment of all weights beyond it, d_i = Σ_j>i m g l (j − i)/k, and node j hangs Σ_i<j (j − i) l d_i below.
    # What is neglected is of second order: the slope at the tip, here 10⁻².
    n, length, mass, k = 6, 0.3, 6e-4, 0.03
    link, m = length / n, mass / (n + 1)
    final = simulate(
        6.0,
        1e-3,
        "symplectic_euler",
        particles=[
            {
                "name": "hair",
                "layout": {
                    "type": "hair",
                    "strands": 1,
                    "count": n + 1,
                    "length": length,
                    "roots": {"type": "point", "position": [0, 0, 0]},
                    "direction": [1, 0, 0],
                    "pinned": "clamped",
                },
                "mass": mass,
                "springs": {"structural": 40.0, "angle": k},
            }
        ],
        forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": 1.5e-3}],
    ).final
    d = [sum(m * G * link * (j - i) for j in range(i + 1, n + 1)) / k for i in range(n + 1)]
    sag = [sum((j - i) * link * d[i] for i in range(1, j)) for j in range(n + 1)]
    np.testing.assert_allclose(final.position[:, 1], -np.array(sag), atol=0.02 * sag[-1])


@pytest.mark.parametrize("form", ["truss", "suspension"])
def test_a_bridge_stands(form: str) -> None:
    # Every node is joined, each beam once; the particles are mirror images front to back and left to right.
    bridge = Bridge(form=form, length=12.0, width=2.0, height=2.5, bays=6)
    assert bridge.number() == (14 + 10 if form == "truss" else 14 + 14)
    assert lengths(bridge, "structural").min() > 0
    assert len(lengths(bridge, "shear")) == (12 + 8 + 8 if form == "truss" else 12)
    x = bridge.place(None, 0, bridge.number()).position  # type: ignore[arg-type]
    joined = np.concatenate([bridge.edges("structural"), bridge.edges("shear")])
    assert np.unique(joined).tolist() == list(range(bridge.number()))
    for mirror in ((12 - x[0], x[1], x[2]), (x[0], x[1], -x[2])):
        assert {tuple(p) for p in np.round(mirror, 9).T.tolist()} == {
            tuple(p) for p in np.round(x, 9).T.tolist()
        }
    result = simulate(
        0.5,
        5e-4,
        particles=[
            {
                "name": "bridge",
                "layout": {
                    "type": "bridge",
                    "form": form,
                    "length": 12,
                    "width": 2,
                    "height": 2.5,
                    "bays": 6,
                },
                "mass": 240.0,
                "springs": {"structural": 1e6, "shear": 1e6, "damping": 100.0},
            }
        ],
        forces=[{"type": "gravity"}],
    )
    assert np.abs(result.final.position.T - x).max() < 0.05


TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def obj() -> bytes:
    lines = ["# a tetrahedron", *(f"v {x} {y} {z}" for x, y, z in TETRAHEDRON), "vn 0 0 1"]
    return "\n".join([*lines, *(f"f {a + 1}/1/1 {b - 4}//1 {c + 1}" for a, b, c in FACES)]).encode()


def ply(kind: str) -> bytes:
    head = f"ply\nformat {kind} 1.0\ncomment tetrahedron\nelement vertex 4\nproperty double x\nproperty uchar red\n"
    head += "property double y\nproperty double z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
    if kind == "ascii":
        body = "".join(f"{x} 255 {y} {z}\n" for x, y, z in TETRAHEDRON)
        return (head + body + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)).encode()
    order = "<" if "little" in kind else ">"
    packed = b"".join(struct.pack(order + "dBdd", x, 255, y, z) for x, y, z in TETRAHEDRON)
    return head.encode() + packed + b"".join(struct.pack(order + "Biii", 3, *face) for face in FACES)


def stl(text: bool) -> bytes:
    corners = TETRAHEDRON[FACES]
    if text:
        facets = "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {x} {y} {z}\n" for x, y, z in f)
            + "endloop\nendfacet\n"
            for f in corners
        )
        return f"solid t\n{facets}endsolid t\n".encode()
    return (
        bytes(80)
        + struct.pack("<I", 4)
        + b"".join(struct.pack("<12fH", 0, 0, 0, *f.ravel(), 0) for f in corners)
    )


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("t.obj", obj()),
        *(("t.ply", ply(kind)) for kind in ("ascii", "binary_little_endian", "binary_big_endian")),
        ("t.stl", stl(True)),
        ("t.stl", stl(False)),
    ],
    ids=["obj", "ply", "ply-little", "ply-big", "stl", "stl-binary"],
)
def test_every_format_gives_the_same_tetrahedron(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    vertices, triangles = read_surface(tmp_path / name)
    assert len(vertices) == 4
    np.testing.assert_array_equal(vertices[triangles], TETRAHEDRON[FACES])
    assert is_closed(triangles)


HOUSE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]
"""A square with a roof: faces of 3, 4 and 5 corners."""


def test_colours_textures_and_normals_do_not_tear_a_surface(tmp_path: Path) -> None:
    """Two triangles that share an edge, with other textures and normals on both sides: four particles, not six."""
    lines = [
        *(f"v {x} {y} {z}" for x, y, z in HOUSE[:4]),
        "vt 0 0\nvt 1 1\nvn 0 0 1\nvn 1 0 0\nmtllib /etc/passwd",
        "usemtl a\nf 1/1/1 2/1/1 3/1/1\nusemtl b\no other\nf 1/2/2 3/2/2 \\\n4/2/2",
    ]
    (tmp_path / "seam.obj").write_text("\n".join(lines))
    head = "ply\nformat ascii 1.0\ncomment TextureFile /etc/passwd\nelement vertex 4\n"
    head += "".join(f"property float {name}\n" for name in "xyzst") + "element face 2\n"
    head += "property list uchar int vertex_index\nproperty list uchar float texcoord\nend_header\n"
    body = "".join(f"{x} {y} {z} {x} 0\n" for x, y, z in HOUSE[:4])
    (tmp_path / "seam.ply").write_text(head + body + "3 0 1 2 6 0 0 0 0 0 0\n3 0 2 3 6 1 1 1 1 1 1\n")
    for name in ("seam.obj", "seam.ply"):
        vertices, triangles = read_surface(tmp_path / name)
        np.testing.assert_array_equal(vertices, HOUSE[:4])
        assert triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_negative_numbers_count_from_their_line(tmp_path: Path) -> None:
    corners = [f"v {x} {y} {z}" for x, y, z in HOUSE]
    (tmp_path / "a.obj").write_text("\n".join([*corners[:3], "f -3 -2 -1", *corners[3:], "f -2 -3 -1"]))
    assert read_surface(tmp_path / "a.obj")[1].tolist() == [[0, 1, 2], [3, 2, 4]]
    (tmp_path / "b.obj").write_text("\n".join([*corners[:2], "f -3 -2 -1", corners[2]]))
    with pytest.raises(
        ps.UsageError, match="line 3: a face names a vertex that does not exist; there are 2 above it"
    ):
        read_surface(tmp_path / "b.obj")


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_of_different_numbers_of_corners(tmp_path: Path, kind: str) -> None:
    faces = [[0, 1, 2, 4, 3], [0, 2, 1], [0, 3, 2, 1]]
    head = (
        f"ply\nformat {kind} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty double z\n"
    )
    head += "element face 3\nproperty list ushort uint vertex_indices\nproperty uchar red\nelement edge 1\n"
    head += "property int vertex1\nproperty int vertex2\nend_header\n"
    if kind == "ascii":
        rows = [*HOUSE, *([len(face), *face, 9] for face in faces), (0, 1)]
        body = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    else:
        order = "<" if "little" in kind else ">"
        body = b"".join(struct.pack(order + "ffd", *row) for row in HOUSE)
        body += b"".join(struct.pack(f"{order}H{len(face)}IB", len(face), *face, 9) for face in faces)
        body += struct.pack(order + "ii", 0, 1)
    (tmp_path / "house.ply").write_bytes(head.encode() + body)
    vertices, triangles = read_surface(tmp_path / "house.ply")
    np.testing.assert_array_equal(vertices, HOUSE)
    turned = {tuple(np.roll(t, -int(np.argmin(t))).tolist()) for t in triangles}
    assert turned == {(0, 1, 2), (0, 2, 4), (0, 4, 3), (0, 2, 1), (0, 3, 2)}


def test_an_stl_of_several_solids(tmp_path: Path) -> None:
    """The names of solids are any text, the words of the format among it."""
    one, two = (stl(True).replace(b"solid t", b"solid vertex of endsolid %d" % k) for k in (1, 2))
    (tmp_path / "two.stl").write_bytes(one + two.replace(b"vertex 0.0 0.0 0.0", b"VERTEX 0.0 0.0 9.0"))
    vertices, triangles = read_surface(tmp_path / "two.stl")
    assert (len(vertices), len(triangles)) == (5, 8)


def test_a_mesh_brings_the_springs_of_its_edges(tmp_path: Path) -> None:
    (tmp_path / "square.obj").write_text("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 2 3 4 5\n")
    mesh = SurfaceFile(path="square.obj", scale=2.0, origin=(1, 0, 0)).open(tmp_path)
    assert mesh.number() == 4
    assert sorted(lengths(mesh, "structural").tolist()) == pytest.approx([2, 2, 2, 2, 8**0.5])
    assert lengths(mesh, "bend").tolist() == pytest.approx([8**0.5])
    assert mesh.hinges("dihedral").shape == (1, 4)
    assert mesh.place(None, 0, 4).position[0].min() == 1  # type: ignore[arg-type]


def body(path: Path, **springs: Any) -> dict[str, Any]:
    return {
        "name": "body",
        "layout": {"type": "mesh", "path": str(path)},
        "springs": {"structural": 9.0, **springs},
    }


def test_a_tetrahedron_falls_with_the_mass_of_the_whole(tmp_path: Path) -> None:
    (tmp_path / "t.ply").write_bytes(ply("ascii"))
    result = simulate(
        0.1,
        0.01,
        particles=[{**body(tmp_path / "t.ply", dihedral=0.1), "mass": 2.0}],
        forces=[{"type": "gravity"}],
        output={"ledger": True},
    )
    assert result.ledger["momentum.y"][-1] == pytest.approx(-2 * G * 0.1, rel=1e-12)
    assert result.ledger["potential.body.dihedral"][-1] == pytest.approx(0, abs=1e-25)


THREE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n"


def test_edges_of_three_triangles_are_refused_only_where_triangles_count(tmp_path: Path) -> None:
    path = tmp_path / "fin.obj"
    path.write_text(THREE)
    simulate(0.1, 0.05, particles=[body(path)])
    for springs, forces in (
        ({"dihedral": 1.0}, []),
        ({}, [{"type": "sheet_drag", "fluid": "air"}]),
        ({"bend": 1.0}, []),
    ):
        with pytest.raises(ps.UsageError, match="2 triangles run along the edge between particles 0 and 1"):
            simulate(0.1, 0.05, particles=[body(path, **springs)], forces=forces)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.obj", b"v 0 0\n", "line 1 is neither a vertex"),
        ("a.obj", b"v 0 0 0\nf 1 1\n", "line 2 is neither a vertex nor a face"),
        ("a.obj", b"v 0 0 0\n", "no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 3\n", "no triangle with three different corners"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 3\n", "names a vertex that does not exist"),
        ("a.obj", b"v 0 0 0\nv 1 0 nan\nv 1 1 1\nf 1 2 3\n", "not finite"),
        ("a.obj", b"v 0 0 0\nf 1 2 \\\n" + b"3 \\\n" * 100_000, "does not exist"),
        ("a.obj", b"v 0 0 0" + b" " * (1 << 20), "a line of more than"),
        ("a.ply", b"plx", "no PLY header"),
        ("a.ply", ply("ascii")[:-9], "ends too early"),
        ("a.ply", ply("binary_little_endian")[:-9], "ends too early"),
        ("a.ply", ply("binary_little_endian").replace(b"vertex 4", b"vertex 9999999"), "do not fit"),
        ("a.ply", ply("ascii").replace(b"double y", b"quad y"), "unknown property"),
        ("a.ply", ply("ascii").replace(b"double y", b"double w"), "without x, y and z"),
        ("a.stl", b"hello", "no STL"),
        ("a.stl", stl(False)[:-1], "no STL"),
        ("a.stl", stl(True).replace(b"vertex", b"vortex", 1), "no triangles"),
        ("a.stl", stl(True)[:-11], "without endsolid"),
        (
            "a.stl",
            stl(True).replace(b"vertex 0.0 0.0", b"vertex 0.0", 1),
            "line 4: a vertex has three coordinates",
        ),
        ("a.ply", ply("ascii").replace(b"property double x", b"property"), "line 5: unknown property ''"),
        (
            "a.ply",
            ply("ascii").replace(b"property double x", b"property list uchar"),
            "unknown property 'list uchar'",
        ),
        ("a.ply", ply("ascii").replace(b"double x", b"list uchar int x"), "without x, y and z"),
        ("a.ply", ply("ascii").replace(b"list uchar int", b"int"), "faces without vertex_indices"),
        (
            "a.ply",
            ply("ascii").replace(b"3 0 2 1", b"4 0 2 1"),
            "number 0 of 'face' is not as the header says",
        ),
        ("a.ply", ply("ascii").replace(b"0.0 255", b"0,0 255", 1), "trimesh cannot read it"),
        (
            "a.ply",
            ply("binary_big_endian").replace(b"\x03\0\0\0\0", b"\xff\0\0\0\0", 1),
            "longer than the file",
        ),
        ("a.ply", b"ply\nformat ascii 1.0\n" + b"element a 0\n" * 60_000, "its end is missing"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement a 999999999\nend_header\n", "has no properties"),
        ("a.gltf", b"", "unknown ending '.gltf'"),
        ("none.obj", None, "does not exist"),
    ],
)
def test_files_that_are_no_mesh(tmp_path: Path, name: str, data: bytes | None, message: str) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(ps.UsageError, match=message):
        SurfaceFile(path=name).open(tmp_path)


@pytest.mark.parametrize(
    ("layout", "message"),
    [
        ({"type": "net", "size": [1, 1], "meshes": [0, 3]}, "meshes.0: must be at least 1"),
        ({"type": "net", "size": [1, 0], "meshes": [2, 3]}, "size.1"),
        (
            {"type": "hair", "strands": 3, "count": 1, "length": 1, "roots": {"type": "sphere", "radius": 1}},
            "count",
        ),
        (
            {"type": "hair", "strands": 3, "count": 4, "length": 1, "roots": {"type": "disc", "radius": 1}},
            "outside",
        ),
        ({"type": "bridge", "length": 9, "width": 1, "height": 2, "bays": 1}, "bays"),
        ({"type": "bridge", "length": 9, "width": 1, "height": 2, "bays": 4, "sag": 1}, "does not sag"),
        (
            {
                "type": "bridge",
                "form": "suspension",
                "length": 9,
                "width": 1,
                "height": 2,
                "bays": 4,
                "sag": 3,
            },
            "below the deck",
        ),
        (
            {"type": "bridge", "length": 9, "width": 1, "height": 2, "bays": 4, "pinned": "towers"},
            "no towers",
        ),
        ({"type": "cloth", "size": [1, 1], "resolution": [1, 5]}, "resolution.0: must be at least 2"),
    ],
)
def test_layouts_that_cannot_be(layout: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.05, particles=[{"layout": layout}])


def test_kinds_of_springs_that_a_layout_does_not_bring() -> None:
    net = {"type": "net", "size": [1, 1], "meshes": [2, 2]}
    for kind, words in (("dihedral", "has no dihedrals"), ("shear", "has no shear springs")):
        with pytest.raises(ps.UsageError, match=words):
            simulate(0.1, 0.05, particles=[{"layout": net, "springs": {"structural": 1.0, kind: 1.0}}])


def test_every_layout_says_what_it_is() -> None:
    for layout in LAYOUTS:
        assert layout.__doc__
        assert layout.has_surface() <= layout.is_body


def test_a_plummer_sphere_is_in_equilibrium() -> None:
    # Half of an endless sphere is within 1.305 a; E_kin = 3 pi/64 G M^2/a, by the virial theorem; isotropic.
    sphere = Plummer(
        count=40_000, mass=2.0, radius=0.5, extent=300, constant=3.0, center=(1, 2, 3), velocity=(4, 0, 0)
    )
    streams = Streams(1, "sphere")
    x, v, attributes = sphere.place(streams, 0, 40_000)
    np.testing.assert_array_equal(sphere.place(streams, 777, 1000).velocity, v[:, 777:1777])
    assert attributes["mass"].sum() == pytest.approx(2)
    r = np.linalg.norm(x - np.array([[1], [2], [3]]), axis=0)
    assert np.median(r) == pytest.approx(0.5 / np.sqrt(2 ** (2 / 3) - 1), rel=0.02)
    own = v - np.array([[4], [0], [0]])
    assert 0.5 * 2.0 * (own**2).sum(0).mean() == pytest.approx(3 * np.pi / 64 * 3 * 2**2 / 0.5, rel=0.02)
    np.testing.assert_allclose((own**2).mean(1), (own**2).mean(), rtol=0.05)
    escape = np.sqrt(2 * 3 * 2) / (r**2 + 0.25) ** 0.25
    assert (np.linalg.norm(own, axis=0) < escape).all()


def test_a_disc_turns_about_its_axis_on_circles() -> None:
    disc = Disc(
        count=20_000,
        mass=0.5,
        radius=0.3,
        halo_mass=4.0,
        halo_radius=0.8,
        dispersion=0,
        axis=(1, 2, 2),
        constant=1.5,
    )
    x, v, _ = disc.place(Streams(2, "disc"), 0, 20_000)
    axis = np.array([1, 2, 2]) / 3
    assert np.abs(axis @ x).max() < 1e-12
    r = np.linalg.norm(x, axis=0)
    assert r.max() <= 5 * 0.3
    # half of exp(-x) x dx up to 5: (1 + x) exp(-x) = 0.5202
    assert np.median(r) == pytest.approx(0.3 * 1.6209, rel=0.02)
    np.testing.assert_allclose(
        np.cross(x.T, v.T), (r * np.linalg.norm(v, axis=0))[:, None] * axis, atol=1e-12
    )
    pull = 1.5 * 4 * r / (r * r + 0.64) ** 1.5  # of the halo, and what is left is of the disc
    of_disc = (np.linalg.norm(v, axis=0) ** 2 / r - pull) * r * r / 1.5
    edge = r > 0.95 * 1.5
    np.testing.assert_allclose(of_disc[edge], 0.5, rtol=0.01)
    with pytest.raises(ValueError, match="halo_radius"):
        Disc(count=1, mass=1.0, radius=1.0, halo_mass=1.0)
