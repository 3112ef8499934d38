"""How the checks of a scenario must agree with the rest of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from particlesim.checks.check import Check, Initial
from particlesim.checks.quantities import FIELD_QUANTITIES, VECTOR_FIELDS
from particlesim.emitters import Emitter
from particlesim.expressions.parser import attributes_read, reads
from particlesim.groups.group import Group
from particlesim.model.attributes import OPTIONAL
from particlesim.model.mistakes import Invalid
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.ledger_columns import booked, totals
from particlesim.scenario.tables import Tables, distinct
from particlesim.scenario.timegrid import TOLERANCE, TimeGrid
from particlesim.trajectory.fields import FIELDS, short_name


def check_labels(scenario: Tables) -> tuple[str, ...]:
    """A name of its own for every check."""
    return distinct(check.label() for check in scenario.checks)


def disagreements(scenario: Tables) -> Iterator[Invalid]:
    """Checks of quantities that there are not, of unknown groups, and two of one name."""
    named: dict[str, int] = {}
    for k, check in enumerate(scenario.checks):
        yield from _quantity(scenario, check, k)
        if check.name is not None and check.name in named:
            other = ("checks", named[check.name], "name")
            yield Invalid(
                f"two checks are called {check.name!r}", ("checks", k, "name"), ((other, "the other one"),)
            )
        if check.name is not None:
            named.setdefault(check.name, k)


def _quantity(scenario: Tables, check: Check, k: int) -> Iterator[Invalid]:
    at = ("checks", k)
    known = totals(scenario)
    name = check.quantity
    whole = name in VECTOR_FIELDS and check.reference is not None
    if name not in known and name not in FIELD_QUANTITIES and not whole:
        yield _unknown(scenario, name, k)
        return
    groups = [group.name for group in scenario.groups]
    if check.group is not None and check.group not in groups:
        hint = did_you_mean(check.group, groups)
        yield Invalid(f"unknown group {check.group!r}", (*at, "group"), allowed=", ".join(groups), hint=hint)
    if name in FIELD_QUANTITIES and check.statistic is None and not check.of_each:
        allowed = '"min", "max", "mean" or "percentile"'
        yield Invalid(
            f"{name} is a number for every particle; a check needs a statistic of it",
            (*at, "quantity"),
            allowed=f"statistic = {allowed}",
        )
    if name in known:
        yield from _total(check, k)
    looked = [group for group in scenario.groups if check.group in (None, group.name)]
    if name in OPTIONAL and looked and not any(group.may_have(name) for group in looked):
        yield Invalid(f"no particle here has a {name}", (*at, "quantity"))
    if check.expression is not None:
        yield from _expression(check, k, looked)
    if check.reference is not None:
        yield from _reference(scenario, check, k)


def _total(check: Check, k: int) -> Iterator[Invalid]:
    """What does not go with a quantity of the whole simulation."""
    at, name = ("checks", k), check.quantity
    if check.statistic is not None:
        yield Invalid(f"{name} is one number; there is no statistic of it", (*at, "statistic"))
    if name != "count":
        for key in ("group", "region"):
            if getattr(check, key) is not None:
                yield Invalid(
                    f"{name} is a sum over all {'groups' if key == 'group' else 'of space'}", (*at, key)
                )


def _expression(check: Check, k: int, looked: list[Group]) -> Iterator[Invalid]:
    """What particles do not have, and an expression reads."""
    node, at = check.expected(), ("checks", k, "expression")
    for group in looked:
        if isinstance(group, Emitter) and reads(node, Initial):
            yield Invalid(
                f"the particles of {group.name!r} are emitted, they are not there at the start",
                at,
                hint="name a group of [[particles]] with group",
            )
        for name in sorted(attributes_read([node]) & OPTIONAL):
            if not group.may_have(name):
                yield Invalid(f"the particles of {group.name!r} have no {name}", at)


def _reference(scenario: Tables, check: Check, k: int) -> Iterator[Invalid]:
    """A reference holds fields, and those only that are recorded."""
    at, field = ("checks", k), check.quantity.partition(".")[0]
    if field not in FIELDS or check.statistic is not None:
        yield Invalid(
            "a reference compares a field of particles, particle by particle",
            (*at, "statistic" if field in FIELDS else "quantity"),
            allowed=", ".join((*VECTOR_FIELDS, *FIELD_QUANTITIES)),
        )
    elif field not in (recorded := ("position", *scenario.recorded_fields())):
        names = [name for name in recorded if name not in ("position", "group")]
        fields = ", ".join(f'"{name}"' for name in (*names, field))
        yield Invalid(
            f"{field} is not recorded, so a reference does not hold it",
            (*at, "quantity"),
            hint=f"to record it: fields = [{fields}] under [output]",
        )


def _of_particles(scenario: Tables, name: str) -> str | None:
    """What "balls.x", "vx" and the like are called in checks."""
    group, _, short = name.rpartition(".")
    long = next((one for one in FIELD_QUANTITIES if short in (one, short_name(one))), None)
    if long is None or group not in ("", *(each.name for each in scenario.groups)):
        return None
    return f'quantity = "{long}"' + (f', group = "{group}"' if group else "")


def _unknown(scenario: Tables, name: str, k: int) -> Invalid:
    place = ("checks", k, "quantity")
    known = (*totals(scenario), *FIELD_QUANTITIES)
    unbooked = () if scenario.output.work else booked(scenario)
    if name in unbooked:
        switched = "work" in scenario.output.model_fields_set
        return Invalid(
            f"{name} is not in the ledger, as work is not recorded",
            place,
            ((("output", "work"), "switched off here"),) if switched else (),
            hint="to record it: work = true under [output]",
        )
    components = [one for one in (*known, *unbooked) if one.startswith(f"{name.partition('.')[0]}.")]
    hint = did_you_mean(name, (*known, *unbooked))
    if name == name.partition(".")[0] and components:
        hint = "name a component: " + ", ".join(components)
    elif name.startswith("potential."):
        hint = "of forces, those count that have a potential energy: " + (", ".join(components) or "none")
    elif name == "pressure":
        hint = (
            "it is that of motion and of forces between particles, in a box that is periodic along all axes: not where "
            "springs, rods, pins or impulses (contact without stiffness) carry some of it"
        )
    elif name.startswith("died."):
        hint = "particles die of: " + (", ".join(components) or "nothing here")
    elif name.startswith("work.") and hint is None:
        hint = "work is done by: " + (", ".join(components) or "nothing")
    else:
        hint = _of_particles(scenario, name) or hint
    return Invalid(f"unknown quantity {name!r}", place, allowed=", ".join(known), hint=hint)


def check_step(grid: TimeGrid, at: float) -> int | None:
    """The frame's step at a time, None when no frame is there."""
    for step in _neighbours(grid, at):
        if math.isclose(step * grid.dt, at, rel_tol=TOLERANCE, abs_tol=TOLERANCE * grid.dt):
            return step
    return None


def _neighbours(grid: TimeGrid, at: float) -> list[int]:
    """Steps of the frames around a time."""
    below = min(math.floor(at / grid.dt + TOLERANCE) // grid.every * grid.every, grid.steps)
    return list(dict.fromkeys((below, min(below + grid.every, grid.steps))))


def untimely(scenario: Tables, grid: TimeGrid) -> Iterator[Invalid]:
    """Checks at times without a frame."""
    for k, check in enumerate(scenario.checks):
        if isinstance(check.at, str) or check_step(grid, check.at) is not None:
            continue
        place = ("checks", k, "at")
        if check.at > grid.duration:
            end = ((("simulation", "duration"), f"the run ends at {grid.duration:g} s"),)
            yield Invalid("a check after the end of the run", place, end)
            continue
        near = " and ".join(f"{step * grid.dt:.10g} s" for step in _neighbours(grid, check.at))
        yield Invalid(
            f"there is no frame at {check.at:.10g} s", place, hint=f"the nearest frames are at {near}"
        )
