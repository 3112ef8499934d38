"""The units that scenarios write most, as exact fractions of metre, kilogram, second, kelvin and radian.

`pint` knows all units, and takes a third of a second to build its registry; with this table most scenarios do without. The
factors are those of pint, so that both ways give the same bits.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache
from typing import NamedTuple


class Scale(NamedTuple):
    """A unit: its factor, and the powers of metre, kilogram, second, kelvin and radian in it."""

    factor: Fraction
    powers: tuple[int, int, int, int, int]

    def times(self, other: Scale, power: int) -> Scale:
        """The product with a power of another unit."""
        m, kg, s, k, rad = (a + power * b for a, b in zip(self.powers, other.powers, strict=True))
        return Scale(self.factor * other.factor**power, (m, kg, s, k, rad))


ONE = Scale(Fraction(1), (0, 0, 0, 0, 0))
_PI = Fraction(31415926535897932384626433832795028841971693993751, 10**49)
_METRE, _KILOGRAM, _SECOND = (1, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 0, 1, 0, 0)
_KELVIN, _RADIAN = (0, 0, 0, 1, 0), (0, 0, 0, 0, 1)

_PREFIXES = {
    "n": Fraction(1, 10**9),
    "u": Fraction(1, 10**6),
    "µ": Fraction(1, 10**6),
    "m": Fraction(1, 1000),
    "c": Fraction(1, 100),
    "": Fraction(1),
    "k": Fraction(1000),
    "M": Fraction(10**6),
    "G": Fraction(10**9),
}
_PREFIXED = {
    "m": Scale(Fraction(1), _METRE),
    "g": Scale(Fraction(1, 1000), _KILOGRAM),
    "s": Scale(Fraction(1), _SECOND),
    "N": Scale(Fraction(1), (1, 1, -2, 0, 0)),
    "Pa": Scale(Fraction(1), (-1, 1, -2, 0, 0)),
    "J": Scale(Fraction(1), (2, 1, -2, 0, 0)),
    "W": Scale(Fraction(1), (2, 1, -3, 0, 0)),
    "Hz": Scale(Fraction(1), (0, 0, -1, 0, 0)),
}

TABLE: dict[str, Scale] = {
    "K": Scale(Fraction(1), _KELVIN),
    "mK": Scale(Fraction(1, 1000), _KELVIN),
    "rad": Scale(Fraction(1), _RADIAN),
    "mrad": Scale(Fraction(1, 1000), _RADIAN),
    "deg": Scale(_PI / 180, _RADIAN),
    "turn": Scale(2 * _PI, _RADIAN),
    "rpm": Scale(2 * _PI / 60, (0, 0, -1, 0, 1)),
    "min": Scale(Fraction(60), _SECOND),
    "h": Scale(Fraction(3600), _SECOND),
    "day": Scale(Fraction(86400), _SECOND),
    "L": Scale(Fraction(1, 1000), (3, 0, 0, 0, 0)),
    "hPa": Scale(Fraction(100), (-1, 1, -2, 0, 0)),
    **{
        prefix + name: Scale(factor * unit.factor, unit.powers)
        for name, unit in _PREFIXED.items()
        for prefix, factor in _PREFIXES.items()
    },
}
"""Units by their symbols; tests compare each with pint."""

_SUPERSCRIPTS = str.maketrans("⁻¹²³⁴", "-1234")
_FACTOR = re.compile(r" ?([*/·]?) ?([A-Za-zµ]+)(?:(?:\*\*|\^)([+-]?\d)|(⁻?[¹²³⁴]))?")


@cache
def scale(symbol: str) -> Scale | None:
    """The unit written as `symbol`, such as "kg/m^3" or "N s/m"; None where the table does not hold all of it.

    Products and quotients are read from left to right, as pint does.
    """
    text = " ".join(symbol.split())
    text = text.removeprefix("1").lstrip() if text.startswith(("1/", "1 /")) else text
    if not text:
        return None
    found, at = ONE, 0
    while at < len(text):
        factor = _FACTOR.match(text, at)
        if factor is None or factor[2] not in TABLE or (at == 0 and factor[1] not in ("", "/")):
            return None
        if at > 0 and not (factor[1] or text[at] == " "):
            return None
        power = int(factor[3] or (factor[4] or "1").translate(_SUPERSCRIPTS))
        found = found.times(TABLE[factor[2]], -power if factor[1] == "/" else power)
        at = factor.end()
    return found


def convert(digits: str, symbol: str, target: str) -> float | None:
    """The number `digits` of one unit in another one, rounded once.

    None where the table does not hold both, or they measure different things. Raises OverflowError.
    """
    unit, wanted = scale(symbol), scale(target)
    if unit is None or wanted is None or unit.powers != wanted.powers:
        return None
    return float(Fraction(digits) * unit.factor / wanted.factor)
