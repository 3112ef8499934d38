"""Videos: what players see in them, and what is left when something goes wrong."""

from __future__ import annotations

import gc
import stat
import subprocess
import sys

import numpy as np
import pytest

from particlesim.errors import InputOutputError, UsageError
from particlesim.render import RenderSettings, render_frame, render_video, writers

from .conftest import FLOOR, ArrayFrame, ArraySource, single

SMALL = {"size": (128, 72), "shadows": False}


@pytest.fixture
def settings():
    return RenderSettings(**SMALL)


def test_mp4_is_what_every_player_takes(cloud, settings, tmp_path):
    av = pytest.importorskip("av")
    calls = []
    settings = settings.model_copy(update={"crf": 4, "legend": False})  # halved chroma blurs its narrow bar
    report = render_video(
        cloud,
        tmp_path / "a.mp4",
        settings,
        planes=FLOOR,
        title="Title",
        progress=lambda *a: calls.append(a),
    )
    assert (report.frames, report.path, report.warnings) == (12, tmp_path / "a.mp4", ())
    assert calls == [(k, 12) for k in range(1, 13)]
    with av.open(str(report.path)) as container:
        stream = container.streams.video[0]
        context = stream.codec_context
        assert (context.name, context.pix_fmt, context.width, context.height) == ("h264", "yuv420p", 128, 72)
        assert stream.average_rate == 30
        assert (context.colorspace, context.color_primaries, context.color_trc) == (1, 1, 1), "1 is BT.709"
        assert context.color_range == 1, "limited range"
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
    assert len(pictures) == 12
    expected = render_frame(cloud, 7, settings, planes=FLOOR, title="Title")
    # Chroma is halved, so blocks of 8 × 8 are compared.
    blocks = [p.astype(float).reshape(9, 8, 16, 8, 3).mean(axis=(1, 3)) for p in (pictures[7], expected)]
    assert np.abs(blocks[0] - blocks[1]).max() < 4, "the colours survive"
    data = report.path.read_bytes()
    assert 0 < data.find(b"moov") < data.find(b"mdat"), "players can start before the end has arrived"
    assert list(tmp_path.iterdir()) == [report.path]


def test_webp_and_png(cloud, settings, tmp_path):
    from PIL import Image

    render_video(cloud, tmp_path / "a.webp", settings, frames=slice(0, 4))
    with Image.open(tmp_path / "a.webp") as image:
        assert (image.n_frames, image.size) == (4, (128, 72))
    report = render_video(cloud, tmp_path / "one.png", settings, frames=slice(3, 4))
    with Image.open(report.path) as image:
        assert report.path.name == "one.png"
        assert image.size == (128, 72)
    render_video(cloud, tmp_path / "many.png", settings, frames=slice(0, 3))
    render_video(cloud, tmp_path / "p%03d.png", settings, frames=slice(0, 2))
    names = sorted(path.name for path in tmp_path.glob("*.png"))
    assert names == ["many-0001.png", "many-0002.png", "many-0003.png", "one.png", "p001.png", "p002.png"]


def test_orbit_turns_the_camera(cloud, tmp_path):
    from PIL import Image

    still = ArraySource([ArrayFrame(k / 30, cloud[0].position, cloud[0].values) for k in range(3)])
    turning = RenderSettings(**SMALL, camera={"orbit": 600}, time_label=False)
    render_video(still, tmp_path / "a.png", turning)
    first, last = (np.asarray(Image.open(tmp_path / f"a-000{k}.png")) for k in (1, 3))
    assert np.array_equal(first, render_frame(still, 0, turning))
    assert np.abs(first.astype(int) - last).max() > 50


def test_pictures_do_not_depend_on_threads(cloud, settings, tmp_path):
    for threads in (1, 2, 3):
        render_video(cloud, tmp_path / f"{threads}-%d.png", settings, frames=slice(0, 3), threads=threads)
    for k in (1, 2, 3):
        assert (tmp_path / f"1-{k}.png").read_bytes() == (tmp_path / f"2-{k}.png").read_bytes()
        assert (tmp_path / f"1-{k}.png").read_bytes() == (tmp_path / f"3-{k}.png").read_bytes()


def test_existing_files_are_kept_unless_told(cloud, settings, tmp_path):
    for name in ("a.mp4", "a.webp", "a-0002.png"):
        (tmp_path / name).write_text("precious")
    for name in ("a.mp4", "a.webp", "a.png"):
        with pytest.raises(UsageError, match=" exists"):
            render_video(cloud, tmp_path / name, settings, frames=slice(0, 3))
    assert all(path.read_text() == "precious" for path in tmp_path.iterdir())
    render_video(cloud, tmp_path / "a.mp4", settings, frames=slice(0, 3), overwrite=True)
    assert (tmp_path / "a.mp4").stat().st_size > 500
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("name", ["a.avi", "a", ".", "same-%%.png", "bad-%q.png"])
def test_unusable_places(cloud, settings, tmp_path, name):
    with pytest.raises(UsageError) as caught:
        render_video(cloud, tmp_path / name, settings)
    assert caught.value.hint
    assert not list(tmp_path.iterdir())


def test_no_frame(cloud, settings, tmp_path):
    with pytest.raises(UsageError, match="no frame"):
        render_video(ArraySource([]), tmp_path / "a.mp4", settings)
    with pytest.raises(UsageError, match="no frame"):
        render_video(cloud, tmp_path / "a.mp4", settings, frames=slice(5, 5))


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("name", ["a.mp4", "a.webp", "a.png"])
def test_nothing_is_left_after_an_interrupt(cloud, settings, tmp_path, name, error):
    def stop(done, total):
        if done == 3:
            raise error

    with pytest.raises(error):
        render_video(cloud, tmp_path / name, settings, progress=stop)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in is a shell script")
def test_a_failing_ffmpeg_leaves_nothing(cloud, settings, tmp_path, monkeypatch, capfd):
    fake = tmp_path / "ffmpeg"
    fake.write_text("#!/bin/sh\necho 'Unknown encoder' >&2\nexit 1\n")
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(fake))
    folder = tmp_path / "out"
    folder.mkdir()
    with pytest.raises(InputOutputError, match=r"cannot start ffmpeg: .*Permission denied"):
        render_video(cloud, folder / "a.mp4", settings)
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    with pytest.raises(InputOutputError, match="ffmpeg ended before the video did"):
        render_video(cloud, folder / "a.mp4", settings)
    gc.collect()
    assert capfd.readouterr().err == "Unknown encoder\n", "what ffmpeg says, and nothing else"
    assert not list(folder.iterdir())


LIMITED = """
import resource, sys
from pathlib import Path
import numpy as np
from particlesim.errors import InputOutputError
from particlesim.render import RenderSettings
from particlesim.render.writers import open_writer

def film(out):
    noise = np.random.default_rng(0)
    writer = open_writer(out, RenderSettings(size=(128, 72)), 30, True)
    try:
        for _ in range(30):
            writer.add(noise.integers(0, 255, (72, 128, 3), np.uint8))
        writer.finish()
    except InputOutputError as error:
        writer.discard()
        print(error.message)

out = Path(sys.argv[1])
film(out)
whole = out.stat().st_size
out.unlink()
for limit in (whole // 2, whole - 1):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    film(out)
print(len(list(out.parent.iterdir())))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize("name", ["a.mp4", "a.webp"])
def test_what_does_not_fit_is_told_and_leaves_nothing(tmp_path, name):
    """In the middle, and at the last byte, when ffmpeg has taken every picture and moves the index to the front."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, tmp_path / name], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [f"writing '{tmp_path / name}' failed: File too large"] * 2 + ["0"]


def test_a_video_that_was_cut_off_is_not_whole(cloud, settings, tmp_path):
    path = render_video(cloud, tmp_path / "a.mp4", settings, frames=slice(0, 2)).path
    data, cut = path.read_bytes(), tmp_path / "cut.mp4"
    assert writers.is_whole_mp4(path)
    for end in (0, 1, 8, 24, len(data) // 2, len(data) - 1):
        cut.write_bytes(data[:end])
        assert not writers.is_whole_mp4(cut), end
    cut.write_bytes(data + b"\0")
    assert not writers.is_whole_mp4(cut)


def test_positions_that_are_not_finite_are_reported(settings, tmp_path):
    report = render_video(single([[np.nan, 0, 0], [0, 1, 0]]), tmp_path / "a.png", settings)
    assert any("1 position is not finite" in warning for warning in report.warnings)


@pytest.mark.parametrize("name", ["a.png", "a.webp", "a.mp4"])
def test_folders_are_made_and_links_followed(cloud, settings, tmp_path, name):
    folder = tmp_path / "new" / "folder"
    render_video(cloud, folder / name, settings, frames=slice(0, 1))
    assert [path.name for path in folder.iterdir()] == [name]
    link = tmp_path / name
    link.symlink_to(tmp_path / "blob")
    render_video(cloud, link, settings, frames=slice(0, 1))
    assert link.is_symlink()
    assert (tmp_path / "blob").read_bytes() == (folder / name).read_bytes()


def test_numbers_of_files():
    from pathlib import Path

    assert writers.numbered(Path("a.png"), 1) == [Path("a.png")]
    assert writers.numbered(Path("a.png"), 2) == [Path("a-0001.png"), Path("a-0002.png")]
    assert writers.numbered(Path("f/%02d.png"), 1) == [Path("f/01.png")]


def test_a_chosen_frame_is_the_picture_of_its_video(cloud, settings, tmp_path):
    from PIL import Image

    report = render_video(cloud, tmp_path / "one.png", settings, frames=slice(0, 1))
    with Image.open(report.path) as image:
        assert (np.asarray(image) == render_frame(cloud, 0, settings)).all()


def test_chosen_frames_are_a_picture_each(cloud, settings, tmp_path):
    slow = settings.model_copy(update={"speed": 1e-3 * float(np.ptp(cloud.times))})  # many pictures per frame
    report = render_video(cloud, tmp_path / "x.png", slow, frames=slice(0, 3))
    assert report.frames == 3
    assert report.paths == tuple(tmp_path / f"x-000{k}.png" for k in (1, 2, 3))
    assert sorted(tmp_path.iterdir()) == list(report.paths)


def test_a_foreseen_view_depends_on_no_frame_to_come(cloud):
    """Bounds and the range of the colours are given: the first pictures of a whole recording are those of its beginning."""
    settings = RenderSettings(size=(96, 64), bounds=((0, 0, 0), (3, 3, 3)), color_range=(0, 3), trails=False)
    begun = ArraySource(cloud.frames[:4], most=300)
    cloud.most = 300
    cloud.frames[9].position[:] *= 5
    seen = render_frame(cloud, 2, settings)
    assert np.array_equal(seen, render_frame(begun, 2, settings))
    fitted = settings.model_copy(update={"color_range": "auto"})
    assert not np.array_equal(render_frame(cloud, 2, fitted), seen)
    del begun.most  # an old trajectory: the fullest frame
    assert np.array_equal(seen, render_frame(begun, 2, settings))


def test_bounds_are_a_box():
    for bounds in ([[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [1, -1, 1]]):
        with pytest.raises(ValueError, match="corner"):
            RenderSettings(bounds=bounds)
