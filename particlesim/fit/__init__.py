"""Parameters from data: fit a scenario to measured trajectories, or aim it at a target."""

from particlesim.fit.aim import Aim, Shot, aim
from particlesim.fit.fit import Fit, Parameter, fit
from particlesim.fit.measurements import Measurements, read_measurements
from particlesim.fit.parameters import Range, parse_range

__all__ = [
    "Aim",
    "Fit",
    "Measurements",
    "Parameter",
    "Range",
    "Shot",
    "aim",
    "fit",
    "parse_range",
    "read_measurements",
]
