"""Title, time and legend, drawn over the finished picture.

Text is set in the scalable font that Pillow carries, so nothing depends on the fonts of the machine. The
font has no superscripts; they are set as small raised digits.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.render.kernels.records import Array
from particlesim.render.scene.coloring import Coloring
from particlesim.render.scene.lighting import is_light
from particlesim.scenario.rendering import RenderSettings

_RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-", strict=True))
_PLAIN = str.maketrans({"−": "-", "×": "x", "µ": "u", "μ": "u", "\u00a0": " "})

NIGHT, PAPER = (16, 19, 26), (244, 246, 249)
PLATE = 0.72
"""Colours and opacity of the plate under a legend."""


class Overlay:
    """The fixed parts, rendered once, and the time label of each picture."""

    def __init__(
        self,
        settings: RenderSettings,
        coloring: Coloring,
        span: tuple[float, float],
        palette: Array,
        groups: tuple[str, ...],
        title: str,
        count: int,
        longest: float = 0.0,
    ) -> None:
        width, height = settings.size
        self.longest = longest
        self.ink = (28, 32, 40) if is_light(settings) else (236, 240, 246)
        self.size = max(round(height / 40), 11)
        self.margin = max(round(height / 27), 6)
        self.picture = settings.size
        self.shown = settings.time_label
        self.title_height = 0
        self.parts: list[tuple[int, int, npt.NDArray[np.uint8]]] = []
        if settings.title and title:
            text = self._fitted(title, round(self.size * 1.35), width - 2 * self.margin)
            self.title_height = text.shape[0] + self.size // 2
            self.parts.append((self.margin, self.margin, text))
        if settings.legend and count and coloring.kind in ("value", "strain"):
            self._corner(
                self._bar(coloring, span, palette, max(width // 5, min(120, width - 2 * self.margin)))
            )
        elif settings.legend and coloring.kind == "group" and groups:
            self._corner(self._groups(groups, palette))

    def _corner(self, part: npt.NDArray[np.uint8]) -> None:
        """Put a part in the lower right corner, on a plate that what is behind it does not disturb."""
        width, height = self.picture
        top, left = height - self.margin - part.shape[0], width - self.margin - part.shape[1]
        pad = self.size // 2
        plate = self._plate(part.shape[0] + 2 * pad, part.shape[1] + 2 * pad, pad)
        self.parts += [(top - pad, left - pad, plate), (top, left, part)]

    def _plate(self, height: int, width: int, corner: int) -> npt.NDArray[np.uint8]:
        """A translucent plate with rounded corners, in the colour against which the text stands out."""
        y, x = np.mgrid[:height, :width] + 0.5
        inside = [np.minimum(v, n - v) for v, n in ((y, height), (x, width))]
        beyond = np.hypot(*(np.maximum(corner - each, 0) for each in inside))
        out = np.empty((height, width, 4), np.uint8)
        out[..., :3] = PAPER if self.ink[0] < 128 else NIGHT
        out[..., 3] = 255 * PLATE * np.clip(corner + 0.5 - beyond, 0, 1)
        return out

    def draw(self, picture: npt.NDArray[np.uint8], time: float) -> None:
        """Blend everything over `picture`, [height, width, 3], in place."""
        for top, left, part in self.parts:
            _blend(picture, part, top, left)
        if self.shown:
            label = self._colored(text_mask(f"t = {format_time(time, self.longest)}", self.size), 0.85)
            _blend(picture, label, self.margin + self.title_height, self.margin)

    def _colored(self, mask: npt.NDArray[np.uint8], opacity: float = 1.0) -> npt.NDArray[np.uint8]:
        out = np.empty((*mask.shape, 4), np.uint8)
        out[..., :3] = self.ink
        out[..., 3] = (mask * opacity).astype(np.uint8)
        return out

    def _fitted(self, text: str, size: int, width: int) -> npt.NDArray[np.uint8]:
        """The text, cut with an ellipsis where it is wider than `width`."""
        mask = text_mask(text, size)
        while mask.shape[1] > width and len(text) > 4:
            text = text.rstrip(".")[:-2] + "..."
            mask = text_mask(text, size)
        return self._colored(mask)

    def _bar(
        self, coloring: Coloring, span: tuple[float, float], palette: Array, width: int
    ) -> npt.NDArray[np.uint8]:
        """Name and unit, the colour bar, ticks at round values."""
        unit = coloring.unit
        if unit.split("/")[0] == "m" and max(map(abs, span)) < 0.01:
            unit, span = f"m{unit}", (1e3 * span[0], 1e3 * span[1])  # 3 mm are read more easily than 3·10⁻³ m
        low, high = span
        name = text_mask(coloring.name + (f"  [{unit}]" if unit else ""), self.size)
        labels = self._labels(low, high, width)
        thick, gap = max(self.size // 2, 5), max(self.size // 4, 2)
        side = max([m.shape[1] for _, m in labels], default=0) // 2 + 1
        full = max(width + 2 * side, name.shape[1] + side)
        tall = name.shape[0] + thick + 3 * gap + max([m.shape[0] for _, m in labels], default=0)
        out = np.zeros((tall, full, 4), np.uint8)
        out[..., :3] = self.ink
        out[: name.shape[0], side : side + name.shape[1], 3] = name[:, : full - side]
        top = name.shape[0] + gap
        colors = palette[np.linspace(0, len(palette) - 1, width).round().astype(int)]
        out[top : top + thick, side : side + width, :3] = (255 * colors + 0.5).astype(np.uint8)
        out[top : top + thick, side : side + width, 3] = 255
        for value, mask in labels:
            x = side + round((value - low) / (high - low) * (width - 1))
            out[top + thick : top + thick + gap, x, 3] = 200
            y, left = top + thick + 2 * gap, min(max(x - mask.shape[1] // 2, 0), full - mask.shape[1])
            out[y : y + mask.shape[0], left : left + mask.shape[1], 3] = (mask * 0.85).astype(np.uint8)
        return out

    def _labels(self, low: float, high: float, width: int) -> list[tuple[float, npt.NDArray[np.uint8]]]:
        """Values and their labels, no more than have room beside each other on a bar of this width."""
        found: list[tuple[float, npt.NDArray[np.uint8]]] = []
        for most in (4, 2, 1):
            found = [(v, text_mask(s, round(self.size * 0.85))) for v, s in round_ticks(low, high, most)]
            apart = [(b - a) / (high - low) * width for (a, _), (b, _) in itertools.pairwise(found)]
            if min(apart, default=math.inf) > max([m.shape[1] for _, m in found], default=0) + self.size // 2:
                break
        return found

    def _groups(self, groups: tuple[str, ...], palette: Array) -> npt.NDArray[np.uint8]:
        """One coloured disc and name per group; the twelve first, then how many more there are."""
        names = [*groups[:12], *([f"and {len(groups) - 12} more"] if len(groups) > 12 else [])]
        masks = [text_mask(name, self.size) for name in names]
        line, dot = round(self.size * 1.5), self.size
        out = np.zeros(
            (line * len(names), dot + self.size // 2 + max(m.shape[1] for m in masks), 4), np.uint8
        )
        y, x = np.mgrid[:dot, :dot] + 0.5 - dot / 2
        disc = np.clip(0.42 * dot + 0.5 - np.hypot(x, y), 0, 1)
        for k, mask in enumerate(masks):
            top = k * line
            if k < 12:
                out[top : top + dot, :dot, :3] = (255 * palette[k]).astype(np.uint8)
                out[top : top + dot, :dot, 3] = (255 * disc).astype(np.uint8)
            area = out[top : top + mask.shape[0], dot + self.size // 2 :][:, : mask.shape[1]]
            area[..., :3] = self.ink
            area[..., 3] = mask[: area.shape[0]]
        return out


def _font(size: int) -> Any:
    from PIL import ImageFont, features

    return ImageFont.load_default(size) if features.check("freetype2") else ImageFont.load_default()


def text_mask(text: str, size: int) -> npt.NDArray[np.uint8]:
    """Coverage of the text, 0 to 255; its height depends on `size` alone, so that lines agree."""
    from PIL import Image, ImageDraw

    normal, small = _font(size), _font(max(round(size * 0.62), 7))
    runs: list[tuple[str, bool]] = []
    for char in text.translate(_PLAIN):
        raised = char in _RAISED
        char = _RAISED.get(char, char)
        if runs and runs[-1][1] == raised:
            runs[-1] = (runs[-1][0] + char, raised)
        else:
            runs.append((char, raised))
    width = sum((small if raised else normal).getlength(run) for run, raised in runs)
    image = Image.new("L", (max(math.ceil(width), 1) + 1, round(size * 1.25)))
    pen, x = ImageDraw.Draw(image), 0.0
    for run, raised in runs:
        pen.text(
            (x, -0.05 * size if raised else 0.05 * size), run, font=small if raised else normal, fill=255
        )
        x += (small if raised else normal).getlength(run)
    return np.asarray(image)


def _blend(picture: npt.NDArray[np.uint8], part: npt.NDArray[np.uint8], top: int, left: int) -> None:
    """Lay an RGBA part over the picture; what hangs over its border is cut off."""
    y, x = max(top, 0), max(left, 0)
    part = part[y - top :, x - left :]
    area = picture[y : y + part.shape[0], x : x + part.shape[1]]
    part = part[: area.shape[0], : area.shape[1]].astype(np.uint16)
    alpha = part[..., 3:]
    area[:] = ((area * (255 - alpha) + part[..., :3] * alpha + 127) // 255).astype(np.uint8)


_TIMES = (
    *((31_557_600.0, "a"), (86_400.0, "d"), (1.0, "s"), (1e-3, "ms")),
    *((1e-6, "us"), (1e-9, "ns"), (1e-12, "ps"), (1e-15, "fs")),
)
_LEAST = {"a": 3.0, "d": 10.0}
"""How many of a unit a film lasts at least to be told in it; a tenth of the others."""


def format_time(seconds: float, longest: float = 0.0) -> str:
    """Time with a fixed number of decimals, in a unit that fits the `longest` of a film, so that the label does not
    jump."""
    size = max(abs(seconds), longest)
    fitting = (each for each in _TIMES if size >= _LEAST.get(each[1], 0.1) * each[0] * (1 - 1e-9))
    unit, name = next(fitting, _TIMES[2] if size == 0 else _TIMES[-1])
    return f"{seconds / unit:.2f} {name}"


def round_ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round values (1, 2, 5 times a power of ten) between low and high with their labels, about `most` of
    them."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s * power for s in (1.0, 2.0, 5.0, 10.0) if rough <= s * power * (1 + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    if last - first > 4 * most or first > 2**53:
        return []
    return [(k * step, _number(k * step, step)) for k in range(first, last + 1)]


def _number(value: float, step: float) -> str:
    if value == 0:
        return "0"
    if not 1e-3 <= abs(step) < 1e5 or abs(value) >= 1e6:
        exponent = math.floor(math.log10(abs(value)) + 1e-12)
        digits = max(exponent - math.floor(math.log10(step) + 1e-12), 0)
        raised = str(exponent).translate(str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"))
        return f"{value / 10.0**exponent:.{digits}f}·10{raised}"
    return f"{value:.{max(0, -math.floor(math.log10(step) + 1e-9))}f}"
