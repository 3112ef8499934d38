"""Constants of nature, in SI units (CODATA 2018)."""

from __future__ import annotations

import math

GRAVITATIONAL_CONSTANT = 6.67430e-11
"""G [m³/(kg s²)]."""
VACUUM_PERMITTIVITY = 8.8541878128e-12
"""ε₀ [F/m]."""
COULOMB_CONSTANT = 1 / (4 * math.pi * VACUUM_PERMITTIVITY)
"""1/(4π ε₀) [N m²/C²]."""
BOLTZMANN_CONSTANT = 1.380649e-23
"""k_B [J/K]."""
