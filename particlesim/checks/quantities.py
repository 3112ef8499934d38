"""What a check can ask for: names and units of totals and of fields."""

from __future__ import annotations

from typing import Annotated, Any, get_args

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.units import (
    QUANTITY_ERROR,
    Joules,
    JouleSeconds,
    Metres,
    MetresPerSecond,
    MetresPerSecondSquared,
    Newtons,
    NewtonSeconds,
    Number,
    Pascals,
    RadiansPerSecond,
    Seconds,
    Unit,
    shown,
)
from particlesim.trajectory.fields import FIELDS

AXES = ("x", "y", "z")
COUNTS = ("count", "born", "died", "broken", "missed_crossings")
"""Whole numbers, which there are without a ledger, too; 'died.CAUSE' and 'broken.SPRINGS' are parts of them."""
MOTION = ("kinetic", "potential", "energy", "energy.drift")
VECTORS = ("momentum", "angular_momentum")
WORK, BALANCE, ROTATION = "work", "balance", "kinetic.rotation"

TOTALS = (
    "count",
    "born",
    "died",
    *MOTION,
    *(name for vector in VECTORS for name in (vector, *(f"{vector}.{axis}" for axis in AXES))),
)
"""Quantities that every simulation has; `scenario.ledger_columns` knows those that a scenario adds."""

VECTOR_FIELDS = tuple(spec.name for spec in FIELDS.values() if spec.components == 3 and spec.kind == "float")


def axes_of(field: str) -> tuple[str, ...]:
    """Names of the components of a field; quaternions begin with w."""
    return AXES if FIELDS[field].components == 3 else ("w", *AXES)


FIELD_QUANTITIES = tuple(
    name
    for spec in FIELDS.values()
    if spec.kind == "float"
    for name in (
        [spec.name] if spec.components == 1 else [f"{spec.name}.{axis}" for axis in axes_of(spec.name)]
    )
)
"""Quantities of every particle, which a statistic makes one number."""

_UNITS: dict[str, Any] = {
    "count": Number,
    "born": Number,
    "died": Number,
    "broken": Number,
    "missed_crossings": Number,
    "kinetic": Joules,
    "potential": Joules,
    "energy": Joules,
    "work": Joules,
    "balance": Joules,
    "pressure": Pascals,
    "momentum": NewtonSeconds,
    "angular_momentum": JouleSeconds,
    "position": Metres,
    "velocity": MetresPerSecond,
    "orientation": Number,
    "angular_velocity": RadiansPerSecond,
    "speed": MetresPerSecond,
    "acceleration": MetresPerSecondSquared,
    "force": Newtons,
    **{name: attribute.measure for name, attribute in ATTRIBUTES.items()},
    "age": Seconds,
}


def is_count(quantity: str) -> bool:
    """Whether a quantity is a number of things, not a sum of the ledger."""
    return quantity.partition(".")[0] in COUNTS


def is_never_negative(quantity: str) -> bool:
    """Whether a quantity is a number of things, an energy of motion, a speed or an age."""
    return is_count(quantity) or quantity.partition(".")[0] in ("kinetic", "speed", "age")


def unit_of(quantity: str) -> Unit | None:
    """The unit of a quantity, None for a name that is none."""
    marked = Number if quantity == "energy.drift" else _UNITS.get(quantity.partition(".")[0])
    return None if marked is None else next(mark for mark in get_args(marked) if isinstance(mark, Unit))


class InUnitOfQuantity:
    """Marks a number in the unit of the table's `quantity`; text carries a unit of that kind, such as "3 m".

    `difference` marks a distance of two such values: 5 degC are then 5 K.
    """

    def __init__(self, *, difference: bool = False) -> None:
        self._difference = difference

    def _validate(self, value: object, info: ValidationInfo) -> object:
        if not isinstance(value, str):
            return value
        quantity = info.data.get("quantity", "")
        unit = unit_of(str(quantity))
        if unit is None:
            message = f"{shown(value)} has a unit, and no quantity {shown(quantity)} is known"
            raise PydanticCustomError(QUANTITY_ERROR, "{message}", {"message": message})
        try:
            return (unit.difference() if self._difference else unit).parse(value)
        except ValueError as error:
            raise PydanticCustomError(QUANTITY_ERROR, "{message}", {"message": str(error)}) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_before_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        limits = {key: value for key, value in handler(schema).items() if key != "type"}
        return {
            **limits,
            "anyOf": [{"type": "number"}, {"type": "string"}],
            "description": "Number in the SI unit of the quantity, or text with a unit of its kind.",
        }


QuantityValue = Annotated[float, InUnitOfQuantity()]
QuantityDistance = Annotated[float, InUnitOfQuantity(difference=True)]
