"""Fluids by name: dynamic viscosity [Pa s] and density [kg/m³], 25 °C unless said.

Source: CRC Handbook of Chemistry and Physics; viscosities as tabulated in its sections on fluid properties, densities at
the same temperature. `None` where only the viscosity is well defined.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

from particlesim.model.mistakes import invalid

FluidName = Literal[
    "air",
    "water",
    "liquid_nitrogen",
    "acetone",
    "methanol",
    "benzene",
    "ethanol",
    "mercury",
    "nitrobenzene",
    "propanol",
    "ethylene_glycol",
    "sulfuric_acid",
    "motor_oil_sae_10",
    "olive_oil",
    "motor_oil_sae_40",
    "castor_oil",
    "glycerol",
    "corn_syrup",
    "hfo_380",
    "pitch",
]


class Fluid(NamedTuple):
    """Dynamic viscosity [Pa s], density [kg/m³] or None, and the conditions they hold for."""

    viscosity: float
    density: float | None
    conditions: str


FLUIDS: dict[str, Fluid] = {
    "air": Fluid(1.81e-5, 1.225, "15 °C, 101 325 Pa"),
    "water": Fluid(8.94e-4, 997.0, "25 °C"),
    "liquid_nitrogen": Fluid(1.58e-4, 806.0, "77 K"),
    "acetone": Fluid(3.06e-4, 784.0, "25 °C"),
    "methanol": Fluid(5.44e-4, 787.0, "25 °C"),
    "benzene": Fluid(6.04e-4, 873.0, "25 °C"),
    "ethanol": Fluid(1.074e-3, 785.0, "25 °C"),
    "mercury": Fluid(1.526e-3, 13534.0, "25 °C"),
    "nitrobenzene": Fluid(1.863e-3, 1198.0, "25 °C"),
    "propanol": Fluid(1.945e-3, 800.0, "25 °C"),
    "ethylene_glycol": Fluid(1.61e-2, 1110.0, "25 °C"),
    "sulfuric_acid": Fluid(2.42e-2, 1830.0, "25 °C"),
    "motor_oil_sae_10": Fluid(0.065, None, "20 °C"),
    "olive_oil": Fluid(0.081, 911.0, "25 °C"),
    "motor_oil_sae_40": Fluid(0.319, None, "20 °C"),
    "castor_oil": Fluid(0.985, 957.0, "25 °C"),
    "glycerol": Fluid(1.2, 1261.0, "20 °C"),
    "corn_syrup": Fluid(1.3806, None, "25 °C"),
    "hfo_380": Fluid(2.022, None, "25 °C"),
    "pitch": Fluid(2.3e8, None, "25 °C"),
}

assert set(FLUIDS) == set(get_args(FluidName)), "the names in the schema and in the table differ"

WITH_DENSITY = tuple(name for name, fluid in FLUIDS.items() if fluid.density is not None)
"""Fluids whose density is known, for drag and buoyancy."""


def require_density(fluid: FluidName | None) -> None:
    """Refuse a fluid whose density is not known, for a force whose table gives none."""
    if fluid is None:
        raise invalid("needs the fluid's density", allowed='fluid = "air", or density = 1.225')
    if fluid not in WITH_DENSITY:
        raise invalid(f"no density is tabulated for {fluid}", at=("fluid",), hint="give density as well")
