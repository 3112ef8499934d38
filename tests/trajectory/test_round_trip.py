"""What goes into the writer comes out of the reader, bit for bit."""

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from particlesim.errors import UsageError
from particlesim.trajectory import chunks, hdf5, reader
from particlesim.trajectory.writer import TrajectoryWriter

COUNTS = [0, 3, 300, 299, 1, 0, 0, 40]


@pytest.mark.parametrize("compression", ["gzip", "none"])
@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("hint", [1, 10, 300, 100_000])
def test_frames_come_back_whatever_the_chunks(tmp_path, synthetic, compression, precision, hint):
    path = synthetic.record(
        tmp_path / "a.vtkhdf", COUNTS, compression=compression, precision=precision, particles_hint=hint
    )
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, COUNTS, "f8" if precision == "double" else "f4")
        assert trajectory.precision == precision
        assert trajectory.status == "complete"
        assert trajectory.groups == ("sparks", "dust, fine")
        assert trajectory.scenario == 'title = "test"\n'
        assert trajectory.provenance["seed"] == 7
        assert trajectory.provenance["rate"] == 0.5


@settings(
    max_examples=25, deadline=None, database=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    frames=st.lists(
        st.integers(0, 40).flatmap(
            lambda n: hnp.arrays(np.float32, (n, 3), elements=st.floats(width=32, allow_nan=True))
        ),
        max_size=6,
    ),
    compression=st.sampled_from(["gzip", "none"]),
    hint=st.integers(1, 50),
)
def test_any_float_survives(tmp_path, frames, compression, hint):
    path = tmp_path / "a.vtkhdf"
    with TrajectoryWriter(
        path,
        fields=[],
        groups=[],
        ledger=[],
        provenance={},
        compression=compression,
        overwrite=True,
        particles_hint=hint,
    ) as writer:
        for k, position in enumerate(frames):
            writer.append(k, k, {"position": position.copy(), "id": np.arange(len(position))}, {})
    with reader.open(path) as trajectory:
        assert len(trajectory) == len(frames)
        for frame, position in zip(trajectory, frames, strict=True):
            assert frame.position.tobytes() == position.tobytes()


def test_gzip_chunks_are_what_hdf5_would_store(tmp_path):
    """The filters done here, undone by HDF5, for a column of vectors, of scalars, and a filled-up chunk."""
    for dtype, shape in (("<f4", (100, 3)), ("<i8", (100,)), ("<i4", (100,))):
        values = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
        with h5py.File(tmp_path / "a.h5", "w") as file:
            dataset = file.create_dataset(
                "a", (128, *shape[1:]), dtype, chunks=(32, *shape[1:]), compression="gzip", shuffle=True
            )
            for start, block in chunks.cut(values, 32):
                dataset.id.write_direct_chunk((start, *[0] * (len(shape) - 1)), chunks.compress(block))
            np.testing.assert_array_equal(dataset[:100], values)
            assert not dataset[100:].any()


@pytest.mark.parametrize(("particles", "rows"), [(0, 1), (10, 10), (256, 256), (1000, 256), (10**6, 62_500)])
def test_chunk_sizes(particles, rows):
    assert chunks.chunk_rows(particles) == rows
    assert chunks.chunk_rows(10**8) == 1 << 16


def test_small_frames_are_small_and_large_ones_are_not_padded(tmp_path, synthetic):
    """2000 frames of 10 particles: 48 bytes a particle of data, under 1 KB a frame with all bookkeeping."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [10] * 2000, compression="none", particles_hint=10)
    assert path.stat().st_size < 2000 * 1000
    path = synthetic.record(tmp_path / "b.vtkhdf", [50_000] * 4, compression="none", particles_hint=50_000)
    assert path.stat().st_size < 4 * 50_000 * 40 * 1.1 + 200_000


def test_sequence_protocol(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [4, 5, 6])
    with reader.open(path) as trajectory:
        assert trajectory[-1].step == 10
        assert [frame.index for frame in trajectory[1:]] == [1, 2]
        assert [frame.index for frame in trajectory[::-1]] == [2, 1, 0]
        with pytest.raises(IndexError, match="frame 3 of 3"):
            trajectory[3]
        assert trajectory.frame_at(0.14).index == 1
        assert trajectory.frame_at(99).index == 2
        assert "3 frames" in repr(trajectory)
        frame = trajectory[0]
        assert frame.velocity is frame["velocity"]
        assert "temperature" in dir(frame)
        assert "temperature" in frame
        assert "nothing" not in frame
        assert list(frame) == list(frame.fields)
        np.testing.assert_array_equal(frame.of("sparks"), frame.id % 2 == 0)
    with pytest.raises(UsageError, match="closed"):
        trajectory[1].position  # noqa: B018
    assert len(frame.velocity) == 4


def test_mistakes_are_explained(tmp_path, synthetic):
    with reader.open(synthetic.record(tmp_path / "a.vtkhdf", [4])) as trajectory:
        with pytest.raises(UsageError, match="Did you mean 'velocity'") as caught:
            trajectory[0].velocty  # noqa: B018
        assert "temperature" in str(caught.value)
        with pytest.raises(UsageError, match="Did you mean 'sparks'"):
            trajectory[0].of("spark")
        with pytest.raises(UsageError, match="no particle"):
            trajectory.track(99)
    lone = synthetic.record(tmp_path / "b.vtkhdf", [0])
    with TrajectoryWriter(lone, fields=[], groups=["a", "b"], ledger=[], provenance={}, overwrite=True) as w:
        w.append(0, 0, {"position": np.zeros((1, 3), "f4"), "id": np.zeros(1, "i8")}, {})
    with reader.open(lone) as trajectory, pytest.raises(UsageError, match='Record the field "group"'):
        trajectory[0].of("a")


def test_track_follows_one_particle(tmp_path, synthetic):
    """In frame k the ids k ... k+3 exist, each a row further up than before: id 3 lives in frames 0 to 3."""
    with reader.open(synthetic.record(tmp_path / "a.vtkhdf", [4] * 6)) as trajectory:
        track = trajectory.track(3)
    np.testing.assert_array_equal(track["step"], [0, 5, 10, 15])
    np.testing.assert_array_equal(track["id"], [3] * 4)
    np.testing.assert_array_equal(track["position"][:, 1], [0, 1, 2, 3])
    assert track["velocity"].shape == (4, 3)


def test_events_and_summary(tmp_path, synthetic):
    path = tmp_path / "a.vtkhdf"
    with synthetic.open_writer(path, causes=["rate", "age"]) as writer:
        writer.events("birth", [5, 6], [0.01, 0.02], 0)
        writer.append(0, 0, synthetic.columns(0, 2), synthetic.ledger(0))
        writer.events("death", np.array([6]), 0.05, [1])
        writer.append(0.1, 5, synthetic.columns(1, 1), synthetic.ledger(1))
        writer.events("death", [5], 0.15, 1)  # after the last frame: part of none
        writer.close("diverged", {"steps": 5, "reason": "NaN — müde"})
    with reader.open(path) as trajectory:
        births, deaths = trajectory.events("birth"), trajectory.events("death")
        assert trajectory.status == "diverged"
        assert trajectory.summary == {"steps": 5, "reason": "NaN — müde"}
    np.testing.assert_array_equal(births["id"], [5, 6])
    np.testing.assert_array_equal(births["time"], [0.01, 0.02])
    assert list(deaths["id"]) == [6]
    assert list(deaths["cause"]) == ["age"]


def test_a_scenario_may_be_longer_than_an_attribute(tmp_path, synthetic):
    text = "# ünïcode\n" * 50_000
    path = synthetic.record(tmp_path / "a.vtkhdf", [1], provenance={"scenario": text})
    with reader.open(path) as trajectory:
        assert trajectory.scenario == text


def test_an_hdf5_library_that_hides_its_settings_is_written_with(tmp_path, synthetic, monkeypatch):
    """Other builds of h5py may contain HDF5 instead of loading it."""

    class Hidden:
        def __init__(self, name):
            pass

    monkeypatch.setattr(hdf5.ctypes, "CDLL", Hidden)
    hdf5._setter.cache_clear()
    try:
        path = synthetic.record(tmp_path / "a.vtkhdf", [3, 5])
    finally:
        hdf5._setter.cache_clear()
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [3, 5])
