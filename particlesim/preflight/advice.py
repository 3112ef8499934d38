"""Warnings of choices in a scenario that are legal and seldom meant, for `psim check` and the start of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations_with_replacement

from particlesim.emitters import Emitter
from particlesim.engine.interactions.methods import IN_MATRICES, chosen_in
from particlesim.graph.graph import islands_of, methods_of
from particlesim.groups.group import Group, Particles
from particlesim.integrators import Composition, ImplicitMethod, Method, method_for
from particlesim.interactions import PairInteraction, PairSet
from particlesim.preflight.heavy import too_heavy
from particlesim.scenario.reach import acts_on, held_back, interacting, meetings_of, pair_sets, ties
from particlesim.scenario.scenario import Scenario

PAIR_RATE = 1e9
"""Pairs that a core looks at in a second, about."""
PATIENCE = 3600.0
"""Seconds on one core beyond which psim warns of direct sums over all pairs of a run."""
ONCE = ("gravity", "coulomb", "contact")
"""Interactions that act between two particles once, if at all."""
OF_BOTH = "rk4, dop853 and implicit_midpoint"
"""Some methods that step particles with and without inertia."""
MOST_TURN = 0.5
"""Angle by which a collider may turn in a step [rad]: the chord of the way is 1 % shorter than the arc then."""
EARLY = 0.02
"""Part of the radius of balls by which they may touch a collider too early without a word."""
METHODS_THAT_KEEP = "rk4, heun and stormer_verlet keep their order"


def advice(scenario: Scenario) -> tuple[str, ...]:
    """One sentence for each doubtful choice."""
    return (
        *_format(scenario),
        *_order(scenario),
        *_own(scenario),
        *_friction(scenario),
        *_turning(scenario),
        *_twice(scenario),
        *_pairs_twice(scenario),
        *_loose(scenario),
        *_other_constant(scenario),
        *_joined_twice(scenario),
        *_explicit(scenario),
        *_unrepeated(scenario),
        *_through_bodies(scenario),
        *_born_later(scenario),
        *too_heavy(scenario),
    )


def _born_later(scenario: Scenario) -> list[str]:
    """Emitters whose births are drift to a check, which begins at the first frame with particles."""
    if not any(check.quantity == "energy.drift" for check in scenario.checks):
        return []
    grid = scenario.grid
    period = grid.every * grid.dt
    born = {  # in which intervals between frames
        each.name: {int(burst.at / period) for burst in each.bursts()}
        | ({int(each.start / period), grid.steps} if each.rate or each.on_impact else set())
        for each in scenario.emitters
    }
    there = len(scenario.groups) > len(born)  # at frame 0
    first = -1 if there else min((min(each) for each in born.values()), default=-1)
    later = [repr(name) for name, when in born.items() if max(when) > first]
    if not later:
        return []
    return [
        f"energy.drift counts what births of {' and '.join(later)} bring after the first frame with particles; "
        "balance, with work = true under [output], leaves it out"
    ]


def _through_bodies(scenario: Scenario) -> list[str]:
    """Particles with a radius that pass through rigid bodies."""
    bodies = [body.name for body in scenario.bodies]
    met = {each.particles for each in meetings_of(scenario)}
    sized = [
        group.name
        for group in scenario.groups
        if group.name not in bodies and group.radius is not None and group.name not in met
    ]
    if not bodies or not sized:
        return []
    # what touches by springs already does not touch by impulses, too
    soft = any(each.soft and sized[0] in _names(each, scenario) for each in scenario.interactions)
    which = (
        f"between = [{sized[0]!r}, {bodies[0]!r}]"
        if soft
        else f"on = [{', '.join(map(repr, (sized[0], *bodies)))}]"
    )
    return [
        f"particles of {' and '.join(map(repr, sized))} pass through rigid bodies: no interaction makes them touch; "
        f'[[interactions]] of type = "contact" and {which} does'.replace("'", '"')
    ]


def _names(interaction: PairInteraction, scenario: Scenario) -> list[str]:
    return [group.name for group in interacting(interaction, scenario.groups)]


def _format(scenario: Scenario) -> list[str]:
    if scenario.written_format == scenario.format:
        return []
    return [
        f"the scenario is in format {scenario.written_format} and was read as {scenario.format}; psim migrate rewrites it"
    ]


def _order(scenario: Scenario) -> list[str]:
    methods = methods_of(scenario)
    return [
        sentence
        for group in scenario.groups
        for sentence in loss_of_order(scenario, group, methods[group.name])
    ]


def loss_of_order(scenario: Scenario, group: Group, method: Method) -> tuple[str, ...]:
    """Kicks and drifts are first order when the force depends on the velocity that a kick changes."""
    if not isinstance(method, Composition) or method.order < 2:
        return ()
    depends = [
        label
        for label, force in zip(scenario.labels.forces, scenario.forces, strict=True)
        if acts_on(force, group) and force.needs_velocity()
    ]
    depends += [each.name for each in ties(scenario) if group.name in each.groups and each.needs_velocity()]
    if not depends or any(each.law.random() for each in pair_sets(scenario) if group.name in each.groups):
        return ()  # random kicks are taken by these methods alone
    rods = any(group.name in each.groups for each in scenario.rod_sets)
    better = "take a smaller dt, as no other method holds rods" if rods else METHODS_THAT_KEEP
    return (
        f"{method.name} is only first order for {group.name!r}, because {' and '.join(depends)} "
        f"{'depends' if len(depends) == 1 else 'depend'} on the velocity; {better}",
    )


def replaced(scenario: Scenario) -> tuple[str, ...]:
    """Methods that a scenario asks for and that step no particle, as others without inertia step together with them: told
    before a run."""
    found, methods = [], methods_of(scenario)
    for groups in islands_of(scenario):
        inert = [group.name for group in groups if group.dynamics.type != "second_order"]
        heavy = [group for group in groups if group.name not in inert]
        if not inert or not heavy:
            continue
        asked = method_for(heavy[0].integrator or scenario.simulation.integrator)
        taken = methods[heavy[0].name]
        if asked.name != taken.name:
            lost = "energy drifts; " if asked.symplectic and not taken.symplectic else ""
            names = " and ".join(repr(group.name) for group in heavy)
            found.append(
                f"{inert[0]!r} has no inertia and steps together with {names}: {taken.name} steps them all, "
                f"not {asked.name}; {lost}interactions among other groups, on = [...], let each have its method, "
                f"and {OF_BOTH} step both"
            )
    return tuple(found)


def _own(scenario: Scenario) -> Iterator[str]:
    """What groups, colliders and interactions tell of themselves."""
    grid = scenario.grid
    for group in scenario.groups:
        yield from group.doubts(grid.duration)
    for k, collider in enumerate(scenario.all_colliders):
        touching = [group for group in scenario.groups if held_back(collider, (group.name,))]
        masses = [mass for group in touching if (mass := group.least_mass()) is not None]
        yield from collider.doubts(collider.called(k), min(masses, default=None), grid.dt)
        radius = max((size[1] for group in touching if (size := group.least_size())), default=0.0)
        if radius > 0 and (early := collider.early(radius)) > EARLY * radius:
            yield (
                f"{collider.called(k)}: balls of {radius:.3g} m may touch it up to {early:.2g} m too early "
                f"{collider.early_where(radius)}"
            )
    for each in scenario.interactions:
        sizes = [size for group in interacting(each, scenario.groups) if (size := group.least_size())]
        yield from each.doubts(min(sizes, default=None), grid.dt)


def _friction(scenario: Scenario) -> list[str]:
    """Friction that acts on nothing."""
    found = []
    for k, each in enumerate(scenario.all_colliders):
        inert = [
            g.name
            for g in scenario.groups
            if held_back(each, (g.name,)) and g.dynamics.type != "second_order"
        ]
        if each.rubs and inert:
            names = ", ".join(map(repr, inert))
            found.append(
                f"{each.called(k)}: friction does not act on {names}, whose particles have no inertia"
            )
    return found


def _turning(scenario: Scenario) -> list[str]:
    """Colliders and rigid bodies that turn by much in a step; how balls turn makes no difference."""
    led = {each.collider: each.spin for each in scenario.motions if each.spin is not None}
    dt, found = scenario.grid.dt, []
    for k, each in enumerate(scenario.all_colliders):
        spin = led.get(each.name) if each.name is not None else None
        if spin is not None and abs(spin.rate) * dt > MOST_TURN:
            turn, shorter = abs(spin.rate) * dt, MOST_TURN / abs(spin.rate)
            found.append(
                f"{each.called(k)}: it turns by {turn:.3g} rad in a step of dt = {dt:.6g} s, and what it hits on the way is "
                f"not sure beyond {MOST_TURN:g} rad; dt = {shorter:.3g} s turns it by that much"
            )
    for body in scenario.bodies:
        rate = math.hypot(*body.angular_velocity)
        if body.shape.type != "sphere" and rate * dt > MOST_TURN:
            found.append(
                f"bodies {body.name!r} turn by {rate * dt:.3g} rad in a step of dt = {dt:.6g} s at the start: their energy "
                f"swings by about the square of that, and where they hit something is not sure; dt = "
                f"{MOST_TURN / rate:.3g} s turns them by {MOST_TURN:g} rad"
            )
    return found


def sliding(scenario: Scenario, group: str | None = None) -> tuple[str, ...]:
    """Colliders on which particles (of one group) slide by a distance that depends on the step: a particle at rest touches
    in every step, and loses its part of the sliding velocity every time. For warnings before a run, and by `psim verify`."""
    return tuple(
        f"{each.called(k)}: tangential_loss acts at every contact, and a particle that lies on the "
        f"{each.kind} touches it in every step; how far it slides depends on dt, and goes to 0 with dt. It is a model "
        "of impacts, not of friction; friction = 0.4 is"
        for k, each in enumerate(scenario.all_colliders)
        if each.contact == "bounce"
        and each.tangential_loss > 0
        and each.liveliness < 1
        and (group is None or held_back(each, (group,)))
    )


def _explicit(scenario: Scenario) -> list[str]:
    """Interactions of pairs that implicit methods have in their forces and not in their matrices."""
    methods = methods_of(scenario)
    numbers = {group.name: group for group in scenario.groups}
    found = []
    for each in pair_sets(scenario):
        if not isinstance(methods[each.groups[0]], ImplicitMethod) or each.law.by_impulses:
            continue
        count = int(sum(number_of(numbers[name], scenario) for name in each.groups))
        if each.law.is_contact or chosen_in(scenario, each, count) not in IN_MATRICES:
            found.append(
                f"{each.name} is not in the matrix of {methods[each.groups[0]].name}: it needs steps as short as "
                "those of an explicit method, or iterations do not converge"
            )
    return found


def _unrepeated(scenario: Scenario) -> list[str]:
    """Forces that depend on the place, in a periodic box."""
    if scenario.simulation.box is None:
        return []
    return [
        f"{label} depends on positions, and takes those of unwrapped paths, not of images in the periodic box"
        for label, force in zip(scenario.labels.forces, scenario.forces, strict=True)
        if force.by_place
    ]


def direct_seconds(scenario: Scenario) -> float:
    """About how long sums of pairs one by one take in a step, on one core [s]."""
    return sum(step for _, _, step in _direct_sums(scenario))


def _direct_sums(scenario: Scenario) -> Iterator[tuple[PairSet, float, float]]:
    """Interactions whose pairs are summed one by one, with how many there are, and seconds of a step on one core."""
    tables, methods = {group.name: group for group in scenario.groups}, methods_of(scenario)
    for each in pair_sets(scenario):
        counts = [number_of(tables[name], scenario) for name in each.groups]
        if chosen_in(scenario, each, round(sum(counts))) == "direct":
            pairs = 2 * counts[0] * counts[1] if each.law.between is not None else sum(counts) ** 2
            method = methods[each.groups[0]]
            yield each, pairs, pairs * max(method.evaluations, 1) / PAIR_RATE


def long_sums(scenario: Scenario) -> tuple[str, ...]:
    """Warnings of interactions summed directly over so many pairs that the run takes hours."""
    found, methods = [], methods_of(scenario)
    for each, pairs, step in _direct_sums(scenario):
        if step * scenario.grid.steps < PATIENCE:
            continue
        way = "fewer particles or fewer steps take less"
        if each.law.lacks_multipoles() is None and methods[each.groups[0]].smooth:
            way = f"{methods[each.groups[0]].name} takes no tree, whose forces jump; velocity_verlet or dop853 does"
        elif each.law.method == "direct" and each.law.lacks_multipoles() is None:
            way = 'method = "tree" sums far particles by multipoles'
        elif each.law.reach() is not None:
            way = 'method = "neighbours" sums near pairs only'
        found.append(
            f"{each.name} sums {pairs:.2g} pairs one by one in every sum of forces, about {_time(step)} a step on one core "
            f"and {_time(step * scenario.grid.steps)} in all; {way}"
        )
    return tuple(found)


def number_of(group: Group, scenario: Scenario) -> float:
    """About how many particles a group has at most at once."""
    if isinstance(group, Emitter):
        births = group.expected(scenario.grid.duration)
        return births if group.limit is None else min(births, group.limit)
    assert isinstance(group, Particles)
    return float(scenario.opened(group).number() or 0)


def _time(seconds: float) -> str:
    """A time in words: '4.2 hours'."""
    for name, size in (("days", 86_400), ("hours", 3600), ("minutes", 60)):
        if seconds >= 2 * size:
            return (
                f"{seconds / size:.2g} {name}" if seconds < 1000 * size else f"{seconds / size:,.0f} {name}"
            )
    return f"{seconds:.2g} s"


def _twice(scenario: Scenario) -> list[str]:
    """Uniform gravity that acts on a group more than once, as after copying a block."""
    found = []
    labels = [
        (label, force)
        for label, force in zip(scenario.labels.forces, scenario.forces, strict=True)
        if force.uniform
    ]
    for group in scenario.groups:
        here = [label for label, force in labels if acts_on(force, group)]
        if len(here) > 1:
            found.append(f"{' and '.join(here)} act together on {group.name!r}: gravity adds up")
    return found


def _pairs_twice(scenario: Scenario) -> list[str]:
    """Two interactions of one kind, of which there is one in nature, between the same groups."""
    seen: dict[tuple[str, frozenset[str]], str] = {}
    found: dict[tuple[str, str], str] = {}
    for each, label in zip(scenario.interactions, scenario.labels.interactions, strict=True):
        if each.type not in ONCE:
            continue
        names = [group.name for group in interacting(each, scenario.groups)]
        pairs = combinations_with_replacement(names, 2) if each.between is None else [each.between]
        for pair in map(frozenset, pairs):
            if (other := seen.setdefault((each.type, pair), label)) != label:
                found.setdefault((other, label), " and ".join(map(repr, sorted(pair))))
    return [
        f"{label} acts on pairs of {names} as {other} does: they add up"
        for (other, label), names in found.items()
    ]


def _loose(scenario: Scenario) -> list[str]:
    """Bodies that nothing holds together."""
    joined = {name for each in ties(scenario) if each.holds for name in each.groups}
    return [
        f"nothing joins the particles of {group.name!r}: a {group.layout.type} only has the springs of its table springs"
        for group in scenario.particles
        if group.layout.is_body and group.name not in joined and group.pinned is not True
    ]


def _other_constant(scenario: Scenario) -> list[str]:
    """Speeds that balance another gravity than the one that acts."""
    found = []
    for group in scenario.particles:
        if (balanced := group.layout.balanced_constant()) is None:
            continue
        laws = [pairs.law for pairs in pair_sets(scenario) if group.name in pairs.groups]
        acting = {constant for law in laws if (constant := law.balanced_constant()) is not None}
        if acting != {balanced}:
            acts = f"G = {', '.join(f'{each:g}' for each in acting)} acts" if acting else "no gravity acts"
            found.append(
                f"the speeds of {group.name!r} balance gravity with G = {balanced:g}, and {acts} between its "
                "particles: constant of its layout and of [[interactions]] should be the same"
            )
    return found


def _joined_twice(scenario: Scenario) -> list[str]:
    """Pairs in two lists of springs of the same kind, as after copying a block."""
    seen: dict[tuple[bool, bool, frozenset[tuple[str, int]]], str] = {}
    found: dict[tuple[str, str], list[str]] = {}
    for springs, label in zip(scenario.springs, scenario.labels.springs, strict=True):
        if not springs.stiffness and springs.frequency is None:
            continue  # dampers beside springs
        first, second = springs.groups()
        for i, j in springs.pairs or ():
            key = (
                springs.tension_only,
                springs.compression_only,
                frozenset(((first, i), (second, j))),
            )
            if (other := seen.setdefault(key, label)) != label:
                pair = f"{i} and {j}" if first == second else f"{i} of {first!r} and {j} of {second!r}"
                found.setdefault((other, label), []).append(pair)
    return [
        f"{one} and {other} both join particles {pairs[0]}"
        + (f", and {len(pairs) - 1:,} more pairs" if len(pairs) > 1 else "")
        + ": their stiffness adds up"
        for (one, other), pairs in found.items()
    ]
