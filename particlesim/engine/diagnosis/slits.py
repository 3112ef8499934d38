"""What colliders do between the particles of cloth, ropes and hair: where contact keeps it out, and where nothing does."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from particlesim.bodies import Bodies
from particlesim.colliders import Collider
from particlesim.engine.interactions.surfaces.deepest import deepest_of, own_shape
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.world import World
from particlesim.groups.group import Particles
from particlesim.laws.registry import bend
from particlesim.layouts.mesh import STRUCTURAL
from particlesim.model.arrays import Ints
from particlesim.scenario.reach import has_extent, interacting, meetings_of, touches_by_surfaces

ROUND = ("sphere", "capsule", "cylinder")
"""Colliders that bulge everywhere by a radius."""
THROUGH = 0.99
"""How deep, as a part of its thickness, a sheet is where its middle is inside of a collider, but for rounding."""
MOST = 3
"""Colliders that a message names."""


def slits(world: World) -> Iterator[str]:
    """A sentence for every surface or strand that colliders reach into between its particles: at the start, or without
    contact. And for every one that touches bodies, which only its particles do."""
    yield from _on_bodies(world)
    covered = {
        group.name
        for each in world.scenario.interactions
        if touches_by_surfaces(each, groups := interacting(each, world.scenario.groups))
        for group in groups
    }
    for island, structure in zip(world.islands, world.graph.islands, strict=True):
        for state, group, colliders in zip(island.states, structure.groups, structure.colliders, strict=True):
            if not (has_extent(group) and state.count and isinstance(group, Particles)):
                continue
            layout = group.layout.open(world.scenario.folder)
            held = [each for each in colliders if each.contact != "kill"]
            held = [each for each in held if bend(own_shape(each.body())) >= 0]
            hard = [each for each in held if each.contact in ("bounce", "slide") and not each.soft]
            triangles, edges = layout.triangles(), layout.edges(STRUCTURAL)
            if group.name in covered:
                corners = triangles.T if triangles.size else edges.T[[0, 1, 1]]
                yield from _crossing(state, corners, bool(triangles.size), hard)
                if loose := [each for each in held if each not in hard]:
                    yield (
                        f"only the particles of {state.name!r} touch {_listed(loose)}: what is sharp or thin comes through "
                        "between them, as what yields or holds does not touch edges and triangles"
                    )
            else:
                yield from _open(state, edges, bool(triangles.size), held)


def _on_bodies(world: World) -> Iterator[str]:
    """Bodies that may get between the particles of a sheet or a strand."""
    groups = {group.name: group for group in world.scenario.groups}
    states = {state.name: state for state in world.states}
    for each in meetings_of(world.scenario):
        group, state, bodies = groups[each.particles], states[each.particles], groups[each.bodies]
        if not (
            isinstance(group, Particles) and isinstance(bodies, Bodies) and has_extent(group) and state.count
        ):
            continue
        layout = group.layout.open(world.scenario.folder)
        longest, thin = _longest(state, layout.edges(STRUCTURAL)), float(state.radius[: state.count].min())
        size = getattr(bodies.shape, "radius", None) if bodies.shape.type in ROUND else None
        half = longest * (0.5**0.5 if layout.triangles().size else 0.5)
        if (longest > 2 * thin) if size is None else (thin < 0.99 * (math.hypot(size, half) - size)):
            yield (
                f"only the particles of {state.name!r} touch the bodies {each.bodies!r}: their edges and corners come "
                f"through between particles that are {longest:.2g} m apart; colliders, which motions may lead, do not"
            )


def _longest(state: GroupState, edges: Ints) -> float:
    """The longest edge between neighbours [m]."""
    x = state.position.astype(float)
    return float(np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1).max(initial=0.0))


def _called(each: Collider) -> str:
    return f"{each.kind} {each.name or ''}".rstrip()


def _listed(colliders: list[Collider]) -> str:
    names = [_called(each) for each in colliders[:MOST]]
    return ", ".join(names) + (f" and {len(colliders) - MOST} more" if len(colliders) > MOST else "")


def _crossing(state: GroupState, corners: Ints, face: bool, colliders: list[Collider]) -> Iterator[str]:
    """Colliders that a sheet or a strand crosses at the start."""
    x, r = state.x[:, : state.count].astype(float), state.radius[: state.count].astype(float)
    corners = np.ascontiguousarray(corners, np.int64)
    for each in colliders:
        gaps = np.empty(corners.shape[1])
        deepest_of(face, each.body(), x, r, corners, 0.0, gaps)
        through = gaps < -THROUGH * r[corners].max(axis=0)
        if through.any():
            place = ", ".join(f"{number:.3g}" for number in x[:, corners[:, through.argmax()]].mean(axis=1))
            yield (
                f"{state.name!r} goes through {_called(each)} at the start, between its particles, the first time near "
                f"({place}) m: contact pushes it to the nearest side, and may leave it there"
            )


def _open(state: GroupState, edges: Ints, face: bool, colliders: list[Collider]) -> Iterator[str]:
    """Colliders that may get between the particles of a sheet or a strand.

    Particles with radius r stand off from a ball of radius R by r. The middle of a triangle with corners there and a
    circumscribed circle of radius ρ is √((R + r)² − ρ²) from the centre, which should not be less than R.
    """
    longest, sharp = _longest(state, edges), list[Collider]()
    half = longest * (0.5**0.5 if face else 0.5)
    thin = float(state.radius[: state.count].min())
    for each in colliders:
        size = getattr(each, "radius", None)
        if each.kind not in ROUND or size is None:
            if longest > 2 * thin:
                sharp.append(each)
            continue
        least = math.hypot(size, half) - size
        if thin < 0.99 * least:
            yield (
                f"between its particles the surface of {state.name!r} may reach into {_called(each)} by up to "
                f"{least - thin:.2g} m, as straight edges cut into round shapes: an interaction of type contact for it "
                f"keeps it out, and so do shorter edges, or a radius of {least:.2g} m"
            )
    if sharp:
        yield (
            f"only the particles of {state.name!r} touch {_listed(sharp)}: what is sharp or thin comes through between "
            "them; an interaction of type contact for it keeps all of it out"
        )
