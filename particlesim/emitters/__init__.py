"""Where and how particles are born."""

from particlesim.emitters.emitter import Emitter
from particlesim.emitters.schedule import Schedule

__all__ = ["Emitter", "Schedule"]
