"""Springs from bodies to particles of other islands.

Such particles are guests among the bodies in every step, as those that touch bodies are (`grains`). The spring gives both
ends the impulse h f, with f where both are in the middle of the step, the particle by its velocity alone; then the particle
goes back by h Δv/2 and makes its own step with its new velocity. So momentum and angular momentum are kept to rounding, and
the step is of second order: of its terms h² [A, S]/2 with the spring S and whatever else A moves particles nothing is left.
A damper sees the velocity in the middle of the step: by then what else acts has changed it by half of what it did in the
step before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from particlesim.engine.rigid.spring_layout import Laid
from particlesim.engine.rigid.springs import BodySprings
from particlesim.engine.rigid.visit import Visitors, among
from particlesim.engine.state.group_state import GroupState
from particlesim.model.arrays import Floats, Ints


class Ties:
    """The springs to particles among those that are laid out, and the particles."""

    def __init__(self, laid: Sequence[Laid], particles: Mapping[str, GroupState]) -> None:
        self._sets = [(each.springs, each.tied) for each in laid if each.tied is not None]
        names = dict.fromkeys(name for _, name in self._sets)
        self._states = {name: particles[name] for name in names}
        self.rows: dict[str, Ints] = {
            name: np.unique(np.concatenate([s.second for s, tied in self._sets if tied == name]))
            for name in names
        }
        """Of every group, the rows of the particles that hang on bodies."""
        self.left = {name: state.v[:, self.rows[name]].astype(float) for name, state in self._states.items()}
        """Their velocities before their own last steps [m/s], shape [3, n]."""

    def __bool__(self) -> bool:
        return bool(self._sets)

    def visitors(self) -> Visitors:
        """All these particles as they are."""
        none = np.zeros((4, len(self._states), 1))
        return among([(state, self.rows[name]) for name, state in self._states.items()], none)

    def lean(self, chosen: Sequence[tuple[GroupState, Ints]]) -> Floats:
        """By how much what else acts on visitors, rows of groups, changes their velocities until the middle of the step
        [m/s], shape [3, visitors]."""
        parts = [np.zeros((3, len(rows))) for _, rows in chosen]
        for part, (state, rows) in zip(parts, chosen, strict=True):
            if state.name in self.rows:
                mine = self.rows[state.name]
                part[:, np.searchsorted(rows, mine)] = 0.5 * (state.v[:, mine] - self.left[state.name])
        return np.concatenate(parts, axis=1)

    def remember(self) -> None:
        """Particles are about to make their own steps."""
        for name, state in self._states.items():
            self.left[name][:] = state.v[:, self.rows[name]]

    def springs(self, visitors: Visitors, bodies: int) -> tuple[BodySprings, ...]:
        """The springs where visitors, who are among them, come after so many bodies."""
        order = np.argsort(visitors.id)

        def place(springs: BodySprings, name: str) -> BodySprings:
            ids = self._states[name].id[springs.second]
            return springs._replace(second=bodies + order[np.searchsorted(visitors.id, ids, sorter=order)])

        return tuple(place(springs, str(name)) for springs, name in self._sets)

    def forces(self, pull: Floats) -> dict[str, tuple[Ints, Floats]]:
        """Of every group the rows, and the forces on them [N], shape [n, 3]; `pull` is what acts on all visitors [n, 6]."""
        found, first = {}, 0
        for name, rows in self.rows.items():
            found[name] = rows, pull[first : first + len(rows), :3].copy()
            first += len(rows)
        return found
