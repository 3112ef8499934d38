"""Outputs that exist or cannot be written, inputs that are no trajectories: clear errors, nothing harmed."""

import errno
import os
import shutil

import h5py
import numpy as np
import pytest

from particlesim.errors import InputOutputError, UsageError
from particlesim.trajectory import layout, reader, target, writer
from particlesim.trajectory.checkpoint_file import checkpoint_path
from particlesim.trajectory.describe import describe
from particlesim.trajectory.fields import FIELDS, component, component_names
from particlesim.trajectory.recovery import recover


def test_an_existing_file_is_kept_unless_asked(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])
    before = path.read_bytes()
    with pytest.raises(UsageError, match="exists") as caught:
        synthetic.open_writer(path)
    assert "overwrite=True" in caught.value.hint
    assert path.read_bytes() == before
    synthetic.record(path, [5, 5], overwrite=True)
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [5, 5])
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_the_old_file_survives_when_the_new_one_cannot_be_made(tmp_path, synthetic, monkeypatch):
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(layout, "_create_psim", full)
    with pytest.raises(InputOutputError, match="disk is full"):
        synthetic.open_writer(path, overwrite=True)
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [3])
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_a_reader_of_the_old_file_goes_on_when_it_is_replaced(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [3, 4])
    with reader.open(path) as trajectory:
        synthetic.record(path, [9], overwrite=True)
        synthetic.check(trajectory, [3, 4])


def test_folders_are_made_and_bad_places_refused(tmp_path, synthetic, monkeypatch):
    synthetic.record(tmp_path / "new" / "deeper" / "a.vtkhdf", [1])
    with pytest.raises(UsageError, match="is a folder"):
        synthetic.open_writer(tmp_path / "new", overwrite=True)
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="is not a folder"):
        synthetic.open_writer(tmp_path / "file" / "a.vtkhdf")
    monkeypatch.setattr(target.os, "access", lambda *_: False)  # root may write anywhere
    with pytest.raises(InputOutputError, match="cannot write into"):
        synthetic.open_writer(tmp_path / "b.vtkhdf")


def test_of_two_runs_to_the_same_new_file_one_gets_it(tmp_path, synthetic, monkeypatch):
    """Both have looked, and nothing was there: the look alone must not decide."""
    path = tmp_path / "a.vtkhdf"
    monkeypatch.setattr(writer, "check_target", lambda *_, **__: None)
    monkeypatch.setattr(writer, "refuse_file_in_use", lambda *_: None)
    with synthetic.open_writer(path) as first:
        with pytest.raises(UsageError, match="exists"):
            synthetic.open_writer(path)
        with pytest.raises(UsageError, match="being written"):
            synthetic.open_writer(path, overwrite=True)
        first.append(0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [5])
    with pytest.raises(UsageError, match="exists"):
        synthetic.open_writer(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_two_runs_that_replace_the_same_file(tmp_path, synthetic, monkeypatch):
    """The second comes while the first is between making its file and putting it in its place."""
    path = synthetic.record(tmp_path / "a.vtkhdf", [3])
    inner = []

    def late(temporary, target, put=writer.put_replacing):
        if not inner:
            inner.append(None)
            inner[0] = synthetic.open_writer(path, overwrite=True)
        put(temporary, target)

    monkeypatch.setattr(writer, "put_replacing", late)
    with pytest.raises(UsageError, match="being written"):
        synthetic.open_writer(path, overwrite=True)
    with inner[0] as first:
        first.append(0, 0, synthetic.columns(0, 5), synthetic.ledger(0))
    with reader.open(path) as trajectory:
        synthetic.check(trajectory, [5])


@pytest.mark.skipif(os.name != "posix", reason="links need privileges elsewhere")
def test_links_are_written_through(tmp_path, synthetic):
    """What is at the other end becomes the trajectory: the link stays, and so does its own checkpoint's name."""
    (tmp_path / "store").mkdir()
    real, link = tmp_path / "store" / "blob", tmp_path / "a.vtkhdf"
    link.symlink_to(real)
    stale = checkpoint_path(link)
    for counts in ([3], [4, 5]):
        stale.touch()
        synthetic.record(link, counts, overwrite=real.exists())
        assert link.is_symlink()
        assert not stale.exists()
        with reader.open(real) as trajectory:
            synthetic.check(trajectory, counts)
    with pytest.raises(UsageError, match=r"a\.vtkhdf exists"):
        synthetic.record(link, [6])
    assert [p.name for p in real.parent.iterdir()] == ["blob"]


def test_a_new_file_without_hard_links(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(target.os, "link", refuse)
    for name in ("one", "two"):
        (tmp_path / name).write_text(name)
    target.put_new(tmp_path / "one", tmp_path / "a")
    with pytest.raises(UsageError, match="exists"):
        target.put_new(tmp_path / "two", tmp_path / "a")
    assert (tmp_path / "a").read_text() == "one"


def test_wrong_columns_are_refused(tmp_path, synthetic):
    with pytest.raises(UsageError, match="Did you mean 'velocity'"):
        synthetic.open_writer(tmp_path / "a.vtkhdf", fields=["velocty"])
    with synthetic.open_writer(tmp_path / "a.vtkhdf") as writer:
        good, ledger = synthetic.columns(0, 4), synthetic.ledger(0)
        for wrong in (
            {**good, "velocity": good["velocity"].astype("f8")},
            {**good, "velocity": good["velocity"][:3]},
            {**good, "velocity": np.asfortranarray(good["velocity"])},
            {**good, "mass": good["temperature"]},
            {name: column for name, column in good.items() if name != "group"},
        ):
            with pytest.raises(UsageError):
                writer.append(0, 0, wrong, ledger)
        with pytest.raises(UsageError, match="ledger"):
            writer.append(0, 0, good, {"kinetic": 1.0})
        with pytest.raises(UsageError, match="unknown status"):
            writer.close("done")
    assert writer.frames_written == 0
    with pytest.raises(UsageError, match="is closed"):
        writer.append(0, 0, good, ledger)
    writer.close()


def test_buffers_are_used_again(tmp_path, synthetic):
    with synthetic.open_writer(tmp_path / "a.vtkhdf") as writer:
        addresses = set()
        for k in range(20):
            columns = {name: writer.buffer(name, 100) for name in synthetic.columns(0, 1)}
            addresses.add(columns["position"].ctypes.data)
            for name, values in synthetic.columns(k, 100).items():
                assert columns[name].dtype == values.dtype
                columns[name][:] = values
            writer.append(k / 10, 5 * k, columns, synthetic.ledger(k))
            while writer.frames_written <= k:
                pass
    assert len(addresses) < 5
    with reader.open(writer.path) as trajectory:
        synthetic.check(trajectory, [100] * 20)


def make_bad_files(folder, synthetic):
    """Files and the words with which each must be refused."""
    good = synthetic.record(folder / "good.vtkhdf", [50] * 20)
    size = good.stat().st_size
    yield folder / "godo.vtkhdf", "there is no file"
    yield folder, "is a folder"
    for name, content, words in (
        ("text.vtkhdf", b"hello", "no HDF5 file"),
        ("empty.vtkhdf", b"", "no HDF5 file"),
        ("half.vtkhdf", good.read_bytes()[: size // 2], "truncated"),
        ("short.vtkhdf", good.read_bytes()[: size - 1], "truncated"),
        ("header.vtkhdf", good.read_bytes()[:40], "no HDF5 file"),
        ("flipped.vtkhdf", good.read_bytes()[:30] + b"\xff" + good.read_bytes()[31:], "no HDF5 file"),
        ("zeroed.vtkhdf", good.read_bytes()[:48] + bytes(size - 48), "damaged"),
    ):
        (folder / name).write_bytes(content)
        yield folder / name, words
    for libver in ("earliest", "v110"):
        with h5py.File(folder / f"{libver}.h5", "w", libver=libver) as file:
            file["data"] = np.arange(3)
        yield folder / f"{libver}.h5", "no trajectory of psim"
    newer = shutil.copy(good, folder / "newer.vtkhdf")
    with h5py.File(newer, "r+") as file:
        file["psim"].attrs["format"] = 99
    yield newer, "Install a newer"
    lacking = shutil.copy(good, folder / "lacking.vtkhdf")
    with h5py.File(lacking, "r+") as file:
        del file["psim/frames"]
    yield lacking, "damaged"


@pytest.mark.parametrize("use", [reader.open, recover, describe])
def test_bad_files_are_usage_errors_with_hints(tmp_path, synthetic, use):
    for path, words in make_bad_files(tmp_path, synthetic):
        with pytest.raises(UsageError, match=words) as caught:
            use(path)
        assert caught.value.hint
    with pytest.raises(UsageError, match=r"Did you mean .*good\.vtkhdf"):
        reader.open(tmp_path / "goood.vtkhdf")


def test_a_hole_in_the_data_is_reported_when_it_is_read(tmp_path, synthetic):
    path = synthetic.record(tmp_path / "a.vtkhdf", [500] * 3)
    with h5py.File(path, "r") as file:
        place = file["VTKHDF/Points"].id.get_chunk_info_by_coord((0, 0))
    with path.open("r+b") as file:
        file.seek(place.byte_offset)
        file.write(bytes(place.size))
    with reader.open(path) as trajectory:
        assert len(trajectory[0].velocity) == 500
        with pytest.raises(UsageError, match="damaged"):
            trajectory[0].position  # noqa: B018


def test_short_names_of_components():
    assert component("vy") == ("velocity", 1)
    assert component("age") == ("age", None)
    assert component("w") is None
    names = [name for field in FIELDS for name in component_names(field)]
    assert len(names) == len(set(names))
    assert all(component(name) for name in names)
