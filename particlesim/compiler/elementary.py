"""Elementary functions in the kernels' own language: the same bits on every machine, and free of branches.

Only operations that IEEE 754 rounds in one way occur, in a fixed order, with fma where it is written; a choice takes one
of two numbers that both exist, so a loop over particles becomes vectors. Every error is below one unit in the last place
(ulp); the figure beside each function is the largest seen against 40 digits (`tests/compiler/test_elementary.py`,
`tests/bench/accuracy_elementary.py`). Special values are those of IEEE 754 and C (annex F).

How: Cody and Waite, Software Manual for the Elementary Functions (1980), for the reduction of arguments; Muller, Elementary
Functions, for polynomials and the handling of errors; Dekker (1971) and Knuth, The Art of Computer Programming, volume
2, for sums and products with their rounding errors. Where a result is a large part plus a small one, both are kept to the
end and rounded in one last sum: this is why errors stay near the half ulp that nobody avoids. The polynomials are our own
(`tests/bench/derive_polynomials.py`), highest power first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import math

import numpy as np

from particlesim.compiler.intrinsics import bits_of, copysign, exact, floor, fma, nearest, number_of, sqrt

INF = math.inf
NAN = math.nan
TINY = 2.0**-28  # below, u³ is lost beside u in odd functions

Pair = tuple[float, float]


# Sums and products that keep what rounding loses.


def two_sum(a: float, b: float) -> Pair:
    """a + b as its rounded value and the error of that, exactly (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def fast_two_sum(a: float, b: float) -> Pair:
    """The same where |a| ≥ |b| or a = 0 (Dekker)."""
    total = a + b
    return total, b - (total - a)


def two_product(a: float, b: float) -> Pair:
    """a·b as its rounded value and the error of that."""
    product = a * b
    return product, fma(a, b, -product)


def quotient(a: float, a_rest: float, b: float, b_rest: float) -> Pair:
    """(a + a_rest) / (b + b_rest) as its rounded value and a correction, from the remainder of the division."""
    q = a / b
    return q, (fma(-q, b, a) + (a_rest - q * b_rest)) / b


def polynomial(x: float, coefficients: tuple[float, ...]) -> float:
    """Horner's scheme, highest power first."""
    total = coefficients[0]
    for c in coefficients[1:]:
        total = fma(total, x, c)
    return total


# Powers of two, by the bits of the exponent.

SHIFT = 2.0**52 + 1023.0  # adding it leaves k + 1023 in the lowest bits


def two_to(k: float) -> float:
    """2ᵏ for an integer −1022 ≤ k ≤ 1023."""
    return number_of((bits_of(k + SHIFT) & 2047) << 52)


def scaled(x: float, k: float) -> float:
    """x·2ᵏ in two steps, for results that overflow or become subnormal."""
    half = floor(0.5 * k)
    return x * two_to(half) * two_to(k - half)


# Exponential functions: x = k ln 2 + r with |r| ≤ ln 2 / 2, and eˣ = 2ᵏ (1 + r + r² EXP(r)).

LOG2_E = 1.4426950408889634
LN2_HIGH = 0.6931471805598903  # 42 bits: k·LN2_HIGH is exact for every exponent k
LN2_LOW = 5.497923018708371e-14
EXP = (
    2.091468233750756e-09,
    2.510520642590017e-08,
    2.755727365335771e-07,
    2.7557255425621654e-06,
    2.4801587325540817e-05,
    0.0001984126987480059,
    0.001388888888888375,
    0.008333333333326141,
    0.04166666666666667,
    0.1666666666666667,
    0.5,
)
# relative error 2^-61.4


def exponential(x: float, rest: float) -> tuple[float, float, float]:
    """k, r and q of e^(x + rest) = 2ᵏ (1 + r + q), with a small rest."""
    k = nearest(x * LOG2_E)
    coarse = fma(-k, LN2_HIGH, x)
    r = fma(-k, LN2_LOW, coarse)
    return k, r, fma(r * r, polynomial(r, EXP), fma(-k, LN2_LOW, coarse - r) + rest)


def exp_of_sum(x: float, rest: float) -> float:
    """e^(x + rest), also where it overflows or vanishes."""
    x = 710.0 if x > 710.0 else (-746.0 if x < -746.0 else x)
    k, r, q = exponential(x, rest)
    one, lost = fast_two_sum(1.0, r)
    return scaled(one + (lost + q), k)


@exact
def exp(x: float) -> float:
    """eˣ."""
    return exp_of_sum(x, 0.0)


@exact
def expm1(x: float) -> float:
    """eˣ − 1, to the last digits for small x too: the half of it is (s − ½) + s r + s q with s = 2ᵏ⁻¹."""
    k, r, q = exponential(710.0 if x > 710.0 else (-60.0 if x < -60.0 else x), 0.0)
    s = two_to(k - 1.0)
    a, a_rest = two_sum(s, -0.5)
    b, b_rest = two_sum(a, s * r)
    y = 2.0 * (b + (b_rest + (a_rest + s * q)))
    return x if abs(x) < 2.0**-54 else y


# Logarithms: x = 2ᵉ m with √½ ≤ m < √2, f = m − 1, s = f / (2 + f), and
# ln m = 2 artanh s = 2 s (1 + z/3 + z² ATANH(z)) with z = s²  (as Tang 1990 and many before).

ONE_BITS = 1023 << 52
ROOT_HALF_BITS = bits_of(math.sqrt(0.5))
FRACTION_BITS = (1 << 52) - 1
THIRD_HIGH, THIRD_LOW = 0.3333333333333333, 1.850371707708594e-17
ATANH = (
    0.05861526730911215,
    0.05853124154103312,
    0.06667402123457475,
    0.0769229748536785,
    0.09090909167657948,
    0.11111111110828112,
    0.14285714285714682,
    0.2,
)
# relative error 2^-66.4


def exponent_and_mantissa(x: float) -> Pair:
    """e and m of x = 2ᵉ m for 0 < x < ∞; for other x some numbers of these ranges."""
    subnormal = x < 2.0**-1022
    bits = bits_of(x * 2.0**54 if subnormal else x) + (ONE_BITS - ROOT_HALF_BITS)
    e = number_of((1075 << 52) | ((bits >> 52) & 2047)) - (2.0**52 + 1023.0)
    return (e - 54.0 if subnormal else e), number_of((bits & FRACTION_BITS) + ROOT_HALF_BITS)


@exact
def log(x: float) -> float:
    """Natural logarithm, as f − f²/2 + s (f²/2 + ⅔ z + …): the last term is small, so its errors are too."""
    e, m = exponent_and_mantissa(x)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half_f = 0.5 * f
    a = fma(-half_f, f, f)
    a_rest = fma(-half_f, f, f - a)
    b, b_rest = fast_two_sum(e * LN2_HIGH, a)
    tail = fma(s, fma(half_f, f, 2.0 * z * fma(z, polynomial(z, ATANH), THIRD_HIGH)), a_rest)
    y = b + (fma(e, LN2_LOW, b_rest) + tail)
    y = y if x < INF else x
    return y if x > 0.0 else (-INF if x == 0.0 else NAN)


def log_pair(x: float) -> Pair:
    """Natural logarithm as a sum of two numbers, with a relative error below 2⁻⁶⁵."""
    e, m = exponent_and_mantissa(x)
    f = m - 1.0
    d, d_rest = fast_two_sum(1.0, m)
    s, s_rest = quotient(f, 0.0, d, d_rest)
    z, z_rest = two_product(s, s)
    z_rest = fma(2.0 * s, s_rest, z_rest)
    a, a_rest = fast_two_sum(THIRD_HIGH, z * polynomial(z, ATANH))
    b, b_rest = two_product(z, a)
    b_rest += fma(z, a_rest + THIRD_LOW, z_rest * a)
    c, c_rest = two_product(s, b)
    c_rest += fma(s, b_rest, s_rest * b)
    half, half_rest = fast_two_sum(s, c)
    high, rest = fast_two_sum(e * LN2_HIGH, 2.0 * half)
    return fast_two_sum(high, rest + fma(e, LN2_LOW, 2.0 * (half_rest + (c_rest + s_rest))))


@exact
def power(x: float, y: float) -> float:
    """xʸ = e^(y ln |x|), with the sign of x for odd y; NaN for x < 0 and a y that is no integer; 1 for y = 0 or x = 1."""
    a = abs(x)
    high, low = log_pair(a)
    # From 2⁶⁶ on |y| makes every number but 1 overflow or vanish.
    bounded = 2.0**66 if y > 2.0**66 else (-(2.0**66) if y < -(2.0**66) else y)
    product, rest = two_product(bounded, high)
    rest = fma(bounded, low, rest) if abs(product) < 1000.0 else 0.0
    r = exp_of_sum(product, rest)
    rises = y > 0.0
    r = (0.0 if rises else INF) if a == 0.0 else ((INF if rises else 0.0) if a == INF else r)
    whole = nearest(y) == y
    odd = (nearest(0.5 * y) != 0.5 * y) if whole else False
    r = copysign(r, x) if odd else r
    r = NAN if (-INF < x < 0.0) and not whole else r
    r = r if x == x and y == y else NAN
    return 1.0 if y == 0.0 or x == 1.0 else r


# Circular functions: x = n π/2 + r + rest with |r| ≤ π/4. π/2 in three parts of 53 bits; fma makes the first difference
# exact, the second keeps its error (Boldo, Daumas and Li, Formally verified argument reduction with a fused multiply-add).

TWO_OVER_PI = 0.6366197723675814
PI_2 = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
TURNS = 1.5 * 2.0**52  # adding it leaves n in the lowest bits
FAR = 2.0**50
SIN = (
    -7.586697060262141e-13,
    1.6058531618011648e-10,
    -2.505210623244143e-08,
    2.755731921933915e-06,
    -0.00019841269841265065,
    0.008333333333333331,
    -0.16666666666666666,
)
# sin r = r + r³ SIN(r²), relative error 2^-57.1
COS = (
    -1.1382632341807564e-11,
    2.087614626724125e-09,
    -2.755731727172422e-07,
    2.4801587298765676e-05,
    -0.0013888888888887398,
    0.041666666666666664,
)
# cos r = 1 − r²/2 + r⁴ COS(r²), relative error 2^-59.5


def quadrant(x: float) -> tuple[int, float, float]:
    """n mod 4, r and rest.

    All digits of r hold for |x| ≤ 2³⁰, and r is good to 2⁻⁵³ up to 2⁵⁰. From there on neighbouring numbers are a quarter
    and more apart, and x counts as 0; infinity as NaN.
    """
    x = x if abs(x) < FAR else x - x
    turns = nearest(x * TWO_OVER_PI)
    coarse = fma(-turns, PI_2[0], x)
    part, part_rest = two_product(turns, PI_2[1])
    r, rest = two_sum(coarse, -part)
    return bits_of(turns + TURNS) & 3, r, fma(-turns, PI_2[2], rest - part_rest)


def sine_pair(r: float, rest: float) -> Pair:
    """sin(r + rest) for |r| ≤ π/4."""
    z = r * r
    return fast_two_sum(r, fma(r * z, polynomial(z, SIN), rest * fma(-0.5, z, 1.0)))


def cosine_pair(r: float, rest: float) -> Pair:
    """cos(r + rest) for |r| ≤ π/4."""
    z = r * r
    high = fma(-0.5 * r, r, 1.0)
    lost = fma(-0.5 * r, r, 1.0 - high)
    return fast_two_sum(high, lost + fma(z * z, polynomial(z, COS), -(r * rest)))


def circle(n: int, r: float, rest: float) -> float:
    """sin(n π/2 + r + rest)."""
    y = cosine_pair(r, rest)[0] if (n & 1) != 0 else sine_pair(r, rest)[0]
    return -y if (n & 2) != 0 else y


@exact
def sin(x: float) -> float:
    """Sine."""
    n, r, rest = quadrant(x)
    y = circle(n, r, rest)
    return x if abs(x) < TINY else y


@exact
def cos(x: float) -> float:
    """Cosine."""
    n, r, rest = quadrant(x)
    return circle(n + 1, r, rest)


@exact
def tan(x: float) -> float:
    """Tangent: sine by cosine, or minus cosine by sine."""
    n, r, rest = quadrant(x)
    odd = (n & 1) != 0
    s, s_rest = sine_pair(r, rest)
    c, c_rest = cosine_pair(r, rest)
    q, q_rest = quotient(
        -c if odd else s, -c_rest if odd else s_rest, s if odd else c, s_rest if odd else c_rest
    )
    return x if abs(x) < TINY else q + q_rest


# Inverse circular functions: a multiple of π/4 and what is left.

PI_4_HIGH = 0.7853981633974483  # its last three bits are 0: multiples up to π are exact
PI_4_LOW = 3.061616997868383e-17
DIAGONAL = math.sqrt(2.0) - 1.0  # tan π/8
ATAN = (
    0.016285743676588738,
    -0.0345705500898307,
    0.04551592758242537,
    -0.052304541692843966,
    0.05878928984071753,
    -0.06666424884541261,
    0.07692296374965497,
    -0.09090908753498572,
    0.111111111051554,
    -0.14285714285659828,
    0.19999999999999804,
    -0.3333333333333333,
)
# atan u = u + u³ ATAN(u²) for |u| ≤ tan π/8, relative error 2^-58.2
ASIN = (
    0.029612011265156984,
    -0.019241671747082863,
    0.019554513336377578,
    0.0030448799093443393,
    0.009319560794799116,
    0.009621842970094148,
    0.011566459612122493,
    0.013963780012203492,
    0.0173528165403255,
    0.02237215744350722,
    0.03038194447553234,
    0.044642857142551895,
    0.07500000000000118,
    0.16666666666666666,
)
# asin s = s + s³ ASIN(s²) for 0 ≤ s ≤ ½, relative error 2^-58.6


def added_eighths(k: float, v: float, rest: float) -> float:
    """k π/4 + v + rest for |v| ≤ π/4, k an integer."""
    high, lost = fast_two_sum(k * PI_4_HIGH, v)
    return high + (lost + fma(k, PI_4_LOW, rest))


@exact
def atan2(y: float, x: float) -> float:
    """Angle of the point (x, y), in [−π, π], with the sign of y.

    With t = small/big of |x| and |y|, the angle is atan t, or π/4 + atan((t − 1)/(t + 1)) beyond π/8, reflected at the
    diagonal and at the axis.
    """
    a, b = abs(y), abs(x)
    steep = a > b
    big, small = (a if steep else b), (b if steep else a)
    small = (1.0 if small == INF else 0.0) if big == INF else small
    big = 1.0 if big == INF or big == 0.0 else big
    scale = 2.0**-200 if big > 2.0**900 else (2.0**200 if big < 2.0**-800 else 1.0)
    big, small = big * scale, small * scale
    tilted = small > DIAGONAL * big
    up, up_rest = two_sum(small, -big)
    down, down_rest = two_sum(small, big)
    u, u_rest = quotient(
        up if tilted else small,
        up_rest if tilted else 0.0,
        down if tilted else big,
        down_rest if tilted else 0.0,
    )
    rest = fma(u * (u * u), polynomial(u * u, ATAN), u_rest)
    k, sign = (1.0 if tilted else 0.0), 1.0
    k, sign = (2.0 - k if steep else k), (-sign if steep else sign)
    left = copysign(1.0, x) < 0.0
    k, sign = (4.0 - k if left else k), (-sign if left else sign)
    angle = copysign(added_eighths(k, sign * u, sign * rest), y)
    return angle if x == x and y == y else NAN


@exact
def atan(x: float) -> float:
    """Arc tangent."""
    return atan2(x, 1.0)


def half_arc(x: float) -> tuple[bool, float, float]:
    """Whether |x| ≤ ½, and s + rest: asin |x| there, else half of acos |x| = 2 asin √((1 − |x|)/2)."""
    a = abs(x)
    near = a <= 0.5
    z = a * a if near else 0.5 - 0.5 * a
    root = sqrt(z)
    s = a if near else root
    lost = 0.0 if near else fma(-root, root, z) / (2.0 * root if root > 0.0 else 1.0)
    return near, s, fma(s * z, polynomial(z, ASIN), lost)


@exact
def asin(x: float) -> float:
    """Arc sine; NaN for |x| > 1."""
    near, s, rest = half_arc(x)
    factor = 1.0 if near else -2.0
    return copysign(added_eighths(0.0 if near else 2.0, factor * s, factor * rest), x)


@exact
def acos(x: float) -> float:
    """Arc cosine; NaN for |x| > 1."""
    near, s, rest = half_arc(x)
    negative = x < 0.0
    k = 2.0 if near else (4.0 if negative else 0.0)
    factor = (1.0 if negative else -1.0) if near else (-2.0 if negative else 2.0)
    return added_eighths(k, factor * s, factor * rest)


# Hyperbolic functions: from e^|x| as a pair and its reciprocal, sinh for |x| < 1 as x + x³ SINH(x²).

SINH = (
    7.746178593018927e-13,
    1.6057679623801635e-10,
    2.5052117695907823e-08,
    2.7557319191381816e-06,
    0.00019841269841324198,
    0.008333333333333299,
    0.16666666666666666,
)
# relative error 2^-56.6


def half_hyperbolic(a: float) -> tuple[Pair, Pair]:
    """½ sinh a and ½ cosh a for a ≥ 0, as pairs."""
    k, r, q = exponential(710.6 if a > 710.6 else a, 0.0)
    one, lost = fast_two_sum(1.0, r)
    e, e_rest = fast_two_sum(one, lost + q)
    i, i_rest = quotient(1.0, 0.0, e, e_rest)
    up, down = two_to(k - 2.0), two_to(-2.0 - (1000.0 if k > 1000.0 else k))
    rest = up * e_rest
    s, s_rest = fast_two_sum(up * e, -(down * i))
    c, c_rest = fast_two_sum(up * e, down * i)
    half = 0.5 * a
    z = a * a
    p, p_rest = fast_two_sum(half, half * z * polynomial(z, SINH))
    small = a < 1.0
    s, s_rest = (p if small else s), (p_rest if small else s_rest + (rest - down * i_rest))
    return (s, s_rest), (c, c_rest + (rest + down * i_rest))


@exact
def sinh(x: float) -> float:
    """Hyperbolic sine."""
    (s, rest), _ = half_hyperbolic(abs(x))
    return x if abs(x) < TINY else copysign(2.0 * (s + rest), x)


@exact
def cosh(x: float) -> float:
    """Hyperbolic cosine."""
    _, (c, rest) = half_hyperbolic(abs(x))
    return 2.0 * (c + rest)


@exact
def tanh(x: float) -> float:
    """Hyperbolic tangent; beyond 22 it is ±1."""
    a = abs(x)
    (s, s_rest), (c, c_rest) = half_hyperbolic(22.0 if a > 22.0 else a)
    q, rest = quotient(s, s_rest, c, c_rest)
    return x if a < TINY else copysign(q + rest, x)


@exact
def modulo(x: float, y: float) -> float:
    """x − y ⌊x/y⌋ with the sign of y, exact for |x/y| < 2⁵³; 0 beyond."""
    q = floor(x / y)
    r = fma(-q, y, x)
    return r
