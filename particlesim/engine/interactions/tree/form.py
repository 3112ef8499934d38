"""What is known of an evaluation while kernels are compiled: order, signs of the sources, softening, and which results.

Each choice is the type of a tuple, since kernels are compiled for the types of their arguments.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from particlesim.compiler.intrinsics import BLOCK
from particlesim.engine.interactions.tree.indices import columns

EXACTEST = 8
"""The least order with the roots of most digits."""
CANCELS = 6
"""The order from which errors are asked for that are near those of the other roots, where charges cancel."""


class OneSign(NamedTuple):
    """All sources have the same sign: about their centre of mass they have no dipole."""


class BothSigns(NamedTuple):
    """Sources attract and repel."""


class Plummer(NamedTuple):
    """f = 1/√(r² + ε²), ε = 0 too."""

    square: float


class Spline(NamedTuple):
    """f of a cubic spline's mass of radius h; 1/r from there on."""

    radius: float


class Gradient(NamedTuple):
    """The gradient of Σ w f is wanted."""


class Height(NamedTuple):
    """Σ w f is wanted, and its gradient."""


class Form(NamedTuple):
    """The form of an evaluation. `order`: as many None as the order p."""

    order: tuple[None, ...]
    signs: Any
    softening: Any
    wanted: Any


def in_box(form: Any, scale: Any) -> Any:
    """The form where lengths are `scale` times as long."""
    softening = form.softening
    if isinstance(softening, Plummer):
        return Form(form.order, form.signs, Plummer(softening.square * scale * scale), form.wanted)
    return Form(form.order, form.signs, Spline(softening.radius * scale), form.wanted)


def order_of(form: Any) -> int:
    """p."""
    return len(form.order)


def root_order(form: Any) -> int:
    """The order with which 1/r of near pairs is as exact as is needed: charges of both signs cancel, as in a crystal, and
    leave forces that are a part in thousands of those of pairs."""
    order = order_of(form)
    return EXACTEST if isinstance(form.signs, BothSigns) and order >= CANCELS else order


def first_degree(form: Any) -> int:
    """The lowest degree of polynomials that is needed."""
    return 0 if isinstance(form.wanted, Height) else 1


def moment_columns(form: Any) -> Any:
    """Where the degrees of moments begin in a row."""
    return columns(0, order_of(form) - 1, 1 if isinstance(form.signs, OneSign) else -1)


def field_columns(form: Any) -> Any:
    """Where the degrees of polynomials begin in a row."""
    return columns(first_degree(form), order_of(form))


def in_blocks(numbers: int) -> int:
    """The length of a row of so many numbers that ends with a whole vector."""
    return -(-numbers // BLOCK) * BLOCK


def softening_square(form: Any) -> float:
    """ε² of far cells."""
    return float(form.softening.square) if isinstance(form.softening, Plummer) else 0.0


def softening_reach(form: Any) -> float:
    """Distance below which f is not that of far cells."""
    return float(form.softening.radius) if isinstance(form.softening, Spline) else 0.0
