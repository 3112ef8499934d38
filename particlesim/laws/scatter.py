"""Random numbers for pairs of particles, from what they are: seed, step and both ids, in any order.

A counter-based generator: no state, so neither threads nor the order of pairs matter, and a resumed run goes on alike.
Source: the mixer is that of C. Wellons, hash-prospector (lowbias32), with constants below 2³¹, so that products of 32 bits
fit into the integers of kernels.
"""

from __future__ import annotations

MASK = (1 << 32) - 1
FIRST, SECOND = 0x21F0AAAD, 0x735A2D97
WIDTH = 2 * 3**0.5
"""Of a uniform distribution with variance 1."""


def mixed(x: int) -> int:
    """32 bits that look random, one-to-one, from 32 bits."""
    x = x ^ (x >> 16)
    x = (x * FIRST) & MASK
    x = x ^ (x >> 15)
    x = (x * SECOND) & MASK
    return x ^ (x >> 15)


def folded(x: int) -> int:
    """32 bits from 64."""
    return (x ^ (x >> 32)) & MASK


def kick(seed: int, step: int, first: int, second: int) -> float:
    """A random number of mean 0 and variance 1, uniform in (−√3, √3), the same for both of a pair."""
    h = mixed(mixed(folded(seed)) ^ folded(step))
    h = mixed(h ^ folded(min(first, second)))
    h = mixed(h ^ folded(max(first, second)))
    return WIDTH * ((h + 0.5) * 2.0**-32 - 0.5)
