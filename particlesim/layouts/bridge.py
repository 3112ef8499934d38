"""A bridge: a deck on two trusses, or hung from two cables."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import SHEAR, STRUCTURAL, Mesh
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, MetresPerSecond, Vector
from particlesim.sampling.random_streams import Streams

Length = Annotated[Metres, Gt(0)]
Place = Literal["ends", "left", "right", "towers", "supports", "deck"]


class Bridge(Mesh):
    """A bridge along x: a deck between z = −width/2 and width/2, and above each of its sides a truss or a cable.

    Particles: the deck bay after bay (front, back), then the upper nodes likewise. Structural springs are the beams: along
    and across the deck, the upper chords or cables, verticals or hangers, and what joins both sides above. Shear springs
    brace the bays of the deck, of the upper side and of the trusses with diagonals, which in trusses fall towards the
    middle, as Pratt's do.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, SHEAR)

    type: Literal["bridge"] = "bridge"
    form: Literal["truss", "suspension"] = "truss"
    """A truss above each side, or a cable from tower to tower with hangers."""
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Position of the left end, in the middle of the deck."""
    length: Length
    """Length of the deck."""
    width: Length
    """Width of the deck."""
    height: Length
    """Height of the trusses, or of the towers."""
    bays: Annotated[int, Field(ge=2, le=1000, strict=True)]
    """Bays along the deck."""
    sag: Length | None = None
    """How far a cable hangs below the towers in the middle; 0.8 of their height unless given."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""
    pinned: Place | Annotated[tuple[Place, ...], Field(min_length=1)] | None = "supports"
    """What nothing moves: the ends of the deck (or one: left, right), the tops of the towers, or both ("supports")."""

    @model_validator(mode="after")
    def _hangs(self) -> Bridge:
        if self.sag is not None and self.form == "truss":
            raise invalid("a truss does not sag", at=("sag",), also=[(("form",), "truss")])
        if self.sag is not None and self.sag >= self.height:
            raise invalid("the cable would hang below the deck", at=("sag",), also=[(("height",), "height")])
        if self.form == "truss" and "towers" in (self.pinned or ()):
            raise invalid("a truss has no towers", at=("pinned",), hint='form = "suspension" has')
        return self

    def _upper(self) -> range:
        """Bays at whose ends there are upper nodes: a truss ends one bay before the deck."""
        return range(1, self.bays) if self.form == "truss" else range(self.bays + 1)

    def number(self) -> int:
        return 2 * (self.bays + 1 + len(self._upper()))

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        deck, upper = np.arange(self.bays + 1), np.array(self._upper())
        station = np.repeat(np.concatenate([deck, upper]), 2) / self.bays
        side = np.tile([0.5, -0.5], len(station) // 2)
        height: Floats = np.zeros(len(upper)) + self.height
        if self.form == "suspension":
            # A parabola: the load of the deck is spread evenly along x.
            sag = 0.8 * self.height if self.sag is None else self.sag
            height = self.height - 4 * sag * (upper / self.bays) * (1 - upper / self.bays)
        y = np.repeat(np.concatenate([np.zeros(len(deck)), height]), 2)
        position = np.stack([station * self.length, y, side * self.width])[:, first : first + count]
        moving = np.repeat(np.array(self.velocity)[:, None], position.shape[1], axis=1)
        return Placed(np.array(self.origin)[:, None] + position, moving)

    def _nodes(self) -> tuple[Ints, Ints]:
        """Indices of the deck [bays + 1, 2] and of the upper nodes [.., 2]."""
        index = np.arange(self.number(), dtype=np.int64).reshape(-1, 2)
        return index[: self.bays + 1], index[self.bays + 1 :]

    def edges(self, kind: str) -> Ints:
        return self._beams() if kind == STRUCTURAL else self._braces()

    def _beams(self) -> Ints:
        deck, upper = self._nodes()
        below = deck[np.array(self._upper())]
        pairs = [(deck[:-1], deck[1:]), (upper[:-1], upper[1:]), (below, upper)]
        across = [deck, upper]
        if self.form == "truss":  # the end posts, which fall to the ends of the deck
            pairs += [(deck[:1], upper[:1]), (deck[-1:], upper[-1:])]
        found = [np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs]
        return np.concatenate([*found, *across])

    def _braces(self) -> Ints:
        deck, upper = self._nodes()
        levels = [deck, upper] if self.form == "truss" else [deck]
        found = [np.stack([a[:-1, s], a[1:, 1 - s]], axis=1) for a in levels for s in (0, 1)]
        if self.form == "truss":
            at = np.array(self._upper())
            for k, (left, right) in enumerate(pairwise(at.tolist())):
                # In the left half the diagonal falls to the right, in the right half to the left.
                falls = left + right < self.bays or (left + right == self.bays and k % 2 == 0)
                top, foot = (k, right) if falls else (k + 1, left)
                found.append(np.stack([upper[top], deck[foot]], axis=1))
        return np.concatenate(found)

    def places(self) -> dict[str, Ints]:
        deck, upper = self._nodes()
        ends = np.concatenate([deck[0], deck[-1]])
        towers = np.empty(0, np.int64)
        if self.form == "suspension":
            towers = np.concatenate([upper[0], upper[-1]])
        return {
            "ends": ends,
            "left": deck[0],
            "right": deck[-1],
            "towers": towers,
            "supports": np.concatenate([ends, towers]),
            "deck": deck.ravel(),
        }
