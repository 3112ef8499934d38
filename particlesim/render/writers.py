"""Files that pictures go into, all by imageio: MP4 (ffmpeg), animated WebP and numbered PNG files (Pillow).

A writer makes its file under a temporary name in the same folder and renames it when it is complete; after an error or an
interrupt nothing is left. Raises UsageError before anything is written when the path cannot be used, InputOutputError when
writing fails later.
"""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import os
import struct
import traceback
from collections import deque
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from particlesim.errors import InputOutputError, OutputExistsError, UsageError
from particlesim.scenario.rendering import RenderSettings
from particlesim.trajectory.target import check_target, followed, temporary_name

Picture = npt.NDArray[np.uint8]
SUFFIXES = (".mp4", ".webp", ".png")
_PROBE = 1 << 20
"""Bytes that a disk which was full to ffmpeg will not take either."""


class Writer(Protocol):
    """`add` every picture, then `finish`; or `discard` at any moment."""

    def add(self, picture: Picture) -> None:
        """Take the next picture."""

    def finish(self) -> tuple[Path, ...]:
        """Complete what is written, and return the files."""

    def discard(self) -> None:
        """Leave nothing behind."""


def open_writer(out: Path, settings: RenderSettings, frames: int, overwrite: bool) -> Writer:
    """The writer for the ending of `out`. For several PNG frames `out` may hold a number pattern such as
    %04d."""
    kind = out.suffix.lower()
    if kind not in SUFFIXES:
        raise UsageError(
            f"cannot write a video to '{out.name}': the ending '{out.suffix}' is unknown",
            "Use .mp4 (video), .webp (small animation) or .png (single frames).",
        )
    if kind == ".png":
        return PngWriter(numbered(out, frames), overwrite)
    check_target(out, overwrite=overwrite)
    return Mp4Writer(out, settings) if kind == ".mp4" else WebpWriter(out, settings)


def numbered(out: Path, frames: int) -> list[Path]:
    """File names of `frames` PNG pictures: out.png for one, out-0001.png ... for several, or the given
    pattern."""
    if "%" in out.name:
        try:
            names = [out.name % (k + 1) for k in range(frames)]
        except (TypeError, ValueError) as error:
            raise UsageError(
                f"'{out.name}' is not a pattern for file numbers",
                "Use one such as 'frame-%04d.png', or a plain name.",
            ) from error
        if len(set(names)) != len(names):
            raise UsageError(
                f"'{out.name}' gives the same name to several frames", "Use one such as 'frame-%04d.png'."
            )
        return [out.with_name(name) for name in names]
    if frames == 1:
        return [out]
    digits = max(4, len(str(frames)))
    return [out.with_name(f"{out.stem}-{k + 1:0{digits}d}{out.suffix}") for k in range(frames)]


def _moved(part: Path, out: Path) -> Path:
    try:
        part.replace(followed(out))
    except OSError as error:
        raise InputOutputError(
            f"cannot write '{out}': {error.strerror}", "Check the folder and run again."
        ) from error
    return out


def _failed(out: Path, error: OSError) -> InputOutputError:
    if error.errno == errno.ENOSPC:
        return InputOutputError(f"the disk is full: '{out}' could not be written", "Free some space.")
    return InputOutputError(
        f"writing '{out}' failed: {error.strerror or error}",
        "Check the free space of the disk and run again.",
    )


def find_ffmpeg() -> str:
    """The program that encodes videos. Raises UsageError when there is none."""
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise UsageError(
            f"there is no ffmpeg to write videos with: {error}",
            "Reinstall the package imageio-ffmpeg, which carries it, or render to .webp or .png.",
        ) from None


class Mp4Writer(Writer):
    """H.264 in MP4: yuv420p, limited range, BT.709 (tagged, or browsers show wrong colours), index at the
    front.

    imageio starts ffmpeg, in a process group of its own: Ctrl-C reaches us alone, and we clean up. It tells neither how
    ffmpeg ended nor what it said, so the file shows whether all went well, and the system why not.
    """

    def __init__(self, out: Path, settings: RenderSettings) -> None:
        import imageio.v3 as iio

        find_ffmpeg()
        logging.getLogger("imageio_ffmpeg").addHandler(logging.NullHandler())  # errors are told below
        self.out, self.part = out, temporary_name(out)
        try:
            # Its plugin takes pictures one by one through this writer alone; a `write` is a whole video.
            video = iio.imopen(self.part.absolute(), "w", plugin="FFMPEG", legacy_mode=True)
            self.video = video.legacy_get_writer(
                fps=settings.fps,
                codec="libx264",
                pixelformat="yuv420p",
                macro_block_size=2,
                quality=None,  # -crf below
                ffmpeg_log_level="fatal",
                input_params=["-nostdin", "-r", f"{settings.fps:.9g}"],  # older imageio-ffmpeg rounds fps
                output_params=[
                    "-vf", "scale=out_color_matrix=bt709:out_range=tv,"
                    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=tv",
                    "-preset", "veryfast", "-crf", str(settings.crf), "-movflags", "+faststart",
                ],
            )  # fmt: skip
        except OSError as error:
            self.part.unlink(missing_ok=True)
            raise _failed(out, error) from error

    def add(self, picture: Picture) -> None:
        try:
            self.video.append_data(picture)
        except OSError as error:
            if error.filename is not None:  # that of ffmpeg; what breaks a pipe has none
                raise InputOutputError(
                    f"cannot start ffmpeg: {error}", "Reinstall the package imageio-ffmpeg, which carries it."
                ) from error
            _close_pipe(error)
            raise self._failure() from error

    def finish(self) -> tuple[Path, ...]:
        self.video.close()
        if not is_whole_mp4(self.part):
            raise self._failure()
        return (_moved(self.part, self.out),)

    def _failure(self) -> InputOutputError:
        """Why ffmpeg could not write: the system's error when this process tries to write to the same file."""
        try:
            with self.part.open("ab", buffering=0) as file:
                file.write(bytes(_PROBE))
                file.write(bytes(1))  # the first may have been cut short without an error
                os.fsync(file)
        except OSError as error:
            return _failed(self.out, error)
        return InputOutputError(
            f"'{self.out}' could not be encoded: ffmpeg ended before the video did",
            "It says why above, unless it was killed, as by the system when memory runs out.",
        )

    def discard(self) -> None:
        self.part.unlink(missing_ok=True)
        self.video.close()  # ffmpeg encodes the pictures that it holds, a few dozen, and ends
        self.part.unlink(missing_ok=True)  # ffmpeg may just have made it


def _close_pipe(error: BaseException) -> None:
    """Close the pipe that broke: imageio-ffmpeg leaves it open when ffmpeg has ended, and Python complains of what is
    still in it once it is thrown away."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        pipe = getattr(frame.f_locals.get("p"), "stdin", None)
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()


def is_whole_mp4(path: Path) -> bool:
    """Whether the boxes of an MP4 file (ISO/IEC 14496-12, section 4.2) end where the file does, the index before the
    pictures: ffmpeg puts it there last."""
    kinds: list[bytes] = []
    with path.open("rb") as file:
        end = file.seek(0, os.SEEK_END)
        place = 0
        while end - place >= 8:
            file.seek(place)
            size, kind = struct.unpack(">I4s", file.read(8))
            length = file.read(8)
            if size == 1 and len(length) == 8:
                (size,) = struct.unpack(">Q", length)
            if size < 8:
                return False
            kinds.append(kind)
            place += size
    return place == end and {b"moov", b"mdat"} <= set(kinds) and kinds.index(b"moov") < kinds.index(b"mdat")


class WebpWriter(Writer):
    """Animated WebP; frames are kept in memory as Pillow needs them all at the end, so it suits short
    clips."""

    def __init__(self, out: Path, settings: RenderSettings) -> None:
        self.out, self.part = out, temporary_name(out)
        self.fps = settings.fps
        self.pictures: deque[Picture] = deque()

    def add(self, picture: Picture) -> None:
        self.pictures.append(picture)

    def finish(self) -> tuple[Path, ...]:
        import imageio.v3 as iio

        # Milliseconds per frame, rounded so that no error adds up.
        ends = np.round(np.arange(len(self.pictures) + 1) * 1000 / self.fps).astype(int)
        options = {
            "duration": np.diff(ends).tolist(), "loop": 0, "quality": 85, "method": 2, "minimize_size": False,
            "allow_mixed": False,
        }  # fmt: skip
        data = io.BytesIO()
        with iio.imopen(data, "w", plugin="pillow", extension=".webp") as animation:
            while self.pictures:
                animation.write(self.pictures.popleft(), **options)
        try:
            self.part.write_bytes(data.getbuffer())
        except OSError as error:
            raise _failed(self.out, error) from error
        return (_moved(self.part, self.out),)

    def discard(self) -> None:
        self.pictures.clear()
        self.part.unlink(missing_ok=True)


class PngWriter(Writer):
    """One PNG file per frame; all appear together when the last is done."""

    def __init__(self, names: list[Path], overwrite: bool) -> None:
        self.names = names
        check_target(names[0], overwrite=overwrite)
        taken = [name for name in names if name.exists()]
        if taken and not overwrite:
            raise OutputExistsError(taken[0])
        self.parts: list[Path] = []

    def add(self, picture: Picture) -> None:
        import imageio.v3 as iio

        out = self.names[len(self.parts)]
        data: bytes = iio.imwrite(
            "<bytes>", picture, plugin="pillow", extension=".png", is_batch=False, compress_level=4
        )
        try:
            self.parts.append(temporary_name(out))
            self.parts[-1].write_bytes(data)
        except OSError as error:
            raise _failed(out, error) from error

    def finish(self) -> tuple[Path, ...]:
        for part, out in zip(self.parts, self.names, strict=True):
            _moved(part, out)
        return tuple(self.names)

    def discard(self) -> None:
        for part in self.parts:
            part.unlink(missing_ok=True)
