"""Elementary functions in the kernels' own language: the same bits on every machine, and free of branches.

They use only operations whose rounding IEEE 754 defines, in a fixed order, with fma where it is written; selects take one of
two computed numbers, so a loop over particles vectorises. Special values are those of C (annex F); the sign of a NaN is left
to the machine by IEEE 754. The errors stated are bounds that `tests/compiler/test_elementary.py` and, with more points,
`tests/bench/accuracy_elementary.py` check, in units of the last place (ulp); half a ulp is the least possible.

Sources: Cody and Waite, Software Manual for the Elementary Functions (1980), for the reduction of arguments; Muller,
Elementary Functions: Algorithms and Implementation, for polynomials and the care of errors; Dekker (1971) and Knuth, The
Art of Computer Programming, volume 2, for sums and products with their rounding errors. All use the same technique: a result
is the sum of a large and a small number, a *pair*, and only that last sum is rounded. The polynomials are our own.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from particlesim.compiler.intrinsics import (
    bits_of,
    copysign,
    exact,
    floor,
    fma,
    nearest,
    number_of,
    often,
    sqrt,
)
from particlesim.compiler.polynomials import ASIN, ATAN, ATANH, COS, EXP, SIN, SINH
from particlesim.compiler.roots import polynomial

INF = math.inf
NAN = math.nan
TINY = 2.0**-28  # below, an odd function f(u) = u + c u³ + … is u, and keeps the sign of zero

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


def horner_pair(c: Pair, x: Pair, total: Pair) -> Pair:
    """c + x·total, a step of Horner's scheme in pairs, for |c| ≥ |x·total|."""
    product, lost = two_product(x[0], total[0])
    high, rest = fast_two_sum(c[0], product)
    return high, rest + (c[1] + fma(x[0], total[1], fma(x[1], total[0], lost)))


def quotient(a: float, a_rest: float, b: float, b_rest: float) -> Pair:
    """(a + a_rest) / (b + b_rest) as its rounded value and a correction, from the remainder of the division."""
    q = a / b
    return q, (fma(-q, b, a) + (a_rest - q * b_rest)) / b


# Powers of two, by the bits of the exponent.

SHIFT = 2.0**52 + 1023.0  # adding it leaves k + 1023 in the lowest bits


def two_to(k: float) -> float:
    """2ᵏ for an integer −1022 ≤ k ≤ 1023."""
    return number_of((bits_of(k + SHIFT) & 2047) << 52)


def scaled(x: float, k: float) -> float:
    """x·2ᵏ in two steps, for results that overflow or become subnormal."""
    half = floor(0.5 * k)
    return x * two_to(half) * two_to(k - half)


# Exponential functions: x = k ln 2 + r with |r| ≤ ln 2 / 2, and eˣ = 2ᵏ (1 + r + r²/2 + r³ EXP(r)).

LOG2_E = 1.4426950408889634
LN2_HIGH = 0.6931471805598903  # 42 bits: k·LN2_HIGH is exact for every exponent k
LN2_LOW = 5.497923018708371e-14


def exponential(x: float, rest: float) -> tuple[float, float, float]:
    """k, g and q of e^(x + rest) = 2ᵏ (1 + g + q), where g is r + r²/2 rounded, and q small. The rest is small too."""
    k = nearest(x * LOG2_E)
    r, r_rest = fast_two_sum(fma(-k, LN2_HIGH, x), fma(-k, LN2_LOW, rest))
    half = 0.5 * r
    g = fma(half, r, r)
    lost = fma(half, r, r - g) + fma(r_rest, r, r_rest)
    return k, g, fma(r * r * r, polynomial(r, EXP), lost)


def exp_of_sum(x: float, rest: float) -> float:
    """e^(x + rest), also where it overflows or vanishes."""
    x = 710.0 if x > 710.0 else (-746.0 if x < -746.0 else x)
    k, g, q = exponential(x, rest)
    one, lost = fast_two_sum(1.0, g)
    return scaled(one + (lost + q), k)


@often
@exact
def exp(x: float) -> float:
    """eˣ, within 0.53 ulp; 0.76 where the result is subnormal."""
    return exp_of_sum(x, 0.0)


@often
@exact
def expm1(x: float) -> float:
    """eˣ − 1, also for small x, within 0.62 ulp: half of it is (s − ½) + s g + s q with s = 2ᵏ⁻¹."""
    k, g, q = exponential(710.0 if x > 710.0 else (-60.0 if x < -60.0 else x), 0.0)
    s = two_to(k - 1.0)
    a, a_rest = two_sum(s, -0.5)
    b, b_rest = two_sum(a, s * g)
    y = 2.0 * (b + (b_rest + (a_rest + s * q)))
    return x if abs(x) < 2.0**-54 else y


# Logarithms: x = 2ᵉ m with √½ ≤ m < √2, f = m − 1, s = f / (2 + f), and
# ln m = 2 artanh s = 2 s (1 + z/3 + z²/5 + z³ ATANH(z)) with z = s².

ONE_BITS = 1023 << 52
ROOT_HALF_BITS = bits_of(math.sqrt(0.5))
FRACTION_BITS = (1 << 52) - 1
THIRD = (0.3333333333333333, 1.850371707708594e-17)
FIFTH = (0.2, -1.1102230246251566e-17)


def exponent_and_mantissa(x: float) -> Pair:
    """e and m of x = 2ᵉ m for 0 < x < ∞; for other x some numbers of these ranges."""
    subnormal = x < 2.0**-1022
    bits = bits_of(x * 2.0**54 if subnormal else x) + (ONE_BITS - ROOT_HALF_BITS)
    e = number_of((1075 << 52) | ((bits >> 52) & 2047)) - (2.0**52 + 1023.0)
    return (e - 54.0 if subnormal else e), number_of((bits & FRACTION_BITS) + ROOT_HALF_BITS)


@often
@exact
def log(x: float) -> float:
    """Natural logarithm within 0.65 ulp.

    ln m = f − f²/2 + s (f²/2 + 2 z (⅓ + …)): the last term is small, so its errors are too.
    """
    e, m = exponent_and_mantissa(x)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half_f = 0.5 * f
    a = fma(-half_f, f, f)
    a_rest = fma(-half_f, f, f - a)
    b, b_rest = fast_two_sum(e * LN2_HIGH, a)
    t = fma(z, fma(z, polynomial(z, ATANH), FIFTH[0]), THIRD[0])
    tail = fma(s, fma(half_f, f, 2.0 * z * t), a_rest)
    y = b + (fma(e, LN2_LOW, b_rest) + tail)
    y = y if x < INF else x
    return y if x > 0.0 else (-INF if x == 0.0 else NAN)


def log_pair(x: float) -> Pair:
    """Natural logarithm as a sum of two numbers, with a relative error below 2⁻⁶⁷."""
    e, m = exponent_and_mantissa(x)
    f = m - 1.0
    d, d_rest = fast_two_sum(1.0, m)
    s, s_rest = quotient(f, 0.0, d, d_rest)
    z, z_rest = two_product(s, s)
    square = z, fma(2.0 * s, s_rest, z_rest)
    series = horner_pair(FIFTH, square, (polynomial(z, ATANH), 0.0))
    series = horner_pair(THIRD, square, series)
    series = horner_pair((1.0, 0.0), square, series)
    half, half_rest = two_product(s, series[0])
    half_rest += fma(s, series[1], s_rest * series[0])
    high, rest = fast_two_sum(e * LN2_HIGH, 2.0 * half)
    return fast_two_sum(high, rest + fma(e, LN2_LOW, 2.0 * half_rest))


@often
@exact
def power(x: float, y: float) -> float:
    """xʸ within 0.55 ulp; 0.76 where the result is subnormal.

    It is e^(y ln |x|), with the sign of x for odd y; NaN for x < 0 and a y that is no integer; 1 for y = 0 and for x = 1.
    """
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
    odd = whole & (nearest(0.5 * y) != 0.5 * y)
    r = copysign(r, x) if odd else r
    r = r if whole | (x >= 0.0) | (a == INF) else NAN
    r = r if (x == x) & (y == y) else NAN
    return 1.0 if (y == 0.0) | (x == 1.0) else r


# Circular functions: x = n π/2 + r + rest with |r| ≤ π/4. π/2 in three parts of 53 bits; fma makes the first difference
# exact, the second keeps its error (Boldo, Daumas and Li, Formally verified argument reduction with a fused multiply-add).

TWO_OVER_PI = 0.6366197723675814
PI_2 = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
SIXTH = 1.0 / 6.0
TURNS = 1.5 * 2.0**52  # adding it leaves n in the lowest bits
FAR = 2.0**50


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
    cube = r * z
    fifth = fma(cube * z, polynomial(z, SIN), fma(-0.5 * z, rest, rest))
    return fast_two_sum(r, fma(cube, -SIXTH, fifth))


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


@often
@exact
def sin(x: float) -> float:
    """Sine within 0.72 ulp; for large x see `quadrant`."""
    n, r, rest = quadrant(x)
    y = circle(n, r, rest)
    return x if abs(x) < TINY else y


@often
@exact
def cos(x: float) -> float:
    """Cosine within 0.72 ulp; for large x see `quadrant`."""
    n, r, rest = quadrant(x)
    return circle(n + 1, r, rest)


@often
@exact
def tan(x: float) -> float:
    """Tangent within 0.9 ulp: sine by cosine, or minus cosine by sine."""
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


def added_eighths(k: float, v: float, rest: float) -> float:
    """k π/4 + v + rest, for an integer k that is 0 or has |v| ≤ k π/4."""
    high, lost = fast_two_sum(k * PI_4_HIGH, v)
    return high + (lost + fma(k, PI_4_LOW, rest))


@often
@exact
def atan2(y: float, x: float) -> float:
    """Angle of the point (x, y), in [−π, π], with the sign of y.

    With t = small/big of |x| and |y|, it is atan t, or π/4 + atan((t − 1)/(t + 1)) beyond π/8, mirrored at the diagonal
    and at the axis. Within 0.67 ulp; 0.76 where the remainder of a division underflows.
    """
    a, b = abs(y), abs(x)
    steep = a > b
    big, small = (a if steep else b), (b if steep else a)
    small = (1.0 if small == INF else 0.0) if big == INF else small
    big = 1.0 if (big == INF) | (big == 0.0) else big
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
    z = u * u
    rest = fma(u * z, polynomial(z, ATAN), fma(-z, u_rest, u_rest))
    k = 1.0 if tilted else 0.0
    k = 2.0 - k if steep else k
    left = copysign(1.0, x) < 0.0
    k = 4.0 - k if left else k
    sign = 1.0 if steep == left else -1.0
    angle = copysign(added_eighths(k, sign * u, sign * rest), y)
    return angle if (x == x) & (y == y) else NAN


@often
@exact
def atan(x: float) -> float:
    """Arc tangent within 0.67 ulp."""
    return atan2(x, 1.0)


def half_arc(x: float) -> tuple[bool, float, float]:
    """Whether |x| ≤ ½, and s + rest: asin |x| there, else half of acos |x| = 2 asin √((1 − |x|)/2)."""
    a = abs(x)
    near = a <= 0.5
    z = a * a if near else 0.5 - 0.5 * a
    root = sqrt(z)
    s = a if near else root
    lost = 0.0 if near else fma(-root, root, z) / (2.0 * root if root > 0.0 else 1.0)
    return near, s, fma(s * z, polynomial(z, ASIN), fma(0.5 * z, lost, lost))


@often
@exact
def asin(x: float) -> float:
    """Arc sine within 0.67 ulp; NaN for |x| > 1."""
    near, s, rest = half_arc(x)
    factor = 1.0 if near else -2.0
    return copysign(added_eighths(0.0 if near else 2.0, factor * s, factor * rest), x)


@often
@exact
def acos(x: float) -> float:
    """Arc cosine within 0.67 ulp; NaN for |x| > 1."""
    near, s, rest = half_arc(x)
    negative = x < 0.0
    k = 2.0 if near else (4.0 if negative else 0.0)
    factor = (1.0 if negative else -1.0) if near else (-2.0 if negative else 2.0)
    return added_eighths(k, factor * s, factor * rest)


# Hyperbolic functions: from e^|x| as a pair and its reciprocal, sinh for |x| < ½ by its polynomial.


def half_hyperbolic(a: float) -> tuple[Pair, Pair]:
    """½ sinh a and ½ cosh a for a ≥ 0, as pairs; the halves do not overflow before the whole does."""
    k, g, q = exponential(710.6 if a > 710.6 else a, 0.0)
    one, lost = fast_two_sum(1.0, g)
    e, e_rest = fast_two_sum(one, lost + q)
    i, i_rest = quotient(1.0, 0.0, e, e_rest)
    up, down = two_to(k - 2.0), two_to(-2.0 - (1000.0 if k > 1000.0 else k))
    rest = up * e_rest
    s, s_rest = fast_two_sum(up * e, -(down * i))
    c, c_rest = fast_two_sum(up * e, down * i)
    half = 0.5 * a
    z = a * a
    p, p_rest = fast_two_sum(half, half * z * polynomial(z, SINH))
    small = a < 0.5
    s, s_rest = (p if small else s), (p_rest if small else s_rest + (rest - down * i_rest))
    return (s, s_rest), (c, c_rest + (rest + down * i_rest))


@often
@exact
def sinh(x: float) -> float:
    """Hyperbolic sine within 0.65 ulp."""
    (s, rest), _ = half_hyperbolic(abs(x))
    return x if abs(x) < TINY else copysign(2.0 * (s + rest), x)


@often
@exact
def cosh(x: float) -> float:
    """Hyperbolic cosine within 0.55 ulp."""
    _, (c, rest) = half_hyperbolic(abs(x))
    return 2.0 * (c + rest)


@often
@exact
def tanh(x: float) -> float:
    """Hyperbolic tangent within 0.62 ulp."""
    a = abs(x)
    (s, s_rest), (c, c_rest) = half_hyperbolic(22.0 if a > 22.0 else a)  # there it is 1
    q, rest = quotient(s, s_rest, c, c_rest)
    return x if a < TINY else copysign(q + rest, x)


@often
@exact
def modulo(x: float, y: float) -> float:
    """x − y ⌊x/y⌋, with the sign of y: exact, or rounded once where it crosses 0; 0 for |x/y| ≥ 2⁵³; NaN for y = 0."""
    q = floor(x / (NAN if y == 0.0 else y))
    r = x if (abs(y) == INF) & (abs(x) < INF) else fma(-q, y, x)
    r = r + y if r * copysign(1.0, y) < 0.0 else r
    r = copysign(r, y) if r == 0.0 else r
    return x - x if abs(q) >= 2.0**53 else r


NAMED_ALIKE = (exp, expm1, log, sin, cos, tan, sinh, cosh, tanh)
ELEMENTARY: dict[Any, Any] = (
    {getattr(library, f.__name__): f for library in (np, math) for f in NAMED_ALIKE}
    | {math.asin: asin, math.acos: acos, math.atan: atan, math.atan2: atan2, math.pow: power}
    | {np.arcsin: asin, np.arccos: acos, np.arctan: atan, np.arctan2: atan2, np.power: power, np.mod: modulo}
)
"""What kernels call instead of the functions of NumPy and of the C library, once they are compiled."""
