"""The sizes with which particles and springs without a radius are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from particlesim.render.kernels.records import Array
from particlesim.render.scene.bodies import Bodies
from particlesim.render.scene.extents import Survey
from particlesim.scenario.rendering import RenderSettings


@dataclass(frozen=True)
class Sizes:
    """Sizes in pictures with some settings: of a scene, with `bodies` of springs and surfaces in it, whose half extent is
    `scale` [m]; `own`: whether particles are drawn with the radii that they have."""

    settings: RenderSettings
    scene: Survey
    bodies: Bodies
    scale: float
    own: bool

    def radius(self) -> float:
        """Radius [m] of particles that have none of their own."""
        if self.settings.particle_radius is not None:
            return self.settings.particle_radius
        if self.own and self.scene.radius > 0:
            return self.scene.radius
        crowd = max(self.scene.count, 1) ** (-1 / 3)
        spheres = self.settings.look == "spheres"
        share = np.clip(0.24 * crowd, 0.0012, 0.03) if spheres else np.clip(0.12 * crowd, 0.001, 0.012)
        return float(share) * self.scale

    def line_radii(self) -> Array:
        """Radius [m] of the tubes that springs are drawn as, for each owner of lines.

        By itself a tenth of the springs' length, but thick enough to be seen in the whole scene, unless there are so
        many that they would cover each other, and no thicker than a rod.
        """
        bodies, wanted = self.bodies, self.settings.line_radius
        if isinstance(wanted, float):
            return np.full(len(bodies.owners), wanted)
        crowd = np.log10(max(len(bodies.owner), 1))
        least = float(np.interp(crowd, [3.0, 5.0], [0.0028, 0.001]))
        radii = np.empty(len(bodies.owners))
        for k, name in enumerate(bodies.owners):
            rest = np.concatenate(
                [bodies.lines.rest[bodies.owner == k], bodies.links.rest[bodies.links.owner == k]]
            )
            typical = float(np.median(rest)) if len(rest) else 0.0
            own = np.clip(0.1 * typical, least * self.scale, 0.007 * self.scale)
            radii[k] = (wanted or {}).get(name, own)
        return radii

    def _height(self) -> int:
        """Height of pictures [samples]."""
        return self.settings.size[1] * self.settings.supersampling

    def least_tube(self) -> float:
        """Smallest drawn radius of a tube [samples]."""
        samples = self.settings.supersampling
        return 0.5 * samples * max(self._height() / samples / 1080, 0.8)

    def least(self) -> float:
        """Smallest drawn radius of a particle [samples]: a lone ball stays a ball, a million dots stay apart."""
        samples = self.settings.supersampling
        if self.bodies:  # they give the scene its scale: what is small beside them is
            return 0.75 * samples
        at_1080 = np.interp(np.log10(max(self.scene.count, 1)), [0.3, 1.8, 4.0], [11.0, 6.0, 1.0])
        return float(max(at_1080 * self._height() / 1080, 0.75 * samples))
