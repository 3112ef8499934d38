"""Time integrators: one method per file, each a table of coefficients that checks itself at import.

To add a method, write its file, add one line to `METHODS` and its name to the options of its family.
"""

import importlib
from collections.abc import Iterator, Mapping
from typing import Annotated, Literal

from particlesim.integrators.adaptive import Adaptive, AdaptiveName, EmbeddedRungeKutta
from particlesim.integrators.base import Composition, Method, RungeKutta, Verlet
from particlesim.integrators.ias15 import GaussRadau, GaussRadauMethod
from particlesim.integrators.implicit import BackwardEuler, Implicit, ImplicitMethod, ImplicitName
from particlesim.integrators.options import FixedStep, FixedStepName, Options
from particlesim.integrators.whfast import WisdomHolman, WisdomHolmanMethod
from particlesim.model.variants import Tagged


class Methods(Mapping[str, Method]):
    """Methods by their names: "heun" is `HEUN` in `heun.py`. A file is imported when its method is first asked for."""

    def __init__(self, *names: str) -> None:
        self._names = names

    def __getitem__(self, name: str) -> Method:
        if name not in self._names:
            raise KeyError(name)
        module = importlib.import_module(f"particlesim.integrators.{name}")
        method: Method = getattr(module, name.upper())
        return method

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


METHODS = Methods(
    "symplectic_euler",
    "explicit_euler",
    "midpoint",
    "heun",
    "rk3",
    "rk4",
    "stormer_verlet",
    "velocity_verlet",
    "yoshida4",
    "adaptive_euler",
    "rk45",
    "dop853",
    "ias15",
    "whfast",
    "backward_euler",
    "trapezoidal",
    "implicit_midpoint",
    "bdf2",
)

MethodName = Literal[FixedStepName, AdaptiveName, "ias15", "whfast", "backward_euler", ImplicitName]
"""The names of all methods."""

AnyOptions = Annotated[
    FixedStep | Adaptive | GaussRadau | WisdomHolman | BackwardEuler | Implicit, Tagged("method")
]
"""A method by its name, with its options."""

AnyIntegrator = MethodName | AnyOptions
"""What a scenario writes as `integrator`: the name of a method, or a table with its options."""


def method_for(integrator: AnyIntegrator) -> Method:
    """The method that a scenario asks for, with its options."""
    if isinstance(integrator, Options):
        return METHODS[integrator.method].configured(integrator)
    method = METHODS[integrator]
    return method.configured(method.options(method=integrator))


def without_inertia(integrator: AnyIntegrator) -> Method:
    """The method that steps particles without inertia where a scenario asks for this one: itself, or one that needs no
    velocities, with those of the options that were given which it has."""
    method = method_for(integrator)
    if method.first_order is None:
        return method
    other = METHODS[method.first_order]
    given = integrator.model_fields_set if isinstance(integrator, Options) else set()
    shared = {key: getattr(integrator, key) for key in given & other.options.model_fields.keys() - {"method"}}
    return other.configured(other.options.model_validate({"method": other.name, **shared}))


__all__ = [
    "METHODS",
    "Adaptive",
    "AnyIntegrator",
    "AnyOptions",
    "BackwardEuler",
    "Composition",
    "EmbeddedRungeKutta",
    "FixedStep",
    "GaussRadau",
    "GaussRadauMethod",
    "Implicit",
    "ImplicitMethod",
    "Method",
    "MethodName",
    "Options",
    "RungeKutta",
    "Verlet",
    "WisdomHolman",
    "WisdomHolmanMethod",
    "method_for",
    "without_inertia",
]
