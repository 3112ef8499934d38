"""Periodic boxes: what acts across them has an end, and what holds particles back is the same in all images."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders import Collider, Plane
from particlesim.interactions.far import FarInteraction
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.vectors import unit
from particlesim.sampling.shapes import Shape
from particlesim.scenario.box import PeriodicBox
from particlesim.scenario.reach import collider_tables, interacting, touches_by_surfaces
from particlesim.scenario.tables import Tables

BOX: Path = ("simulation", "box")


def repeated(scenario: Tables) -> Iterator[Invalid]:
    """Everything in a periodic box makes sense in all of its images."""
    box = scenario.simulation.box
    if box is None:
        yield from _unboxed(scenario)
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
        if emitter.shape is not None and (axis := _is_beyond(emitter.shape, box)) is not None:
            low, size = box.origin["xyz".index(axis)], box.size["xyz".index(axis)]
            yield Invalid(
                f"{emitter.name!r} gives birth outside of the periodic box along {axis}",
                ("emitters", k, "shape"),
                ((BOX, "here"),),
                allowed=f"{axis} from {low:g} to {low + size:g} m",
            )
        if emitter.die is not None and emitter.die.outside is not None:
            yield Invalid(
                "nothing gets outside of a periodic box: what leaves it comes back on the other side",
                ("emitters", k, "die", "outside"),
                ((BOX, "here"),),
                hint='a lifetime ends them, or a plane with contact = "kill" along an axis that is not periodic',
            )


def _is_beyond(shape: Shape, box: PeriodicBox) -> str | None:
    """The first periodic axis along which all of a shape is outside of a box; one that reaches across a side is not."""
    sides = zip("xyz", box.periodic, shape.middle(), shape.half_sizes(), box.origin, box.size, strict=True)
    for axis, periodic, middle, half, low, size in sides:
        if periodic and abs(middle - low - size / 2) - half > size / 2 * (1 + 1e-9):
            return axis
    return None


def _unboxed(scenario: Tables) -> Iterator[Invalid]:
    """What says something of a mesh where nothing repeats."""
    for k, each in enumerate(scenario.interactions):
        if each.method == "mesh":
            yield Invalid(
                "a mesh sums over all images of a box that is periodic along all axes, and there is none",
                ("interactions", k, "method"),
                allowed='"auto", "direct"' if each.lacks_multipoles() else '"auto", "direct", "tree"',
                hint="[simulation] box = { size = [10, 10, 10] } (m) makes one",
            )
        elif (
            isinstance(each, FarInteraction)
            and each.method == "auto"
            and "accuracy" in each.model_fields_set
            and (why := each.lacks_multipoles())
        ):
            yield Invalid(f"there is no error to allow: {why}", ("interactions", k, "accuracy"))


def _reaches(scenario: Tables, box: PeriodicBox) -> Iterator[Invalid]:
    """Interactions end within half of the box, so that one image of every particle is enough; or all images act."""
    axis, shortest = min(
        ((k, size) for k, size in enumerate(box.size) if box.periodic[k]), key=lambda each: each[1]
    )
    for k, each in enumerate(scenario.interactions):
        here: Path = ("interactions", k)
        summed = isinstance(each, FarInteraction) and each.lacks_a_mesh() is None
        if summed and each.method in ("auto", "mesh"):
            assert isinstance(each, FarInteraction)
            yield from _images(each, here, box, shortest)
        elif each.method == "tree":
            yield Invalid(
                "a tree does not see the images of a periodic box",
                (*here, "method"),
                ((BOX, "here"),),
                allowed='"auto", "mesh"' if summed else '"auto", "direct", "neighbours"',
            )
        elif touches_by_surfaces(each, interacting(each, scenario.groups)):
            yield Invalid(
                "triangles and edges do not touch across the sides of a periodic box",
                here,
                ((BOX, "a periodic box"),),
                hint="surfaces = false has particles alone touch, also across them",
            )
        elif each.touching():
            continue
        elif (reach := each.reach()) is None:
            yield Invalid(
                f"{each.label} has no end, and in a periodic box every image of every particle would act; "
                + (
                    "only a mesh sums over all images" if summed else "there is no sum over all images for it"
                ),
                here,
                ((BOX, "a periodic box"),),
                hint='method = "mesh"'
                if summed
                else f'cutoff = {shortest / 2:g} (m) or less, best with shift = "force", ends it',
            )
        elif reach > shortest / 2:
            key = ("cutoff",) if each.cutoff is not None else ()
            yield Invalid(
                f"{each.label} reaches {reach:g} m, beyond half of the box, where it would meet two images of a particle",
                (*here, *key),
                (((*BOX, "size", axis), f"half of it is {shortest / 2:g} m"),),
                allowed=f"up to {shortest / 2:g} m, or a larger box",
            )


SIDES = (1e-50, 1e29)
"""Sides of a box [m] for which numbers hold all powers of distances, and neighbour lists find particles."""
WIDEST = 100.0
"""Softenings over the longest side of a box beyond which they are slips of the hand: no force is left."""


def _images(each: FarInteraction, here: Path, box: PeriodicBox, shortest: float) -> Iterator[Invalid]:
    """Sums over all images, by a mesh."""
    if (softening := each.far_softening()) > WIDEST * (longest := max(box.size)):
        yield Invalid(
            f"a softening of {softening:g} m in a box of {longest:g} m leaves no force",
            (*here, "softening"),
            ((BOX, "here"),),
            allowed=f"up to {WIDEST * longest:g} m",
        )
    least, most = SIDES
    for axis, size in enumerate(box.size):
        if not least <= size <= most:
            yield Invalid(
                f"a side of {size:g} m: sums over all images take powers of it that no number holds",
                (*BOX, "size", axis),
                ((here, "summed by a mesh"),),
                allowed=f"{least:g} to {most:g} m; other units of length",
            )
            return
    if not all(box.periodic):
        axes = " and ".join("xyz"[k] for k in range(3) if not box.periodic[k])
        yield Invalid(
            f"{each.label} has no end, and a sum over all images needs a box that is periodic along all axes; "
            f"this one is not along {axes}",
            (*here, "method") if each.method == "mesh" else here,
            (((*BOX, "periodic"), "here"),),
            hint="periodic = [true, true, true] and a box with much room along the other axes, "
            f"or cutoff = {shortest / 2:g} (m) or less",
        )
    elif each.near_reach() > shortest / 2:
        yield Invalid(
            f"the spline of {each.label} reaches {each.near_reach():g} m, beyond half of the box, where it would meet two "
            "images of a particle",
            (*here, "softening"),
            (((*BOX, "size"), f"half of its shortest side is {shortest / 2:g} m"),),
            hint='a smaller softening, or softened = "plummer"',
        )


def _cut_by(collider: Collider, box: PeriodicBox) -> str | None:
    """Why a collider is not the same in all images of a box; None if it is."""
    if not isinstance(collider, Plane):
        return "a collider stands in one image of a periodic box alone, and particles would go through the others"
    across = ["xyz"[k] for k, part in enumerate(unit(collider.normal)) if abs(part) > 0 and box.periodic[k]]
    if across:
        return f"a plane with a normal along {' and '.join(across)} cuts a periodic box"
    return None
