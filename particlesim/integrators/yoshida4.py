"""Fourth-order composition of three leapfrogs (Forest and Ruth; Yoshida), drift first.

w₁ = 1/(2 − 2^⅓), w₀ = −2^⅓ w₁; drifts w₁/2, (w₀ + w₁)/2, (w₀ + w₁)/2, w₁/2; kicks w₁, w₀, w₁.
Source: H. Yoshida, Physics Letters A 150, 262 (1990).
"""

from particlesim.integrators.base import Composition

_W1 = 1 / (2 - 2 ** (1 / 3))
_W0 = 1 - 2 * _W1

YOSHIDA4 = Composition(
    name="yoshida4",
    order=4,
    summary="Yoshida / Forest–Ruth; fourth order, symplectic, time-reversible",
    symplectic=True,
    reversible=True,
    first_order="rk4",
    kicks=(0.0, _W1, _W0, _W1),
    drifts=(_W1 / 2, (_W0 + _W1) / 2, (_W0 + _W1) / 2, _W1 / 2),
    leapfrogs=(_W1, _W0, _W1),
)
