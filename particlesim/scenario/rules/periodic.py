"""Periodic boxes: what acts across them has an end, and what holds particles back is the same in all images."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders import Collider, Plane
from particlesim.interactions.contact import Contact
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.vectors import unit
from particlesim.scenario.box import PeriodicBox
from particlesim.scenario.reach import collider_tables
from particlesim.scenario.tables import Tables

BOX: Path = ("simulation", "box")


def repeated(scenario: Tables) -> Iterator[Invalid]:
    """Everything in a periodic box makes sense in all of its images."""
    box = scenario.simulation.box
    if box is None:
        return
    yield from _reaches(scenario, box)
    for path, collider in collider_tables(scenario):
        if why := _cut_by(collider, box):
            yield Invalid(why, path, ((BOX, "a periodic box"),))
    for k, _ in enumerate(scenario.bodies):
        yield Invalid(
            "rigid bodies touch each other in place, not across the boundary of a periodic box",
            ("bodies", k),
            ((BOX, "here"),),
        )
    for k, emitter in enumerate(scenario.emitters):
        if emitter.die is not None and emitter.die.outside is not None:
            yield Invalid(
                "nothing gets outside of a periodic box: what leaves it comes back on the other side",
                ("emitters", k, "die", "outside"),
                ((BOX, "here"),),
                hint='a lifetime ends them, or a plane with contact = "kill" along an axis that is not periodic',
            )


def _reaches(scenario: Tables, box: PeriodicBox) -> Iterator[Invalid]:
    """Interactions end within half of the box, so that one image of every particle is enough."""
    axis, shortest = min(
        ((k, size) for k, size in enumerate(box.size) if box.periodic[k]), key=lambda each: each[1]
    )
    for k, each in enumerate(scenario.interactions):
        here: Path = ("interactions", k)
        if each.method == "tree":
            yield Invalid(
                "a tree does not see the images of a periodic box",
                (*here, "method"),
                ((BOX, "here"),),
                allowed='"auto", "direct", "neighbours"',
            )
        elif isinstance(each, Contact) and not each.soft:
            yield Invalid(
                "impulses are not given across the sides of a periodic box",
                here,
                ((BOX, "a periodic box"),),
                hint='model = "linear" or "hertz" acts across them, too',
            )
        elif each.touching():
            continue
        elif (reach := each.reach()) is None:
            yield Invalid(
                f"{each.label} has no end, and in a periodic box every image of every particle would act; "
                "sums over all images are not supported",
                here,
                ((BOX, "a periodic box"),),
                hint=f'cutoff = {shortest / 2:g} (m) or less, best with shift = "force", ends it',
            )
        elif reach > shortest / 2:
            key = ("cutoff",) if each.cutoff is not None else ()
            yield Invalid(
                f"{each.label} reaches {reach:g} m, beyond half of the box, where it would meet two images of a particle",
                (*here, *key),
                (((*BOX, "size", axis), f"half of it is {shortest / 2:g} m"),),
                allowed=f"up to {shortest / 2:g} m, or a larger box",
            )


def _cut_by(collider: Collider, box: PeriodicBox) -> str | None:
    """Why a collider is not the same in all images of a box; None if it is."""
    if not isinstance(collider, Plane):
        return "a collider stands in one image of a periodic box alone, and particles would go through the others"
    across = ["xyz"[k] for k, part in enumerate(unit(collider.normal)) if abs(part) > 0 and box.periodic[k]]
    if across:
        return f"a plane with a normal along {' and '.join(across)} cuts a periodic box"
    return None
