"""The simulation graph: what there is in a scenario, what acts on what, and which groups must step together.

Groups joined by springs, rods or interactions form an *island*: their particles have to be at the same time. All other
groups are islands of their own whose particles are independent of each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from particlesim.bodies import Bodies
from particlesim.bonds import BondSet, HingeSet, RodSet
from particlesim.colliders import Collider
from particlesim.emitters import Emitter
from particlesim.forces import Force
from particlesim.groups.group import Group
from particlesim.groups.impulse import Impulse
from particlesim.groups.motion import Motion
from particlesim.integrators import Method, method_for, without_inertia
from particlesim.integrators.rigid_leapfrog import RIGID_LEAPFROG
from particlesim.interactions import PairSet
from particlesim.scenario.open_colliders import open_colliders
from particlesim.scenario.reach import acts_on, heard, joint_tables, pair_sets, ties, touches_by_surfaces
from particlesim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from particlesim.forces.sheet_drag import SurfaceSet


@dataclass(frozen=True)
class Node:
    """A part of the simulation: kind ('group', 'force' ...), name, and what to know about it in a few words."""

    kind: str
    name: str
    detail: str

    @property
    def key(self) -> str:
        """Unique name of the node."""
        return f"{self.kind}:{self.name}"


@dataclass(frozen=True)
class Edge:
    """What one node does to another."""

    source: Node
    target: Node
    verb: str


Interaction: TypeAlias = "BondSet | HingeSet | SurfaceSet | PairSet"
"""A set of interactions between particles, as a scenario calls for it."""


@dataclass(frozen=True)
class Island:
    """Groups that step together, with all that acts on them. Independent particles have no interactions and no
    constraints (rods)."""

    groups: tuple[Group, ...]
    forces: tuple[tuple[Force, ...], ...]
    colliders: tuple[tuple[Collider, ...], ...]
    method: Method
    motions: tuple[tuple[Motion, ...], ...]
    interactions: tuple[Interaction, ...] = ()
    constraints: tuple[RodSet, ...] = ()
    heard: tuple[tuple[int | None, ...], ...] = ()
    """For every group and each of its colliders the number under which an emitter hears of impacts, None where none does."""
    duration: float = 0.0
    """How long the run is [s]."""

    @property
    def coupled(self) -> bool:
        """Whether its particles step together: they act on each other, or their method has one step for all."""
        return bool(self.interactions or self.constraints) or self.method.together

    @property
    def rigid(self) -> bool:
        """Whether it is one of rigid bodies."""
        return isinstance(self.groups[0], Bodies)

    def touched_softly(self, group: str) -> bool:
        """Whether colliders hold back a group by the law of its soft contacts."""
        return any(
            isinstance(each, PairSet) and each.law.soft and group in each.groups for each in self.interactions
        )

    def spins(self, group: str) -> bool:
        """Whether the particles of a group turn, as their contacts have friction (`scenario.reach.spins`)."""
        return bool(self._turning(group))

    def rolling_friction(self, group: str) -> float | None:
        """The rolling friction of hard grains of a group at colliders, the largest of their contacts; None without."""
        found = [each.law.rolls for each in self._turning(group) if each.law.by_impulses]
        return max(found, default=0.0) or None

    def _turning(self, group: str) -> list[PairSet]:
        """The contacts by which particles of a group turn."""
        return [
            each
            for each in self.interactions
            if isinstance(each, PairSet)
            and each.law.rubs
            and group in each.groups
            and not touches_by_surfaces(each.law, [one for one in self.groups if one.name in each.groups])
        ]

    @property
    def changes(self) -> bool:
        """Whether particles may be born or die."""
        return any(isinstance(group, Emitter) for group in self.groups) or any(
            each.contact == "kill" for colliders in self.colliders for each in colliders
        )


@dataclass(frozen=True)
class Graph:
    """Nodes and edges for people, islands for the engine."""

    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    islands: tuple[Island, ...]

    def as_text(self) -> str:
        """One line per group with what acts on it, for terminals."""
        lines = []
        for number, island in enumerate(self.islands):
            kind = "coupled: steps together" if island.coupled else "independent particles: steps in blocks"
            kind = "rigid bodies: step together" if island.rigid else kind
            lines.append(f"island {number + 1} ({kind}, {island.method.label})")
            for group in island.groups:
                node = group_node(group)
                lines.append(f"  {node.kind} {node.name}: {node.detail}")
                sources = [edge.source for edge in self.edges if edge.target == node]
                lines += [f"    <- {source.kind} {source.name}: {source.detail}" for source in sources]
        return "\n".join(lines)

    def as_mermaid(self) -> str:
        """A Mermaid flowchart, for Markdown pages."""
        number = {node.key: f"n{k}" for k, node in enumerate(self.nodes)}
        lines = ["flowchart LR"]
        for node in self.nodes:
            label = f"{node.kind} {node.name}<br/>{node.detail}".replace('"', "'")
            lines.append(f'  {number[node.key]}["{label}"]')
        lines += [f"  {number[e.source.key]} -->|{e.verb}| {number[e.target.key]}" for e in self.edges]
        return "\n".join(lines)


def build_graph(scenario: Scenario) -> Graph:
    """The graph of a scenario, whose colliders read their files. Raises UsageError when that cannot be done."""
    open_colliders(scenario)
    groups = {group.name: group_node(group) for group in scenario.groups}
    labels = scenario.labels.forces
    nodes: list[Node] = list(groups.values())
    edges: list[Edge] = []

    def act(node: Node, verb: str, targets: list[str]) -> None:
        nodes.append(node)
        edges.extend(Edge(node, groups[name], verb) for name in targets)

    for label, force in zip(labels, scenario.forces, strict=True):
        act(
            Node("force", label, force.formula),
            "acts on",
            [g.name for g in scenario.groups if acts_on(force, g)],
        )
    for each in ties(scenario):
        act(Node(each.kind, each.name, each.describe()), each.verb, list(dict.fromkeys(each.groups)))
    for path, joint in joint_tables(scenario):
        names = [name for name in joint.groups() if name in groups]
        act(Node(str(path[0]), joint.name, joint.describe()), "joins", list(dict.fromkeys(names)))
    for k, collider in enumerate(scenario.all_colliders):
        act(
            Node(collider.kind, collider.name or str(k), collider.describe_contact()),
            "holds back",
            _targets(collider, scenario),
        )
    for k, impulse in enumerate(scenario.impulses):
        times = ", ".join(f"{t:g}" for t in impulse.times())
        act(Node("impulse", impulse.name or str(k), f"at {times} s"), "kicks", _targets(impulse, scenario))
    for k, motion in enumerate(scenario.motions):
        led = [] if motion.on is None else [motion.on]
        act(Node("motion", motion.name or str(k), motion.describe()), "leads", led)
    islands = _islands(scenario)
    recorder = Node(
        "recorder", "trajectory", f"{scenario.grid.frames} frame{'s' * (scenario.grid.frames != 1)}"
    )
    integrators = {
        method: Node("integrator", method.label, method.summary) for method in {i.method for i in islands}
    }
    nodes += [*sorted(integrators.values(), key=lambda n: n.name), recorder]
    for island in islands:
        edges += [Edge(groups[g.name], integrators[island.method], "stepped by") for g in island.groups]
    edges += [
        Edge(node, recorder, "recorded by") for node in sorted(integrators.values(), key=lambda n: n.name)
    ]
    return Graph(tuple(nodes), tuple(edges), islands)


def interactions_of(scenario: Scenario) -> tuple[Interaction, ...]:
    """All sets of interactions of a scenario in the order in which they are added: springs, hinges, forces on surfaces, and
    what acts between any two particles."""
    labels = scenario.labels.forces
    surfaces = (
        force.over(label, group.name)
        for group in scenario.groups
        for label, force in zip(labels, scenario.forces, strict=True)
        if force.on_surfaces and acts_on(force, group)
    )
    return (*scenario.bonds, *scenario.hinges, *surfaces, *pair_sets(scenario))


def methods_of(scenario: Scenario) -> dict[str, Method]:
    """The method that steps each group, by name: one for all of an island."""
    return {
        group.name: _method_of_all(groups, scenario) for groups in islands_of(scenario) for group in groups
    }


def islands_of(scenario: Scenario) -> list[list[Group]]:
    """The groups that step together, in the order of the scenario."""
    return _members(scenario, _joined(scenario.groups, _links(scenario, interactions_of(scenario))))


def _method_of_all(groups: Sequence[Group], scenario: Scenario) -> Method:
    """The method that steps the groups of an island, which have the same one: if some have no inertia, the one that takes
    its place, as it must not need a velocity of its own."""
    if isinstance(groups[0], Bodies):
        return RIGID_LEAPFROG
    integrator = groups[0].integrator or scenario.simulation.integrator
    inertial = all(group.dynamics.type == "second_order" for group in groups)
    return method_for(integrator) if inertial else without_inertia(integrator)


def _links(scenario: Scenario, interactions: Sequence[Interaction]) -> list[tuple[str, ...]]:
    """The groups that each interaction, each set of rods and what may touch join."""
    hung = {each.name for each in scenario.hung_rods}
    rods = (each for each in scenario.rod_sets if each.name not in hung)
    return [each.groups for each in (*interactions, *rods)] + [tuple(body.name for body in scenario.bodies)]


def _joined(groups: Sequence[Group], links: Sequence[tuple[str, ...]]) -> dict[str, str]:
    """For every group one that stands for all that are joined with it (union-find)."""
    parent = {group.name: group.name for group in groups}

    def root(name: str) -> str:
        while parent[name] != name:
            name = parent[name]
        return name

    for link in links:
        for other in link[1:]:
            parent[root(other)] = root(link[0])
    return {name: root(name) for name in parent}


def _members(scenario: Scenario, stands: Mapping[str, str]) -> list[list[Group]]:
    """The groups of every island, in the order of the scenario."""
    members: dict[str, list[Group]] = {}
    for group in scenario.groups:
        members.setdefault(stands[group.name], []).append(group)
    return list(members.values())


def _targets(entry: Collider | Impulse, scenario: Scenario) -> list[str]:
    return [g.name for g in scenario.groups if entry.on is None or g.name in entry.on]


def _islands(scenario: Scenario) -> tuple[Island, ...]:
    """Groups by the springs and rods that join them, in the order of the scenario."""
    hung, interactions = {each.name for each in scenario.hung_rods}, interactions_of(scenario)
    rods = tuple(each for each in scenario.rod_sets if each.name not in hung)
    stands = _joined(scenario.groups, _links(scenario, interactions))
    islands = []
    for groups in _members(scenario, stands):
        name = stands[groups[0].name]
        islands.append(
            Island(
                tuple(groups),
                tuple(
                    tuple(f for f in scenario.forces if acts_on(f, g) and not f.on_surfaces) for g in groups
                ),
                tuple(
                    tuple(c for c in scenario.all_colliders if c.on is None or g.name in c.on) for g in groups
                ),
                _method_of_all(groups, scenario),
                tuple(tuple(m for m in scenario.motions if m.on == g.name) for g in groups),
                tuple(each for each in interactions if stands[each.groups[0]] == name),
                tuple(each for each in rods if stands[each.groups[0]] == name),
                tuple(
                    tuple(
                        k if heard(scenario, g.name, c) else None
                        for k, c in enumerate(scenario.all_colliders)
                        if c.on is None or g.name in c.on
                    )
                    for g in groups
                ),
                scenario.grid.duration,
            )
        )
    return tuple(islands)


def group_node(group: Group) -> Node:
    """The node of a group."""
    return Node(group.kind, group.name, group.describe())
