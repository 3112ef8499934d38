"""Moments of sources and the polynomials that they make at far places, for potentials Σ w f(|x − y|).

About a centre c, sources w at y have the moments M_k = Σ w (c − y)^k/k!. Far from them, at b + t,

    Σ w f = Σ_n t^n/n! F_n,   F_n = Σ_k M_k D_{n+k},   D_k = ∂^k f at b − c,

cut off at |n| + |k| = p, the order. Cartesian, not harmonic, expansions are taken since only the chain f, f'/r,
(f'/r)'/r, … knows what f is: softening costs nothing. f = 1/√(r² + ε²) here.

Sources: Greengard & Rokhlin (1987) for the idea; Dehnen, J. Comput. Phys. 179 (2002) 27, for Cartesian expansions cut off
at a total order. The derivatives of radial functions follow from D_{k+e} = x D'_k + k_e D'_{k−e}, where ' takes the chain
one further.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import lanes, on_stack, transpose
from particlesim.compiler.intrinsics import BLOCK
from particlesim.engine.interactions.tree.indices import parts, raised, size, steps
from particlesim.engine.interactions.tree.inverse_root import inverse_root


def powers(v: Any, last: int) -> Any:
    """v^k/k! for all k up to degree `last`."""
    if last == 0:
        return ((1.0,),)
    below = powers(v, last - 1)
    return (*below, tuple(below[last - 1][s.below] * v[s.axis] * (1 / s.power) for s in steps(last)))


def chain(r2: Any, last: int) -> Any:
    """f, f'/r, (f'/r)'/r, … of f = 1/r, up to `last` times, given r² (with the softening in it)."""
    q = inverse_root(r2, last)
    return _chain(q, -q * q, last)


def _chain(s: Any, factor: Any, last: int) -> Any:
    """s, then each the one before times (2m − 1) · factor."""
    if last == 0:
        return (s,)
    before = _chain(s, factor, last - 1)
    return (*before, before[last - 1] * factor * float(2 * last - 1))


def derivatives(v: Any, links: Any) -> Any:
    """∂^k f at v for all k up to the number of links of the chain."""
    here = tuple((s,) for s in links)
    return (here[0], *_derivatives(v, 1, here, None))


def _derivatives(v: Any, degree: int, below: Any, second: Any) -> Any:
    """Degrees from this one on. `below[m]`: ∂^k of the m-th link for the k one degree below; `second`: two below."""
    if len(below) == 1:
        return ()
    here = tuple(
        tuple(
            v[s.axis] * below[m + 1][s.below]
            if s.power == 1
            else v[s.axis] * below[m + 1][s.below] + float(s.power - 1) * second[m + 1][s.second]
            for s in steps(degree)
        )
        for m in range(len(below) - 1)
    )
    return (here[0], *_derivatives(v, degree + 1, here, below))


def taken(row: Any, begins: Any) -> Any:
    """The expansion that a row of an array holds; None for degrees that it does not."""
    return tuple(
        None if begin < 0 else tuple(row[begin + i] for i in range(size(n)))
        for n, begin in enumerate(begins[:-1])
    )


def put(row: Any, begins: Any, expansion: Any) -> None:
    """Write the degrees of an expansion that a row holds."""
    for n, begin in enumerate(begins[:-1]):
        if begin >= 0:
            for i, number in enumerate(expansion[n]):
                row[begin + i] = number


def add(row: Any, begins: Any, expansion: Any) -> None:
    """Add the degrees of an expansion that a row holds."""
    for n, begin in enumerate(begins[:-1]):
        if begin >= 0:
            for i, number in enumerate(expansion[n]):
                row[begin + i] += number


def add_lanes(row: Any, sums: Any) -> None:
    """Add the lanes of sums [numbers, BLOCK] to the numbers of a row, lane after lane; both end with whole vectors."""
    turned = on_stack(BLOCK, BLOCK, np.float64)
    for first in range(0, sums.shape[0], BLOCK):
        transpose(sums, tuple(first + k for k in range(BLOCK)), 0, turned, 0)
        for lane in range(BLOCK):
            for k in lanes(BLOCK):
                row[first + k] += turned[lane, k]


def scaled(expansion: Any, factor: Any) -> Any:
    """All numbers of an expansion times a factor."""
    return tuple(tuple(number * factor for number in each) for each in expansion)


def moments_shifted(moments: Any, v: Any, last: int) -> Any:
    """Moments about a centre that is further by v."""
    t = powers(v, last)
    return tuple(
        tuple(
            sum(
                moments[a.degree][a.place] * t[a.other_degree][a.other]
                for a in each
                if moments[a.degree] is not None
            )
            for each in parts(n)
        )
        for n in range(last + 1)
    )


def field_numbers(moments: Any, d: Any, n: int, chosen: Any, order: int) -> Any:
    """F_n of moments for some indices of degree n, by their places."""
    return tuple(
        sum(
            _dot(moments[j], d[n + j], raised(n, j)[k])
            for j in range(min(order - n, len(moments) - 1) + 1)
            if moments[j] is not None
        )
        for k in chosen
    )


def field_shifted(field: Any, v: Any, first: int, order: int) -> Any:
    """F_n about a centre that is further by v."""
    t = powers(v, order - first)
    return tuple(
        None if n < first else tuple(_value(field, t, n, k, order) for k in range(size(n)))
        for n in range(order + 1)
    )


def _value(field: Any, t: Any, n: int, k: int, order: int) -> Any:
    """Σ_j F_{n+j} t_j for the k-th index of degree n."""
    return sum(_dot(t[j], field[n + j], raised(n, j)[k]) for j in range(order - n + 1))


def _dot(a: Any, b: Any, places: Any) -> Any:
    """Σ of the numbers of a times those of b that stand at these places."""
    return sum(a[i] * b[at] for i, at in enumerate(places))


def gradient(field: Any, v: Any, order: int) -> Any:
    """The gradient of the polynomial at v from its centre."""
    t = powers(v, order - 1)
    return tuple(_value(field, t, 1, k, order) for k in range(3))


def height(field: Any, v: Any, order: int) -> Any:
    """The value of the polynomial at v from its centre."""
    return _value(field, powers(v, order), 0, 0, order)
