"""Lengths, masses and charges whose squares and products numbers of the run do not hold: refused at the start.

Laws of pairs take squares of distances and products of masses or charges. Where these are infinite, or too small to be told
from nothing, forces vanish without a sign: nothing would move, or everything at once.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particlesim.engine.interactions.interaction import Floats, Site
from particlesim.engine.interactions.neighbours.record import FAR
from particlesim.errors import UsageError
from particlesim.interactions import PairSet

DOUBLE = 'precision = "double" in [simulation]'
WORDS = {"mass": "masses", "charge": "charges"}
PAIR_BY_PAIR = ("direct", "neighbours", "contacts", "impulses")
"""Methods that take squares of distances in the numbers of the run."""


def refuse_out_of_range(site: Site, pairs: PairSet, way: str) -> None:
    """Raise UsageError for particles, or a law, of a size that pairs summed in this way cannot have."""
    if way in PAIR_BY_PAIR:
        _refuse_lengths(site, pairs)
    if way == "mesh":
        _refuse_wide(site, pairs)
    if way == "neighbours":
        _refuse_far(site, pairs)
    _refuse_products(site, pairs, way)


def _refuse_lengths(site: Site, pairs: PairSet) -> None:
    law, longest = pairs.law, math.sqrt(float(np.finfo(site.dtype).max))
    squares = _squares(site, longest)
    ends, reach = law.touching() or law.is_contact, law.reach()
    if ends:
        radii = (float(site.state[name].attribute("radius").max(initial=0.0)) for name in pairs.groups)
        largest = max(radii, default=0.0)
        reach = 2 * largest + law.beyond(largest)
    elif reach == law.cutoff and reach is not None and not reach < longest:
        reach = None  # cuts nothing
    for length in (reach, law.length()):
        if length is not None and not length < longest:
            raise UsageError(f"{pairs.name} has a length of {length:.3g} m, and {squares}", _better(site))
    if reach is None and (apart := _extent(site, pairs)) >= longest:
        raise UsageError(
            f"{pairs.name}: particles are up to {apart:.3g} m apart, and {squares}", _better(site)
        )


def _refuse_wide(site: Site, pairs: PairSet) -> None:
    """Of a box for a mesh, whose near part may reach over half of it."""
    box, longest = site.scenario.simulation.box, math.sqrt(float(np.finfo(site.dtype).max))
    assert box is not None
    if math.hypot(*box.size) / 2 >= longest:
        raise UsageError(
            f"{pairs.name}: images in the box are {math.hypot(*box.size) / 2:.3g} m apart, and {_squares(site, longest)}",
            _better(site),
        )


def _extent(site: Site, pairs: PairSet) -> float:
    """How far particles are apart at most, as the diagonal of the box around them, or to the nearest image [m]."""
    x = _places(site, pairs)
    if not x.size:
        return 0.0
    sides = x.max(axis=0) - x.min(axis=0)
    if (box := site.scenario.simulation.box) is not None:
        periods = (math.inf if each is None else each / 2 for each in box.as_box().periods)
        sides = np.minimum(sides, np.array(list(periods)))
    return math.hypot(*sides.tolist())


def _refuse_far(site: Site, pairs: PairSet) -> None:
    """Neighbour lists keep those who are not there at FAR."""
    x, box = np.abs(_places(site, pairs)), site.scenario.simulation.box
    if box is not None:
        x = x[:, [each is None for each in box.as_box().periods]]  # others are wrapped
    far = x.sum(axis=1)
    if np.count_nonzero(far >= FAR) > 1:
        raise UsageError(
            f"{pairs.name}: particles are {far.max():.3g} m from the origin, and neighbour lists find those up to "
            f"{FAR:.0e} m",
            'method = "direct", or other units of length',
        )


def _refuse_products(site: Site, pairs: PairSet, way: str) -> None:
    """The least product that a particle feels is that with the one of the largest mass or charge. A tree has small ones in
    double precision; whoever looks at the step has large ones in that of the run."""
    product = pairs.law.product()
    if product is None:
        return
    by, factor = product
    sizes = np.concatenate([np.abs(site.state[name].attribute(by).astype(float)) for name in pairs.groups])
    sizes = np.sort(sizes[sizes > 0])
    if sizes.size < 2 or factor == 0:
        return
    limits, (symbol, unit) = np.finfo(site.dtype), {"mass": ("m", "kg"), "charge": ("q", "C")}[by]
    held = f"than {_name(site.dtype)} precision holds"
    with np.errstate(over="ignore", under="ignore"):
        largest, least = float(sizes[-1] * sizes[-2]), float(sizes[0] * sizes[-1])
    if largest > float(limits.max):
        raise UsageError(
            f"{pairs.name}: the product of the two largest {WORDS[by]}, {sizes[-1]:.3g} and {sizes[-2]:.3g} {unit}, "
            f"is more {held}",
            _better(site, by),
        )
    if way != "tree" and min(least, least * abs(factor)) < float(limits.tiny):
        raise UsageError(
            f"{pairs.name}: {symbol}₁ {symbol}₂ = {least:.1e} {unit}², times {abs(factor):.1e}, of the smallest particle "
            f"and the largest is less {held}",
            _better(site, by)
            + (', or method = "tree"' if way == "direct" and pairs.law.lacks_multipoles() is None else ""),
        )


def _places(site: Site, pairs: PairSet) -> Floats:
    return np.concatenate([site.state[name].position.astype(float) for name in pairs.groups])


def _squares(site: Site, longest: float) -> str:
    return f"{_name(site.dtype)} precision holds no squares of lengths above {longest:.2g} m"


def _name(dtype: Any) -> str:
    return "single" if dtype == np.float32 else "double"


def _better(site: Site, what: str = "length") -> str:
    units = f"other units of {what}"
    return f"{DOUBLE}, or {units}" if site.dtype == np.float32 else units
