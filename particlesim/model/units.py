"""Physical quantities as field types: a number in SI units, or text with a unit, checked and in the schema.

    class Spring(BaseModel):
        stiffness: Annotated[NewtonsPerMetre, Gt(0)]
        anchor: Vector[Metres] = (0.0, 0.0, 0.0)

accepts `stiffness = 800`, `stiffness = "0.8 N/mm"` and `anchor = ["12 cm", 0, 0]`; the model then holds plain
floats in SI units, which is also what a type checker sees. Constraints (`Gt`, `Ge`, `Lt`, `Le` of
annotated_types, or `Field(gt=0)`) apply to the converted number and appear in the JSON Schema.

Three rules keep conversions from surprising anyone. Text must name a unit (`"5"` is an error). Angles count
as a dimension: `"60 rpm"` is an angular velocity and `"60 Hz"` is a frequency, neither stands for the other,
although the SI calls both 1/s. Conversion is exact rational arithmetic rounded once: `"36.6 mm"` is the same
float as 0.0366.

pint, which knows all units, is imported when the first text arrives that `unit_table` cannot read, not before.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from particlesim.model import unit_table

if TYPE_CHECKING:
    import pint

QUANTITY_ERROR = "quantity"
"""The error type under which a value that is no such quantity appears in a pydantic ValidationError."""

# An unknown unit is an AttributeError in pint; malformed text and impossible arithmetic are the others.
_PINT_ERRORS = (AttributeError, ValueError, TypeError, ArithmeticError, AssertionError, KeyError)

_LONGEST_TEXT = 100
# Bounded digits and exponents: "1e999999999 m" must not become a number of a billion digits.
_NUMBER = r"[+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,3})?"
_NAME = r"(?:[^\W\d_][^\W¹²³⁴]*|°\w*|%)"
_FACTOR = rf"{_NAME}(?:(?:\*\*|\^)[+-]?\d|⁻?[¹²³⁴])?"
_PRODUCT = rf"{_FACTOR}(?:(?: ?[*/·] ?| ){_FACTOR})*"
_TERM = rf"(?:{_FACTOR}|\({_PRODUCT}\))"
_UNIT = re.compile(rf"(?:1? ?/ ?)?{_TERM}(?:(?: ?[*/·] ?| ){_TERM})*")
_TEXT = re.compile(rf"({_NUMBER})\s*(.*)", re.DOTALL)

_SCHEMA_PATTERN = r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*[^\s\d.+\-].*$"

# pydantic hands constraints on a wrapped type to the schema under the names it uses in Python.
_LIMITS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}

_FAMILIAR = (
    *("m", "mm", "cm", "dm", "km", "um", "nm", "inch", "ft", "yard", "mile", "au", "light_year", "parsec"),
    *("s", "ms", "us", "ns", "min", "hour", "h", "day", "year", "Hz", "kHz", "MHz", "rpm"),
    *("kg", "g", "mg", "ug", "t", "lb", "oz", "N", "mN", "kN", "lbf", "dyn", "J", "kJ", "W", "kW"),
    *("Pa", "hPa", "kPa", "MPa", "GPa", "bar", "mbar", "atm", "psi", "mmHg", "poise", "cP"),
    *("K", "degC", "degF", "deg", "rad", "mrad", "turn", "arcmin", "arcsec", "degree", "radian"),
    *("mph", "kph", "knot", "L", "mL", "litre", "percent", "ppm", "metre", "meter", "second", "minute"),
    *("kilogram", "gram", "newton", "pascal", "kelvin", "celsius", "kilometre", "millimetre", "degrees"),
)


@dataclass(frozen=True)
class Unit:
    """Marks a float as a quantity: `Annotated[float, Unit("m", "a length", "36.6 mm")]`.

    `symbol` is the unit that plain numbers are in ("" for a dimensionless number), `kind` names the quantity
    with its article and `example` is a text that converts to it; both appear in messages and in the schema.
    """

    symbol: str
    kind: str
    example: str
    is_difference: bool = False

    def difference(self) -> Unit:
        """The unit of differences of such quantities: "5 degC" is then 5 K, not 278.15 K."""
        example = "5 K" if self.symbol == "K" else self.example
        return Unit(
            self.symbol, f"{self.kind} difference" if self.symbol == "K" else self.kind, example, True
        )

    @property
    def noun(self) -> str:
        """The kind without its article: 'length'."""
        return self.kind.split(" ", 1)[1]

    def parse(self, value: object) -> float:
        """`value`, a finite number or text with a unit, as a float in this unit.

        Raises ValueError with a message for the user when it is neither or has another dimension.
        """
        if isinstance(value, str):
            return self._from_text(value)
        if isinstance(value, bool) or not isinstance(value, Real):
            raise ValueError(f"{self._expected()}, got {shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            raise ValueError("the number is too large") from None
        if not math.isfinite(number):
            raise ValueError(f"must be finite, got {number}")
        return number

    def _from_text(self, text: str) -> float:
        found = _TEXT.fullmatch(text.strip()) if len(text) <= _LONGEST_TEXT else None
        if found is None:
            raise ValueError(f"{self._expected()}, got {shown(text)}")
        digits, symbol = found.groups()
        if not symbol:
            advice = f'write {digits} without quotes, or add a unit, such as "{self.example}"'
            raise ValueError(f"the text {shown(text)} has no unit: {advice}")
        try:
            number = unit_table.convert(digits, symbol, self.symbol)
        except OverflowError:
            raise ValueError(f"{shown(text)} is too large") from None
        return self._by_pint(text, digits, symbol) if number is None else number

    def _by_pint(self, text: str, digits: str, symbol: str) -> float:
        registry = _registry()
        unit = _unit(registry, symbol)
        target = registry.parse_units(self.symbol)
        wrong = f"{self._expected()}, got {shown(text)}"
        try:
            if _dimension(registry, unit) != _dimension(registry, target):
                raise ValueError(wrong + _kind_of(registry, unit))
            if self.is_difference and registry.Quantity(0, unit).to(target).magnitude != 0:  # as of degC
                unit = registry.parse_units(f"delta_{unit}")
            return float(registry.Quantity(Fraction(digits), unit).to(target).magnitude)
        except OverflowError:
            raise ValueError(f"{shown(text)} is too large") from None
        except (
            AttributeError,
            TypeError,
        ):  # it converts no product with dB and its like, and no fraction of them
            raise ValueError(wrong) from None

    def _expected(self) -> str:
        return f'expected {self.kind} such as 0.5 or "{self.example}"'

    def _validate(self, value: object) -> float:
        try:
            return self.parse(value)
        except ValueError as error:
            raise PydanticCustomError(QUANTITY_ERROR, "{message}", {"message": str(error)}) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        # handler(source): the float with the constraints of Field(gt=0), which pydantic puts before this mark
        return core_schema.no_info_before_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        unit = f" in {self.symbol}" if self.symbol else ""
        inner = handler(schema)
        return {
            **{_LIMITS.get(key, key): value for key, value in inner.items() if key != "type"},
            "anyOf": [{"type": "number"}, {"type": "string", "pattern": _SCHEMA_PATTERN}],
            "description": f'{self.kind.capitalize()}{unit}, or text with a unit such as "{self.example}".',
            "x-unit": self.symbol or "1",
        }


def shown(value: object) -> str:
    """`value` as the file would write it, in at most 40 characters."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    text = f'"{" ".join(value.split())}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 40 else f"{text[:36]} ..."


@cache
def _registry() -> pint.UnitRegistry[Any]:
    """The one registry. It calculates with fractions, so that conversions are exact."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


def _unit(registry: pint.UnitRegistry[Any], symbol: str) -> pint.Unit:
    """The unit written as `symbol`. Raises ValueError with the nearest familiar unit when there is none."""
    text = " ".join(symbol.split())
    if _UNIT.fullmatch(text) is None:
        raise ValueError(f'{shown(symbol)} is not a unit; write units such as "m/s", "kg/m^3" or "N s/m"')
    try:
        return registry.parse_units("1" + text if text.startswith("/") else text)
    except _PINT_ERRORS:
        pass
    for name in re.findall(_NAME, text):
        if not _known(registry, name):
            near = _nearest(name)
            raise ValueError(f"unknown unit {shown(name)}" + (f'; did you mean "{near}"?' if near else ""))
    raise ValueError(f"unknown unit {shown(symbol)}")


def _known(registry: pint.UnitRegistry[Any], name: str) -> bool:
    try:
        registry.parse_units(name)
    except _PINT_ERRORS:
        return False
    return True


def _nearest(name: str) -> str | None:
    """The familiar unit most like `name`; "m2" is meant to be "m^2", and "KG" to be "kg"."""
    if name[:-1] in _FAMILIAR and name[-1] in "234":
        return f"{name[:-1]}^{name[-1]}"
    folded = {unit.lower(): unit for unit in reversed(_FAMILIAR)}
    for candidate in (name.lower(), name.lower().rstrip("s")):
        if candidate in folded:
            return folded[candidate]
    import difflib

    close = difflib.get_close_matches(name.lower(), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def _dimension(registry: pint.UnitRegistry[Any], unit: pint.Unit) -> object:
    """The root units, among which pint, unlike its dimensions, counts the radian."""
    return registry.get_root_units(unit)[1]


def _kind_of(registry: pint.UnitRegistry[Any], unit: pint.Unit) -> str:
    """What `unit` measures, to be added to a message: ' (mass)', or '' when there is no word for it."""
    for known in _UNITS:
        if _dimension(registry, registry.parse_units(known.symbol)) == _dimension(registry, unit):
            return f" ({known.noun})"
    return ""


_NUMBER_UNIT = Unit("", "a number", "50 %")
_LENGTH = Unit("m", "a length", "36.6 mm")
_AREA = Unit("m^2", "an area", "4 cm^2")
_VOLUME = Unit("m^3", "a volume", "2 L")
_TIME = Unit("s", "a duration", "20 ms")
_FREQUENCY = Unit("Hz", "a frequency", "2 kHz")
_RATE = Unit("1/s", "a rate", "150 /s")
_ANGLE = Unit("deg", "an angle", "0.5 rad")
_ANGULAR_VELOCITY = Unit("rad/s", "an angular velocity", "60 rpm")
_ANGULAR_ACCELERATION = Unit("rad/s^2", "an angular acceleration", "0.1 rad/s^2")
_VELOCITY = Unit("m/s", "a velocity", "90 km/h")
_ACCELERATION = Unit("m/s^2", "an acceleration", "981 cm/s^2")
_MASS = Unit("kg", "a mass", "145 g")
_DENSITY = Unit("kg/m^3", "a density", "0.6 g/cm^3")
_FORCE = Unit("N", "a force", "2 kN")
_IMPULSE = Unit("N s", "an impulse", "30 mN s")
_STIFFNESS = Unit("N/m", "a stiffness", "0.8 N/mm")
_MASS_RATE = Unit("kg/s", "a damping coefficient", "5 g/s")
_PRESSURE = Unit("Pa", "a pressure", "1 atm")
_VISCOSITY = Unit("Pa s", "a dynamic viscosity", "1.8e-2 mPa s")
_KINEMATIC = Unit("m^2/s", "a circulation or diffusivity", "3 cm^2/s")
_GRAVITATIONAL = Unit("m^3/s^2", "a gravitational parameter", "398600 km^3/s^2")
_GRAVITATION = Unit("m^3/kg/s^2", "a constant of gravitation", "6.674e-8 cm^3/g/s^2")
_COULOMB = Unit("N m^2/C^2", "a Coulomb constant", "9e9 N m^2/C^2")
_INVERSE_LENGTH = Unit("1/m", "an inverse length", "2 /nm")
_ENERGY_LENGTH = Unit("J m", "an energy times a length", "3e-28 J m")
_HEAT_CAPACITY = Unit("J/K", "a heat capacity", "1.38e-23 J/K")
_TEMPERATURE = Unit("K", "a temperature", "20 degC")
_CHARGE = Unit("C", "an electric charge", "2 uC")
_ENERGY = Unit("J", "an energy", "3 kJ")
_TORQUE = Unit("N m", "a torque", "30 N cm")
_ANGULAR_MOMENTUM = Unit("J s", "an angular momentum", "3 kg m^2/s")

_UNITS = tuple(value for value in list(globals().values()) if isinstance(value, Unit))

Number = Annotated[float, _NUMBER_UNIT]
Metres = Annotated[float, _LENGTH]
SquareMetres = Annotated[float, _AREA]
CubicMetres = Annotated[float, _VOLUME]
Seconds = Annotated[float, _TIME]
Hertz = Annotated[float, _FREQUENCY]
PerSecond = Annotated[float, _RATE]
Degrees = Annotated[float, _ANGLE]
RadiansPerSecond = Annotated[float, _ANGULAR_VELOCITY]
RadiansPerSecondSquared = Annotated[float, _ANGULAR_ACCELERATION]
MetresPerSecond = Annotated[float, _VELOCITY]
MetresPerSecondSquared = Annotated[float, _ACCELERATION]
Kilograms = Annotated[float, _MASS]
KilogramsPerCubicMetre = Annotated[float, _DENSITY]
Newtons = Annotated[float, _FORCE]
NewtonSeconds = Annotated[float, _IMPULSE]
NewtonsPerMetre = Annotated[float, _STIFFNESS]
KilogramsPerSecond = Annotated[float, _MASS_RATE]
Pascals = Annotated[float, _PRESSURE]
PascalSeconds = Annotated[float, _VISCOSITY]
SquareMetresPerSecond = Annotated[float, _KINEMATIC]
CubicMetresPerSecondSquared = Annotated[float, _GRAVITATIONAL]
GravitationalConstant = Annotated[float, _GRAVITATION]
CoulombConstant = Annotated[float, _COULOMB]
PerMetre = Annotated[float, _INVERSE_LENGTH]
JouleMetres = Annotated[float, _ENERGY_LENGTH]
JoulesPerKelvin = Annotated[float, _HEAT_CAPACITY]
Kelvin = Annotated[float, _TEMPERATURE]
KelvinDifference = Annotated[float, _TEMPERATURE.difference()]
Coulombs = Annotated[float, _CHARGE]
Joules = Annotated[float, _ENERGY]
NewtonMetres = Annotated[float, _TORQUE]
JouleSeconds = Annotated[float, _ANGULAR_MOMENTUM]

T = TypeVar("T")
Vector = tuple[T, T, T]
"""Three components: `Vector[Metres]` is a position."""
