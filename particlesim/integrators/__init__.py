"""Time integrators: one method per file, each a table of coefficients that checks itself at import.

To add a method, write its file, add one line to `METHODS` and its name to the options of its family.
"""

from typing import Annotated, Literal

from particlesim.integrators.adaptive import Adaptive, AdaptiveName, EmbeddedRungeKutta
from particlesim.integrators.adaptive_euler import ADAPTIVE_EULER
from particlesim.integrators.backward_euler import BACKWARD_EULER
from particlesim.integrators.base import Composition, Method, RungeKutta, Verlet
from particlesim.integrators.bdf2 import BDF2
from particlesim.integrators.dop853 import DOP853
from particlesim.integrators.explicit_euler import EXPLICIT_EULER
from particlesim.integrators.heun import HEUN
from particlesim.integrators.ias15 import IAS15, GaussRadau, GaussRadauMethod
from particlesim.integrators.implicit import BackwardEuler, Implicit, ImplicitMethod, ImplicitName
from particlesim.integrators.implicit_midpoint import IMPLICIT_MIDPOINT
from particlesim.integrators.midpoint import MIDPOINT
from particlesim.integrators.options import FixedStep, FixedStepName, Options
from particlesim.integrators.rk3 import RK3
from particlesim.integrators.rk4 import RK4
from particlesim.integrators.rk45 import RK45
from particlesim.integrators.stormer_verlet import STORMER_VERLET
from particlesim.integrators.symplectic_euler import SYMPLECTIC_EULER
from particlesim.integrators.trapezoidal import TRAPEZOIDAL
from particlesim.integrators.velocity_verlet import VELOCITY_VERLET
from particlesim.integrators.whfast import WHFAST, WisdomHolman, WisdomHolmanMethod
from particlesim.integrators.yoshida4 import YOSHIDA4
from particlesim.model.variants import Tagged

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        SYMPLECTIC_EULER,
        EXPLICIT_EULER,
        MIDPOINT,
        HEUN,
        RK3,
        RK4,
        STORMER_VERLET,
        VELOCITY_VERLET,
        YOSHIDA4,
        ADAPTIVE_EULER,
        RK45,
        DOP853,
        IAS15,
        WHFAST,
        BACKWARD_EULER,
        TRAPEZOIDAL,
        IMPLICIT_MIDPOINT,
        BDF2,
    )
}

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
]
