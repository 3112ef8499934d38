"""Arrays of numbers over a grid from files: NPY, and the grey values of PNG pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from particlesim.errors import UsageError
from particlesim.layouts.input_file import check_regular, require_memory
from particlesim.model.arrays import Floats

LARGEST = 1 << 28
"""Numbers of a grid, at most."""


def read_grid(path: Path) -> Floats:
    """The numbers of a file by its ending, float64: an array of two or three axes, or the rows of a picture from 0 (black)
    to 1 (white).

    Raises UsageError when it is missing or malformed; ResourceError when it is too large.
    """
    try:
        size = check_regular(path, "a file of numbers over a grid", "a .npy or .png file")
        require_memory(path, 16.0 * size, f"{size:,} bytes of numbers")
        values = _picture(path) if path.suffix.lower() == ".png" else _array(path)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None
    if not np.isfinite(values).all():
        raise UsageError(f"{path}: one of its numbers is not finite", "a grid has a number everywhere")
    return values


def _array(path: Path) -> Floats:
    try:
        values = np.load(path, allow_pickle=False, mmap_mode="r")
    except (ValueError, EOFError):  # NumPy's own words speak of pickles, which may run code
        raise UsageError(
            f"{path} is not an NPY file of numbers",
            "numpy.save(name, array) writes one; arrays of Python objects are not read",
        ) from None
    if values.dtype.kind not in "fiu" or values.ndim not in (2, 3):
        raise UsageError(
            f"{path} has {values.ndim} {'axis' if values.ndim == 1 else 'axes'} of {values.dtype}",
            "a height field has real numbers over two axes, [rows, columns], a grid over three, [x, y, z]",
        )
    _bounded(path, values.size)
    return np.array(values, float)


def _picture(path: Path) -> Floats:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path, formats=("PNG",)) as picture:
            _bounded(path, picture.width * picture.height)
            deep = picture.mode.startswith("I")
            values = np.asarray(picture if deep else picture.convert("L"), float)
    except (UnidentifiedImageError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise UsageError(
            f"{path} is no PNG picture: {error}", "is it of the type that its ending says, and complete?"
        ) from None
    return values / (65535.0 if deep else 255.0)


def _bounded(path: Path, number: int) -> None:
    if number > LARGEST:
        raise UsageError(f"{path} has {number:,} numbers", f"at most {LARGEST:,} are read")
