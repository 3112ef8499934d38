"""Files that pictures go into: MP4 by ffmpeg, animated WebP, numbered PNG files.

A writer makes its file beside the final place under a temporary name and moves it there when it is whole;
after an error or an interrupt nothing is left. Raises UsageError before anything is written when the place
cannot be used, InputOutputError when writing fails later.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from particlesim.errors import InputOutputError, OutputExistsError, UsageError
from particlesim.scenario.rendering import RenderSettings
from particlesim.trajectory.target import check_target, followed, temporary_name

Picture = npt.NDArray[np.uint8]
SUFFIXES = (".mp4", ".webp", ".png")


class Writer(Protocol):
    """`add` every picture, then `finish`; or `discard` at any moment."""

    def add(self, picture: Picture) -> None: ...
    def finish(self) -> tuple[Path, ...]: ...
    def discard(self) -> None: ...


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
                f"'{out.name}' is no pattern for file numbers",
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


class Mp4Writer:
    """H.264 in MP4: yuv420p, limited range, BT.709 (tagged, or browsers show wrong colours), index at the
    front."""

    def __init__(self, out: Path, settings: RenderSettings) -> None:
        ffmpeg = find_ffmpeg()
        self.out, self.part = out, temporary_name(out)
        width, height = settings.size
        # -nostdin: ffmpeg leaves the terminal alone. A session of its own: Ctrl-C reaches us alone, and we
        # clean up.
        command = [
            ffmpeg, "-y", "-hide_banner", "-loglevel", "error",
            "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
            "-r", f"{settings.fps:.9g}", "-i", "pipe:0",
            "-an", "-vf", "scale=out_color_matrix=bt709:out_range=tv,"
            "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709:range=tv",
            "-c:v", "libx264", "-preset", "veryfast", "-crf", str(settings.crf), "-pix_fmt", "yuv420p",
            "-movflags", "+faststart", str(self.part),
        ]  # fmt: skip
        self.log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `_close`
        try:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self.log,
                start_new_session=True,
            )
        except OSError as error:
            self.log.close()
            self.part.unlink(missing_ok=True)
            raise InputOutputError(
                f"cannot start ffmpeg: {error}", "Reinstall the package imageio-ffmpeg, which carries it."
            ) from error

    def add(self, picture: Picture) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(np.ascontiguousarray(picture).data)
        except OSError as error:
            raise self._failure() from error

    def finish(self) -> tuple[Path, ...]:
        assert self.process.stdin is not None
        try:
            self.process.stdin.close()
        except OSError as error:
            raise self._failure() from error
        if self.process.wait() != 0:
            raise self._failure()
        self.log.close()
        return (_moved(self.part, self.out),)

    def _failure(self) -> InputOutputError:
        self.process.wait()
        self.log.seek(0)
        lines = self.log.read().decode(errors="replace").strip().splitlines()
        if any("No space left on device" in line for line in lines):
            return InputOutputError(
                f"the disk is full: '{self.out}' could not be written", "Free some space."
            )
        # Its lines begin with the part of ffmpeg that speaks and its address: "[libx264 @ 0x55d0c8a7] ...".
        said = re.sub(r"^(\[[^\]]*\] *)+", "", lines[-1]) if lines else f"status {self.process.returncode}"
        return InputOutputError(
            f"'{self.out}' could not be encoded: ffmpeg says: {said}", "Check the free space of the disk."
        )

    def discard(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        with contextlib.suppress(OSError):
            if self.process.stdin is not None:
                self.process.stdin.close()
        self.log.close()
        self.part.unlink(missing_ok=True)


class WebpWriter:
    """Animated WebP; frames are kept in memory as Pillow needs them all at the end, so it suits short
    clips."""

    def __init__(self, out: Path, settings: RenderSettings) -> None:
        self.out, self.part = out, temporary_name(out)
        self.fps = settings.fps
        self.pictures: list[Any] = []

    def add(self, picture: Picture) -> None:
        from PIL import Image

        self.pictures.append(Image.fromarray(picture))

    def finish(self) -> tuple[Path, ...]:
        # Milliseconds per frame, rounded so that no error adds up.
        ends = np.round(np.arange(len(self.pictures) + 1) * 1000 / self.fps).astype(int)
        first, *rest = self.pictures
        try:
            first.save(
                self.part, "WEBP", save_all=True, append_images=rest, duration=np.diff(ends).tolist(),
                loop=0, quality=85, method=2, minimize_size=False, allow_mixed=False,
            )  # fmt: skip
        except OSError as error:
            raise _failed(self.out, error) from error
        return (_moved(self.part, self.out),)

    def discard(self) -> None:
        self.pictures.clear()
        self.part.unlink(missing_ok=True)


class PngWriter:
    """One PNG file per frame; all appear together when the last is done."""

    def __init__(self, names: list[Path], overwrite: bool) -> None:
        self.names = names
        check_target(names[0], overwrite=overwrite)
        taken = [name for name in names if name.exists()]
        if taken and not overwrite:
            raise OutputExistsError(taken[0])
        self.parts: list[Path] = []

    def add(self, picture: Picture) -> None:
        from PIL import Image

        out = self.names[len(self.parts)]
        try:
            self.parts.append(temporary_name(out))
            Image.fromarray(picture).save(self.parts[-1], "PNG", compress_level=4)
        except OSError as error:
            raise _failed(out, error) from error

    def finish(self) -> tuple[Path, ...]:
        for part, out in zip(self.parts, self.names, strict=True):
            _moved(part, out)
        return tuple(self.names)

    def discard(self) -> None:
        for part in self.parts:
            part.unlink(missing_ok=True)
