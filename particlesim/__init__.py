"""psim: particle simulations from declarative files."""

from particlesim.version import __version__

__all__ = ["__version__"]
