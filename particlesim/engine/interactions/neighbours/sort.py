"""Members in the order of a Hilbert curve, by all threads of an island together; ties by their number.

Cells of the curve are a fraction of the cutoff wide for any volume: a larger volume has longer keys, and takes no memory.
Where the longest keys do not resolve the volume, because some members are very far away, the curve fills the part in which
most are, and the others count as on its surface. Keys are sorted by digits from the last to the first, each pass stable
(radix sort).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.neighbours.curve import LEVELS, curve_key
from particlesim.engine.interactions.neighbours.record import (
    DIGIT,
    HIGH,
    LARGEST,
    LEAST,
    LIVED,
    LOW,
    NARROWEST_SKIN,
    SKIN,
    SKIP,
    SLICES,
    STALE,
    WIDEST_SKIN,
    lives,
    slice_of,
    within_sight,
)

FINENESS = 4.0
"""Cells of the curve in a cutoff."""
STEADY = 64
"""Cells by which the curve is moved at a time."""
WIDEN, NARROW = 1.3, 0.85
"""Factors of a skin whose lists held too short or too long."""
SAMPLE = 128
"""Members whose places tell where most are."""


def wrapped(v: Any, length: Any) -> Any:
    """A coordinate in its period."""
    if length is None:
        return v
    return v - length * np.floor(v / length)


def place_of(near: Any, c: Any, i: Any) -> Any:
    """Where particle i is in the box."""
    if near.box is None:
        return c.x[i], c.y[i], c.z[i]
    return tuple(wrapped(v[i], length) for v, length in zip((c.x, c.y, c.z), near.box, strict=True))


@outlined
def measure(near: Any, c: Any, share: Any, t: Any) -> None:
    """Lowest and highest places and radii of the members, slice by slice."""
    m = near.members.size
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(m, s)
        x0 = y0 = z0 = least = np.inf
        x1 = y1 = z1 = largest = -np.inf
        for j in range(first, last):
            i = near.members[j]
            x, y, z = place_of(near, c, i)
            if lives(c.clock, i, t) & within_sight(x, y, z):
                x0, x1 = x if x < x0 else x0, x if x > x1 else x1
                y0, y1 = y if y < y0 else y0, y if y > y1 else y1
                z0, z1 = z if z < z0 else z0, z if z > z1 else z1
                if near.radii is not None:
                    r = c.r[i]
                    least, largest = r if r < least else least, r if r > largest else largest
        slot = near.slots[s]
        slot[LOW], slot[LOW + 1], slot[LOW + 2] = x0, y0, z0
        slot[HIGH], slot[HIGH + 1], slot[HIGH + 2] = x1, y1, z1
        slot[LEAST], slot[LARGEST] = least, largest


def over_slices(near: Any, column: Any) -> Any:
    """Smallest and largest number in a column of `slots`."""
    low, high = np.inf, -np.inf
    for s in range(SLICES):
        v = near.slots[s, column]
        low, high = v if v < low else low, v if v > high else high
    return low, high


def _core(near: Any, values: Any, length: Any) -> Any:
    """From the tenth to the ninetieth percentile of a coordinate, by a sample of the members, and as much on either side."""
    m = near.members.size
    held = on_stack(1, SAMPLE, np.float64)[0]
    count = min(SAMPLE, m)
    for k in range(count):
        v = float(wrapped(values[near.members[m * k // count]], length))
        j = k
        while j > 0 and held[j - 1] > v:
            held[j] = held[j - 1]
            j -= 1
        held[j] = v
    low, high = held[count // 10], held[max(count - 1 - count // 10, 0)]
    return low - (high - low), high + (high - low)


def tuned_skin(near: Any) -> Any:
    """The skin of lists that are to be built: wider if the last ones held for a few sums only, narrower if for many."""
    if near.tuned is None:
        return near.skin[0]
    reach = near.cutoff
    if near.radii is not None:
        least, _ = over_slices(near, LEAST)
        _, largest = over_slices(near, LARGEST)
        reach += least + largest
    if near.report[STALE] != 0:
        return SKIN * reach
    short, long = near.tuned
    factor = WIDEN if near.report[LIVED] < short else NARROW if near.report[LIVED] > long else 1.0
    return min(max(factor * near.skin[0], NARROWEST_SKIN * reach), WIDEST_SKIN * reach)


def _width(near: Any, skin: Any) -> Any:
    """How wide cells of the curve are; the same for skins that are tuned, so that members keep their places."""
    if near.tuned is None:
        reach = near.cutoff + skin
        return (reach if near.radii is None else reach + 2.0 * over_slices(near, LEAST)[0]) / FINENESS
    if near.radii is None:
        return near.cutoff * (1.0 + SKIN) / FINENESS
    least, _ = over_slices(near, LEAST)
    _, largest = over_slices(near, LARGEST)
    return max(near.cutoff + 2.0 * least, SKIN * (near.cutoff + least + largest)) * (1.0 + SKIN) / FINENESS


def _corner(low: Any, width: Any) -> Any:
    """A corner of the cube, which members that move do not move at once."""
    steady = STEADY * width
    corner = np.floor(low / steady) * steady
    return corner if abs(corner) < np.inf else low


@outlined
def frame(near: Any, c: Any, skin: Any) -> Any:
    """The cube that the curve fills: its lowest corner, 1/width of cells, and levels; the same for all threads."""
    x0, _ = over_slices(near, LOW)
    y0, _ = over_slices(near, LOW + 1)
    z0, _ = over_slices(near, LOW + 2)
    _, x1 = over_slices(near, HIGH)
    _, y1 = over_slices(near, HIGH + 1)
    _, z1 = over_slices(near, HIGH + 2)
    width = _width(near, skin)
    x0, y0, z0 = _corner(x0, width), _corner(y0, width), _corner(z0, width)
    extent = max(x1 - x0, y1 - y0, z1 - z0)
    if not extent < width * 2.0**LEVELS:
        lx, ly, lz = (None, None, None) if near.box is None else near.box
        x0, x1 = _core(near, c.x, lx)
        y0, y1 = _core(near, c.y, ly)
        z0, z1 = _core(near, c.z, lz)
        extent = max(x1 - x0, y1 - y0, z1 - z0)
        extent = extent if extent < np.inf else 1.0
        width = max(width, extent / 2.0**LEVELS)
    levels, size = 1, 2.0 * width
    while size < extent and levels < LEVELS:
        levels += 1
        size *= 2.0
    return x0, y0, z0, 1.0 / width, levels


def _cell(v: Any, low: Any, scale: Any, most: Any) -> Any:
    """The cell of a coordinate, within [0, most]; any for NaN."""
    u = (v - low) * scale
    u = u if u > 0.0 else 0.0
    return int(u if u < most else most)


@outlined
def set_keys(
    near: Any, c: Any, share: Any, t: Any, x0: Any, y0: Any, z0: Any, scale: Any, levels: Any
) -> None:
    """Keys of all members: the section, then the cell on the curve; the dead come last in their section."""
    m = near.members.size
    most = float((1 << levels) - 1)
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(m, s)
        for j in range(first, last):
            i = near.members[j]
            x, y, z = place_of(near, c, i)
            key = curve_key(
                _cell(x, x0, scale, most), _cell(y, y0, scale, most), _cell(z, z0, scale, most), levels
            )
            if c.clock is not None:
                key = key if lives(c.clock, i, t) else (1 << 3 * levels) - 1
            if near.split is not None:
                key = key | (1 << 3 * levels if j >= near.split else 0)
            near.keys[0, j] = key
            near.index[0, j] = j


def _count_digits(near: Any, share: Any, at: Any, shift: Any) -> None:
    keys, mask = near.keys[at], (1 << DIGIT) - 1
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(keys.size, s)
        counts = near.counts[s]
        for d in range(counts.size):
            counts[d] = 0
        for j in range(first, last):
            counts[keys[j] >> shift & mask] += 1


def _add_up(near: Any) -> None:
    """From how many keys of each slice have a digit to where they go; notes if all keys have the same digit."""
    m, total = near.keys.shape[1], 0
    near.report[SKIP] = 0
    for d in range(1 << DIGIT):
        before = total
        for s in range(SLICES):
            count = near.counts[s, d]
            near.counts[s, d] = total
            total += count
        if total - before == m:
            near.report[SKIP] = 1


def _send(near: Any, share: Any, at: Any, shift: Any) -> None:
    keys, index, mask = near.keys[at], near.index[at], (1 << DIGIT) - 1
    to_keys, to_index = near.keys[1 - at], near.index[1 - at]
    for s in range(share.number, SLICES, share.threads):
        first, last = slice_of(keys.size, s)
        counts = near.counts[s]
        for j in range(first, last):
            key = keys[j]
            d = key >> shift & mask
            k = counts[d]
            counts[d] = k + 1
            to_keys[k] = key
            to_index[k] = index[j]


@outlined
def sort_keys(near: Any, share: Any, bits: Any) -> int:
    """Sort keys of some bits with the numbers of their members; returns in which of the two arrays they are."""
    at = 0
    for shift in range(0, bits, DIGIT):
        _count_digits(near, share, at, shift)
        meet(share.gate, share.threads)
        if share.number == 0:
            _add_up(near)
        meet(share.gate, share.threads)
        if near.report[SKIP] == 0:
            _send(near, share, at, shift)
            at = 1 - at
        meet(share.gate, share.threads)
    return at


def sort_members(near: Any, c: Any, share: Any, t: Any) -> Any:
    """Sort the members; returns in which of the two rows of `index` they are. All threads must call it."""
    measure(near, c, share, t)
    meet(share.gate, share.threads)
    skin = tuned_skin(near)
    x0, y0, z0, scale, levels = frame(near, c, skin)
    set_keys(near, c, share, t, x0, y0, z0, scale, levels)
    bits = 3 * levels + (0 if near.split is None else 1)
    meet(share.gate, share.threads)
    if share.number == 0:
        near.skin[0] = skin
    return sort_keys(near, share, bits)
