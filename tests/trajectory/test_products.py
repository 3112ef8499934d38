"""Export, description and plots of a trajectory."""

import csv
import json
import pickle
import sys

import numpy as np
import pytest

import particlesim as ps
from particlesim.analysis import series
from particlesim.analysis.plot import plot
from particlesim.errors import InputOutputError, UsageError
from particlesim.trajectory import export as export_module
from particlesim.trajectory import reader
from particlesim.trajectory.describe import describe
from particlesim.trajectory.export import export

COUNTS = [3, 0, 5000, 7]


@pytest.mark.parametrize(("precision", "floats"), [("single", "f4"), ("double", "f8")])
def test_csv_reads_back_to_the_same_bits(tmp_path, synthetic, precision, floats):
    path = synthetic.record(tmp_path / "a.vtkhdf", COUNTS, precision=precision)
    out = tmp_path / "a.csv"
    assert export(path, out) == sum(COUNTS)
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    expected = ["time", "id", "x", "y", "z", "vx", "vy", "vz", "temperature", "group"]
    assert sorted(rows[0]) == sorted(expected)
    assert list(rows[0])[:5] == expected[:5]
    start = 0
    for k, count in enumerate(COUNTS):
        part, start = rows[start : start + count], start + count
        columns = synthetic.columns(k, count, floats)
        assert {float(row["time"]) for row in part} <= {k / 10}
        assert [int(row["id"]) for row in part] == columns["id"].tolist()
        for axis, name in enumerate(("vx", "vy", "vz")):
            values = np.array([float(row[name]) for row in part]).astype(floats)
            np.testing.assert_array_equal(values, columns["velocity"][:, axis])
        names = ["sparks", "dust, fine"]
        assert [row["group"] for row in part] == [names[g] for g in columns["group"]]


def test_npz_has_every_row(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", COUNTS)
    assert export(path, tmp_path / "a.npz", frames=slice(1, None), fields=["velocity"]) == 5007
    with np.load(tmp_path / "a.npz") as data:
        assert "temperature" not in data
        assert list(data["count"]) == COUNTS[1:]
        assert list(data["time"]) == [0.1, 0.2, 0.3]
        assert list(data["groups"]) == ["sparks", "dust, fine"]
        last = slice(data["offset"][2], data["offset"][2] + data["count"][2])
        np.testing.assert_array_equal(data["velocity"][last], synthetic.columns(3, 7)["velocity"])
        np.testing.assert_array_equal(data["ledger.kinetic"], [10, 20, 30])


def test_exports_that_cannot_be(tmp_path, synthetic, monkeypatch):
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])
    with pytest.raises(UsageError, match="unknown ending"):
        export(path, tmp_path / "a.xyz")
    with pytest.raises(UsageError, match="unknown field"):
        export(path, tmp_path / "a.csv", fields=["mass"])
    (tmp_path / "b.csv").write_text("mine")
    with pytest.raises(UsageError, match="exists"):
        export(path, tmp_path / "b.csv")

    def fail(trajectory, indices, fields, out):
        out.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(export_module.FORMATS, ".csv", fail)
    with pytest.raises(InputOutputError, match="disk is full"):
        export(path, tmp_path / "b.csv", overwrite=True)
    assert (tmp_path / "b.csv").read_text() == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.vtkhdf", "b.csv"]


def test_describe_is_plain_data(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", COUNTS)
    data = json.loads(json.dumps(describe(path), allow_nan=False))
    assert data["frames"] == 4
    assert data["time"] == {"first": 0.0, "last": 0.3}
    assert data["particles"] == {"first": 3, "last": 7, "min": 0, "max": 5000}
    assert data["fields"]["velocity"]["unit"] == "m/s"
    assert data["fields"]["position"]["max"] == [
        9.25,
        3.0,
        -1.0,
    ]  # ids 3 to 9 in frame 3: x = id + 1/4, z = −id/3
    assert data["groups"] == {"sparks": 3, "dust, fine": 4}
    assert data["ledger"]["potential.gravity"] == {
        "unit": "J",
        "first": 1.0,
        "last": 31.0,
        "drift": 30.0,
        "relative_drift": 30.0,
    }
    assert data["status"] == "complete"
    assert data["bytes_per_particle_frame"] == pytest.approx(path.stat().st_size / 5010)
    empty = describe(synthetic.record(tmp_path / "b.vtkhdf", []))
    assert empty["time"] == {"first": None, "last": None}
    assert empty["groups"] == {"sparks": None, "dust, fine": None}


def test_energy_drift_is_relative_to_the_largest_part(tmp_path, synthetic):
    """Kinetic 10 k and potential 10 k + 1 in frame k: E − E₀ = 20 k; the largest is E = 61 at k = 3."""
    with reader.open(synthetic.record(tmp_path / "a.vtkhdf", [1] * 4)) as trajectory:
        drift = series.relative_energy_drift(trajectory)
    np.testing.assert_allclose(drift, 20 * np.arange(4) / 61, rtol=1e-15)


def test_few_particles_are_lines_and_many_are_bands(tmp_path, synthetic):
    few = synthetic.record(tmp_path / "few.vtkhdf", [2, 2, 0, 2])
    with reader.open(few) as trajectory:
        tracks = series.of_particles(trajectory, "vy")
        assert tracks.ids == (0, 1, 2, 3, 4)
        # Particle 1 lives in frames 0 and 1, where y is the frame and vy = 2 y + 1.
        np.testing.assert_array_equal(tracks.values[:, 1], [1, 3, np.nan, np.nan])
        speed = series.of_particles(trajectory, "speed", ids=[1])
        np.testing.assert_allclose(speed.values[0, 0], np.sqrt(3.5**2 + 1 + (1 / 3) ** 2), rtol=1e-6)
        with pytest.raises(UsageError, match="no particle has the id 77"):
            series.of_particles(trajectory, "x", ids=[1, 77])
    many = synthetic.record(tmp_path / "many.vtkhdf", [101, 0, 101])
    with reader.open(many) as trajectory:
        spread = series.of_particles(trajectory, "temperature")
        np.testing.assert_allclose(spread.values[0], [305, 325, 350, 375, 395])
        assert np.isnan(spread.values[1]).all()
        half = series.of_particles(trajectory, "temperature", group="sparks")
        assert half.values[0, 2] == 350


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("quantity", "options"),
    [
        ("energy", {}),
        ("drift", {}),
        ("momentum", {}),
        ("count", {}),
        ("displacement", {"group": "sparks"}),
        ("velocity.x", {"group": "sparks"}),
        ("speed", {}),
        ("y", {"ids": [3]}),
    ],
)
def test_plots_are_images_with_something_on_them(tmp_path, synthetic, quantity, options):
    image = pytest.importorskip("matplotlib.image")
    out = tmp_path / "a.png"
    with reader.open(synthetic.record(tmp_path / "a.vtkhdf", [20] * 4)) as trajectory:
        plot(trajectory, quantity, out, **options)
    pixels = image.imread(out)[..., :3]
    assert pixels.shape[:2] == (720, 1280)
    colored = np.ptp(pixels, axis=2) > 0.1
    assert colored.sum() > 500
    assert "matplotlib.pyplot" not in sys.modules


def test_plots_that_cannot_be(tmp_path, synthetic, monkeypatch):
    path = tmp_path / "a.vtkhdf"
    synthetic.record(path, [2])
    with reader.open(path) as trajectory:
        for quantity, out, options, words in (
            ("temprature", "a.png", {}, "Did you mean 'temperature'"),
            ("angular_momentum", "a.png", {}, "ledger = true"),
            ("energy", "a.png", {"group": "sparks"}, "all particles together"),
            ("rdf", "a.png", {"ids": [0]}, "one of many particles"),
            ("pressure", "a.png", {}, "unknown quantity"),
            ("x", "a.png", {"group": "spark"}, "Did you mean 'sparks'"),
            ("x", "a.bmp", {}, "unknown ending"),
            ("x", "a.vtkhdf", {}, "unknown ending"),
        ):
            with pytest.raises(UsageError, match=words):
                plot(trajectory, quantity, tmp_path / out, **options)
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        with pytest.raises(UsageError, match=r"particlesim\[plot\]"):
            plot(trajectory, "x", tmp_path / "a.png")
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_a_frame_says_what_it_does_not_have():
    table = {"simulation": {"duration": 0.1, "dt": 0.1}}
    table["particles"] = [{"layout": {"type": "points", "position": [[0, 0, 0]]}}]
    frame = ps.run(ps.from_table(table)).final
    assert hasattr(frame, "position")
    assert not hasattr(frame, "state")
    with pytest.raises(ps.UsageError, match="unknown field 'velocty'") as told:
        frame.velocty  # noqa: B018
    again = pickle.loads(pickle.dumps(told.value))
    assert (again.message, again.hint) == (told.value.message, told.value.hint)
