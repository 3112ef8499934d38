"""How particles are arranged: pair distances, density around a centre, power of density waves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from particlesim.analysis.shapes import masses
from particlesim.errors import UsageError
from particlesim.trajectory.box import in_period

Floats = npt.NDArray[np.float64]
Box = Sequence[float] | None
MANY, NEIGHBOURS = 10_000_000, 60
"""Pairs that take some seconds to count, and neighbours of a particle that are worth more."""


@dataclass(frozen=True)
class Curve:
    """A quantity over a length or a wave number: bin centres x [n], values y [n], and how many samples fell into each."""

    x: Floats
    y: Floats
    samples: npt.NDArray[np.int64]


def radial_distribution(
    position: npt.ArrayLike, *, box: Box = None, reach: float | None = None, bins: int = 200
) -> Curve:
    """The radial distribution function g(r): pairs at a distance over those of an ideal gas of the same density.

    position: [n, 3] in m. box: sizes of a periodic box [m], an infinite one along axes that are not periodic; nearest images
    are taken. Without it the density is that of the particles' bounding box, and g falls with r, as there is nothing
    outside. reach: largest r [m], at most half of the smallest periodic size (then also the default; else a quarter of the
    smallest extent; of many particles, where there are about MANY pairs, or NEIGHBOURS of each). Raises UsageError for
    fewer than two particles, a box that is none, a reach that is too long, or no volume.
    Source: M. P. Allen, D. J. Tildesley, Computer Simulation of Liquids, section 2.6.
    """
    from scipy.spatial import cKDTree

    x = _places(position, least=2)
    extent = np.ptp(x, axis=0)
    sizes = _sizes(box)
    periodic = np.isfinite(sizes)
    volume = float(np.prod(np.where(periodic, sizes, extent)))
    if not volume > 0:
        raise UsageError("a radial distribution needs particles that fill a volume", "these lie in a plane")
    furthest = float(sizes[periodic].min()) / 2 if periodic.any() else float(extent.min()) / 4
    if reach is None:
        seen = max(2 * MANY / len(x), NEIGHBOURS)
        reach = min(furthest, float((seen * volume / len(x) * 3 / (4 * np.pi)) ** (1 / 3)))
    if not 0 < reach <= (furthest if periodic.any() else np.inf):
        raise UsageError(
            f"a radial distribution up to {reach:g} m is not possible",
            f"nearest images reach to half of the box, {furthest:g} m",
        )
    edges = np.linspace(0, reach, bins + 1)
    # SciPy takes a size of 0 for an axis that is not periodic.
    tree = cKDTree(in_period(x, sizes), boxsize=np.where(periodic, sizes, 0.0))
    within = tree.count_neighbors(tree, edges) - len(x)  # each pair twice, without the particles themselves
    pairs = np.diff(within)
    shells = 4 / 3 * np.pi * np.diff(edges**3)
    ideal = len(x) * (len(x) - 1) / volume * shells
    return Curve((edges[:-1] + edges[1:]) / 2, pairs / ideal, pairs // 2)


def density_profile(
    position: npt.ArrayLike,
    mass: npt.ArrayLike | float = 1.0,
    *,
    box: Box = None,
    center: npt.ArrayLike | None = None,
    bins: int = 60,
    inner: float | None = None,
    outer: float | None = None,
) -> Curve:
    """Mean density [kg/m³] in spherical shells around a centre, over the radius [m] (geometric mean of the shell).

    position: [n, 3] in m; mass: [n] or one number, in kg. box: sizes of a periodic box [m], an infinite one along axes that
    are not periodic; of each particle the image that is nearest to the centre counts, up to half of the smallest size.
    center: [3] in m; the densest place unless given, found by spheres that shrink (Power et al., MNRAS 338, 14 (2003)).
    Shells are even in the logarithm of the radius, between `inner` and `outer` [m]: the 1st and the 99.5th percentile of the
    radii unless given, of those up to half of the smallest size in a box.
    Raises UsageError for fewer than two particles, shapes or masses that do not fit, a box that is none, or radii in the
    wrong order or beyond half of it.
    """
    x = _places(position, least=2)
    m = masses(mass, len(x))
    sizes = _sizes(box)
    middle = densest_place(x, m, box=box) if center is None else np.asarray(center, float)
    if middle.shape != (3,):
        raise UsageError(f"the centre has the shape {middle.shape}", "[3] is needed")
    r = np.linalg.norm(_nearest(x - middle, sizes), axis=1)
    furthest = float(sizes.min()) / 2
    if outer is not None and outer > furthest:
        raise UsageError(
            f"a density profile up to {outer:g} m is not possible",
            f"nearest images reach to half of the box, {furthest:g} m",
        )
    # Spheres beyond half of the box would hold a part of their images only.
    seen = r[r <= furthest] if box is not None and (r <= furthest).any() else r
    low = float(np.percentile(seen, 1)) if inner is None else inner
    high = min(float(np.percentile(seen, 99.5)), furthest) if outer is None else outer
    if not 0 < low < high * (1 - 1e-9):  # of two particles, both radii are one but for rounding
        raise UsageError(f"no shells between {low:g} and {high:g} m", "radii are above 0 and in order")
    edges = np.geomspace(low, high, bins + 1)
    held, _ = np.histogram(r, edges, weights=m)
    samples, _ = np.histogram(r, edges)
    if (
        inner is None and outer is None and not samples.any()
    ):  # of two particles, one is nearer and one further away
        raise UsageError(f"no shells between {low:g} and {high:g} m", "there are too few particles")
    return Curve(
        np.sqrt(edges[:-1] * edges[1:]), held / (4 / 3 * np.pi * np.diff(edges**3)), samples.astype(np.int64)
    )


def densest_place(position: Floats, mass: Floats, *, box: Box = None) -> Floats:
    """The centre of mass within a sphere about itself that shrinks by 2.5 % until 1000 particles, or 1 %, are left [m], [3].

    position: [n, 3] in m; mass: [n] in kg. box: sizes of a periodic box [m], an infinite one along axes that are not
    periodic. The sphere then holds nearest images and begins where the mean of the angles 2π x/L points to; the place is in
    [0, L) along periodic axes. Raises UsageError for a box that is none.
    """
    sizes = _sizes(box)
    periodic = np.isfinite(sizes)
    center = np.average(position, axis=0, weights=mass)
    if periodic.any():
        turn = 2 * np.pi * position[:, periodic] / sizes[periodic]
        east, north = (np.average(part, axis=0, weights=mass) for part in (np.cos(turn), np.sin(turn)))
        center[periodic] = np.arctan2(north, east) / (2 * np.pi) * sizes[periodic]
    x, m, way = position, mass, _nearest(position - center, sizes)
    radius = float(np.linalg.norm(way, axis=1).max())
    least = max(10, min(1000, len(position) // 100))
    while radius > 0:
        inside = np.linalg.norm(way, axis=1) <= radius
        if inside.sum() < least:
            break
        x, m = x[inside], m[inside]
        center = center + np.average(way[inside], axis=0, weights=m)
        way = _nearest(x - center, sizes)
        radius *= 0.975
    return in_period(center, sizes)


def power_spectrum(
    position: npt.ArrayLike,
    mass: npt.ArrayLike | float = 1.0,
    *,
    box: Sequence[float],
    mesh: int = 128,
    shot_noise: bool = False,
) -> Curve:
    """The power spectrum P(k) = V ⟨|δ_k|²⟩ [m³] of the density contrast δ = ρ/ρ̄ − 1 in a periodic box, over k [1/m].

    position: [n, 3] in m; mass: [n] or one number. The density is put on a mesh of `mesh`³ nodes by triangular clouds, whose
    window is divided out; k goes up to the Nyquist wave number, and means are over shells of the width of the smallest one.
    Particles placed at random have P = V Σm²/(Σm)², the shot noise, which is taken off unless `shot_noise`, and with it what
    waves beyond the Nyquist wave number add to it, which the mesh cannot tell apart: a sixth in the last shell of a cube.
    What such waves of the density itself add stays.
    Raises UsageError for no particles, shapes or masses that do not fit, or a box that is not periodic along all axes.
    Sources: R. W. Hockney, J. W. Eastwood, Computer Simulation Using Particles; Y. P. Jing, ApJ 620, 559 (2005).
    """
    from scipy import fft

    x = _places(position, least=1)
    m = masses(mass, len(x))
    size = np.asarray(box, float)
    if size.shape != (3,) or not (np.isfinite(size).all() and (size > 0).all()):
        raise UsageError(
            "a power spectrum needs a box that is periodic along all axes", "box = three sizes in m"
        )
    density = _cloud(in_period(x / size, 1.0) * mesh, m, mesh)
    waves = fft.rfftn(density / density.mean() - 1.0, workers=-1) / mesh**3
    index = [np.fft.fftfreq(mesh, 1 / mesh), np.fft.fftfreq(mesh, 1 / mesh), np.fft.rfftfreq(mesh, 1 / mesh)]
    volume = float(size.prod())
    # The cloud, three cells wide, multiplies each wave by sinc³ along each axis.
    window = _product([np.sinc(n / mesh) ** 6 for n in index])
    power = volume * np.abs(waves) ** 2
    if not shot_noise:
        # Each wave holds the noise of all that differ by whole numbers of meshes: along each axis Σ sinc⁶(n/mesh + i)
        # over all i, which is a polynomial of sin² (Jing). Near the Nyquist wave number that is far above its own sinc⁶.
        bend = [np.sin(np.pi * n / mesh) ** 2 for n in index]
        power -= volume * (m**2).sum() / m.sum() ** 2 * _product([1 - s + 2 / 15 * s**2 for s in bend])
    power /= window
    lattice = np.meshgrid(
        *(2 * np.pi * n / s for n, s in zip(index, size, strict=True)), indexing="ij", sparse=True
    )
    k = np.sqrt(lattice[0] ** 2 + lattice[1] ** 2 + lattice[2] ** 2)
    # Waves of the half that is not stored are those that are, but for the plane at the beginning of the last axis; that at
    # its end is beyond the last shell.
    twice = np.full(power.shape, 2)
    twice[..., 0] = 1
    width, last = 2 * np.pi / size.max(), np.pi * mesh / size.max()
    edges = np.arange(0.5, last / width) * width
    samples, _ = np.histogram(k, edges, weights=twice)
    total, _ = np.histogram(k, edges, weights=twice * power)
    where, _ = np.histogram(k, edges, weights=twice * k)
    some = samples > 0
    return Curve(where[some] / samples[some], total[some] / samples[some], samples[some].astype(np.int64))


def _product(along: Sequence[Floats]) -> Floats:
    """The product of a function of each axis, on the mesh."""
    return along[0][:, None, None] * along[1][:, None] * along[2]


def _cloud(place: Floats, mass: Floats, mesh: int) -> Floats:
    """Mass on the nodes of a periodic mesh by triangular clouds, place in cells [n, 3]."""
    total = np.zeros(mesh**3)
    node = np.rint(place).astype(np.int64)
    d = place - node
    weight = [0.5 * (0.5 - d) ** 2, 0.75 - d**2, 0.5 * (0.5 + d) ** 2]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                ix, iy, iz = ((node[:, a] + s - 1) % mesh for a, s in enumerate((i, j, k)))
                share = mass * weight[i][:, 0] * weight[j][:, 1] * weight[k][:, 2]
                total += np.bincount((ix * mesh + iy) * mesh + iz, share, mesh**3)
    return total.reshape(mesh, mesh, mesh)


def _sizes(box: Box) -> Floats:
    """Periods along all axes [m], infinite where there are none."""
    sizes = np.full(3, np.inf) if box is None else np.asarray(box, float)
    if sizes.shape != (3,) or not (sizes > 0).all():
        raise UsageError(
            f"{box} is no box", "box = three sizes in m, infinite along axes that are not periodic"
        )
    return sizes


def _nearest(way: Floats, sizes: Floats) -> Floats:
    """Ways to the nearest images, [n, 3]."""
    if not np.isfinite(sizes).any():
        return way
    periods = np.where(np.isfinite(sizes), sizes, 0.0)
    return way - periods * np.rint(way / sizes)


def _places(position: npt.ArrayLike, least: int) -> Floats:
    x: npt.NDArray[Any] = np.asarray(position, float)
    if x.ndim != 2 or x.shape[1] != 3:
        raise UsageError(f"positions have the shape {x.shape}", "[n, 3] is needed")
    if len(x) < least:
        raise UsageError(
            f"{len(x)} particle{'s are' if len(x) != 1 else ' is'} too few", f"at least {least} are needed"
        )
    return x
