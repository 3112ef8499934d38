"""Quantities: what they accept, that conversion is exact, and that messages teach."""

import contextlib
import math
import subprocess
import sys
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
import pytest
from annotated_types import Ge, Gt
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from particlesim.model import unit_table, units
from particlesim.model.units import (
    Degrees,
    Hertz,
    Kelvin,
    Kilograms,
    Metres,
    Number,
    RadiansPerSecond,
    Vector,
)


def parse(kind: Any, value: object) -> float:
    return TypeAdapter(kind).validate_python(value)


def message(kind: Any, value: object) -> str:
    with pytest.raises(ValidationError) as caught:
        parse(kind, value)
    (error,) = caught.value.errors()
    return error["msg"]


@pytest.mark.parametrize("kind", [value for value in units._UNITS if value.symbol], ids=lambda u: u.symbol)
def test_every_unit_reads_its_own_symbol_and_example(kind: units.Unit) -> None:
    assert kind.parse(f"2.5 {kind.symbol}") == 2.5
    assert math.isfinite(kind.parse(kind.example))


@pytest.mark.parametrize(
    ("kind", "text", "expected"),
    [
        (Metres, "36.6 mm", 0.0366),
        (Metres, "36.6mm", 0.0366),
        (Metres, " -.5e1 in ", -0.127),
        (units.MetresPerSecond, "90 km/h", 25.0),
        (units.SquareMetres, "5 m²", 5.0),
        (units.PerSecond, "150 /s", 150.0),
        (units.PerSecond, "90 / min", 1.5),
        (units.PascalSeconds, "1 kg/(m s)", 1.0),
        (Kelvin, "20 degC", 293.15),
        (Kelvin, "-40 °F", 233.15),
        (units.Pascals, "1 atm", 101325.0),
        (RadiansPerSecond, "60 rpm", 2 * math.pi),
        (Degrees, "0.5 turn", 180.0),
        (Degrees, "20°", 20.0),
        (Number, "40 %", 0.4),
    ],
)
def test_text_converts_exactly(kind: Any, text: str, expected: float) -> None:
    assert parse(kind, text) == expected


@given(st.decimals(min_value=-1000, max_value=1000, places=4))
def test_millimetres_round_once(number: Any) -> None:
    assert parse(Metres, f"{number} mm") == float(number / 1000)


@pytest.mark.parametrize("value", [3, 3.0, np.float64(3), np.float32(3), np.int64(3)])
def test_numbers_of_any_kind_become_floats(value: object) -> None:
    number = parse(Metres, value)
    assert type(number) is float
    assert number == 3.0


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (Metres, "3 kg", 'expected a length such as 0.5 or "36.6 mm", got "3 kg" (mass)'),
        (RadiansPerSecond, "60 Hz", 'an angular velocity such as 0.5 or "60 rpm", got "60 Hz" (frequency)'),
        (Hertz, "60 rpm", "(angular velocity)"),
        (Degrees, "50 %", "(number)"),
        (Number, "45 deg", "(angle)"),
        (Metres, "5", "write 5 without quotes, or add a unit"),
        (Kilograms, "5 kgs", 'unknown unit "kgs"; did you mean "kg"?'),
        (Metres, "5 KM", 'did you mean "km"?'),
        (units.SquareMetres, "5 m2", 'did you mean "m^2"?'),
        (Kelvin, "5 celcius", 'did you mean "celsius"?'),
        (Metres, True, "got true"),
        (Metres, None, "expected a length"),
        (Metres, [1.0], "got a list"),
        (Metres, {"type": "normal"}, "got a table"),
        (Metres, math.nan, "must be finite, got nan"),
        (Metres, -math.inf, "must be finite, got -inf"),
        (Metres, 10**400, "too large"),
        (Metres, "1e999 m", "too large"),
        (Metres, "1e999999999 m", "is not a unit"),
        (Metres, "5 m**9**9**9", "is not a unit"),
        (Metres, "5 __import__('os')", "is not a unit"),
        (Metres, "x" * 1000, "expected a length"),
        (Metres, "", 'got ""'),
        (Metres, "nan m", "expected a length"),
        (Metres, "5 dB/m", "expected a length such as"),
        (Number, "5 dB", "expected a number"),
        (Kelvin, "5 oct K", "expected a temperature"),
    ],
)
def test_wrong_values_say_what_is_expected(kind: Any, value: object, expected: str) -> None:
    assert expected in message(kind, value)


@given(st.text(max_size=30) | st.from_regex(r"\A[0-9]{1,3} [a-zA-Z/*^()²°% 0-9_-]{1,15}\Z"))
def test_no_text_breaks_the_parser(text: str) -> None:
    with contextlib.suppress(ValueError):
        assert isinstance(units._UNITS[1].parse(text), float)


class Ball(BaseModel):
    mass: Annotated[Kilograms, Gt(0)] = Field(description="of the ball")
    position: Vector[Metres]
    radius: Metres = Field(0.0, ge=0, le=1)
    loss: Annotated[Number, Ge(0)] = 0.0


def test_constraints_hold_after_conversion() -> None:
    ball = Ball.model_validate({"mass": "145 g", "position": ["1 mm", 2, 3], "radius": "36.6 mm"})
    assert ball == Ball(mass=0.145, position=(0.001, 2, 3), radius=0.0366)
    with pytest.raises(ValidationError) as caught:
        Ball.model_validate({"mass": "-1 g", "position": [0, 0, 0], "radius": "3 m"})
    assert [(e["type"], e["loc"]) for e in caught.value.errors()] == [
        ("greater_than", ("mass",)),
        ("less_than_equal", ("radius",)),
    ]


def test_schema_has_unit_limits_and_both_forms() -> None:
    properties = Ball.model_json_schema()["properties"]
    mass = properties["mass"]
    assert mass["x-unit"] == "kg"
    assert mass["exclusiveMinimum"] == 0
    assert mass["description"] == "of the ball"
    assert [branch["type"] for branch in mass["anyOf"]] == ["number", "string"]
    assert (properties["radius"]["minimum"], properties["radius"]["maximum"]) == (0, 1)
    assert "in m," in properties["radius"]["description"]
    assert properties["loss"]["x-unit"] == "1"


def test_pint_is_imported_only_for_units_beyond_the_table() -> None:
    program = (
        "import sys; from pydantic import TypeAdapter; from particlesim.model.units import Metres;"
        "adapter = TypeAdapter(Metres); adapter.validate_python(3); assert 'pint' not in sys.modules;"
        "adapter.validate_python('3 inch'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_table_is_that_of_pint() -> None:
    registry = units._registry()
    roots = [registry.parse_units(name) for name in ("m", "kg", "s", "K", "rad")]
    for symbol, (factor, powers) in unit_table.TABLE.items():
        quantity = registry.Quantity(Fraction(1), registry.parse_units(symbol))
        same = registry.Quantity(
            factor, math.prod((u**p for u, p in zip(roots, powers, strict=True)), start=1)
        )
        assert (quantity / same).to_root_units().magnitude == 1, symbol
        assert units._dimension(registry, quantity.units) == units._dimension(registry, same.units), symbol


PAIRS = [
    (unit, symbol) for unit in units._UNITS for symbol in (unit.symbol, unit.example.split(maxsplit=1)[1])
] + [
    (units._VELOCITY, "km/h"),
    (units._VELOCITY, "mm / ms"),
    (units._ACCELERATION, "cm/s/s"),
    (units._ACCELERATION, "m s^-2"),
    (units._ACCELERATION, "m·s⁻²"),
    (units._ANGULAR_VELOCITY, "rpm"),
    (units._ANGULAR_VELOCITY, "deg/min"),
    (units._ANGLE, "mrad"),
    (units._RATE, "/h"),
    (units._RATE, "1 / min"),
    (units._VISCOSITY, "kg/m/s"),
    (units._VISCOSITY, "N*s/m**2"),
    (units._DENSITY, "g/cm³"),
    (units._MASS_RATE, "kg / m s"),  # is kg s/m, and no damping coefficient
    (units._PRESSURE, "N/mm^2"),
    (units._ENERGY, "kW h"),
    (units._ENERGY, "MPa L"),
]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("unit", "symbol"), PAIRS, ids=lambda value: str(value) if isinstance(value, str) else ""
)
@given(st.from_regex(r"[+-]?[0-9]{1,12}(\.[0-9]{0,12})?([eE][+-]?[0-9]{1,2})?", fullmatch=True))
@settings(max_examples=10)
def test_both_ways_give_the_same_bits(unit: units.Unit, symbol: str, digits: str) -> None:
    text = f"{digits} {symbol}"
    quick = unit_table.convert(digits, symbol, unit.symbol)
    if quick is None:
        return
    assert math.copysign(1, quick) == math.copysign(1, unit._by_pint(text, digits, symbol))
    assert quick == unit._by_pint(text, digits, symbol)


def test_common_units_need_no_pint() -> None:
    code = (
        "import sys; from particlesim.model import units; units._ACCELERATION.parse('981 cm/s^2'); "
        "units._VELOCITY.parse('90 km/h'); units._DENSITY.parse('0.6 g/cm^3'); units._ANGULAR_VELOCITY.parse('60 rpm'); "
        "sys.exit('pint' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    "text", ["", "kgm", "m//s", "m *", "(m)", "m^", "m^2^2", "meter", "°C", "m2", "* m", "m s-1", "1 m"]
)
def test_what_the_table_leaves_to_pint(text: str) -> None:
    assert unit_table.scale(text) is None
