"""Particles between random colliders: none is ever on the wrong side, none has crossed one, and none gains energy.

    python tests/fuzz/fuzz_contact.py [--particle-steps 1e8] [--seed 0] [--particles 1024] [--only mesh] [--method …]
        [--hypothesis]

Every round draws a scene: a room of six walls with one of them twice (coincident planes), a wall across a corner and a ball;
a room of thin sheets, which may be touched from both sides and so must be crossed by no way; a floor that flat sides of
solids stand on exactly, at rest or pushed along it, so that nothing may be under them; or one of all other
shapes, at rest or led and turned, once or twice in the same place, in a hollow sphere about it. All have
some restitution, loss, and friction; there is gravity or none, a step, and many particles at speeds from 10⁻³ to 10⁵ m/s:
anywhere, in corners, on edges, grazing along walls, or at rest on them. Prints the particles that break a rule and, at the
end, particle-steps of each scene; exit code 1 if a rule is broken. If no method is named, scenes take those in turn that
cannot gain energy by themselves in a uniform field.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import hypothesis
import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis.strategies import data, floats, integers, sampled_from
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from contract.cases import COLLIDER_CASES, opened
from support import careful, columns, position, program, run, velocity

from particlesim.colliders import (
    BoxCollider,
    Collider,
    ConeCollider,
    CylinderCollider,
    DiscCollider,
    MeshCollider,
    PlaneCollider,
    RectangleCollider,
    SphereCollider,
    UnionCollider,
)
from particlesim.colliders.box import Box
from particlesim.colliders.gaps import gaps_of
from particlesim.colliders.moving import SpinRecord
from particlesim.colliders.pose import Orientation
from particlesim.colliders.seams import closed
from particlesim.forces import Gravity
from particlesim.groups.motion import Motion

EPS = float(np.finfo(float).eps)
STEPS = 20
METHODS = ("velocity_verlet", "symplectic_euler")
"""Both keep the energy of free flight, the second with the velocities of its places, v + ½ h g."""
AXES = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
WORLD = 3.0
"""Radius of the hollow sphere about a shape [m]."""
LATER = ("floor", "intersection_with_plane", "difference_of_union")
"""Scenes that came later: drawn by themselves, so that seeds go on to mean the scenes that they did."""
SHAPES = tuple(
    name for name in COLLIDER_CASES if not name.startswith("plane") and name not in ("sphere", *LATER)
)
CURVED = {"formula": 1e4, "formula_with_kinks": 1e4, "distance_grid": 1e4}
"""Rounding errors of a gap that a search for the nearest place finds, in units of those of others."""
DEAR = 32
"""Particles of other shapes for one of these, whose impacts take a hundred times as long."""


class Scene(NamedTuple):
    """Colliders, whether one of them moves, the radius of a sphere or a box about all legal places [m], whether the box is
    meant, how much larger than others' rounding errors are, what else no particle may be inside of, and the axes of a floor
    through the origin, in columns, of which the second is its normal."""

    colliders: list[Collider]
    moves: bool
    size: float
    room: bool
    noise: float = 1.0
    bounds: tuple[Collider, ...] = ()
    floor: NDArray[Any] | None = None


def surface(rng: Any, rubs: bool) -> dict[str, Any]:
    """A response to contact; always with a record of friction where there `rubs` any, so that two programs are all."""
    chosen: dict[str, Any] = {"restitution": float(rng.choice([0, 0.3, 0.8, 1.0])), "contact": "bounce"}
    chosen["tangential_loss"] = float(rng.choice([0, 0, 0.1, 1.0]))
    chosen["detection"] = "continuous"
    if rubs:
        chosen["friction"] = {
            "static": float(rng.choice([1e-9, 0.3, 2.0])),
            "kinetic": float(rng.choice([1e-9, 0.2, 1.0])),
        }
    return chosen


def room(rng: Any, rubs: bool) -> Scene:
    """Walls of a box from −1 to 1, one of them twice, one across a corner, and a ball in the middle."""
    walls = [PlaneCollider(normal=n, point=[-x for x in n], **surface(rng, rubs)) for n in (*AXES, AXES[2])]
    across = PlaneCollider(normal=[1, 1, 0.5], point=[-0.8, -0.8, -0.5], **surface(rng, rubs))
    center = rng.uniform(-0.2, 0.2, 3).tolist()
    ball = SphereCollider(center=center, radius=0.25, **surface(rng, rubs))
    return Scene([*walls, across, ball], False, 1.0, True)


def sheets(rng: Any, rubs: bool) -> Scene:
    """A room from −1 to 1 with walls that have two sides: rectangles or discs that reach beyond each other, rectangles that
    meet edge to edge, or a mesh."""
    kind = rng.choice(["rectangle", "disc", "mesh"])
    half = float(rng.choice([1e-4, 0.01])) if kind != "mesh" else 0.01
    side = 2.2 if rng.spawn(1)[0].random() < 0.5 else 2 + 2 * half
    walls: list[Collider] = []
    if kind == "mesh":
        cube = MeshCollider(path="cube.obj", scale=2 + 2 * half, thickness=2 * half, **surface(rng, rubs))
        walls = [opened(cube)]
    for n in () if kind == "mesh" else AXES:
        given = {"center": [(1 + half) * x for x in n], "thickness": 2 * half, **surface(rng, rubs)}
        if kind == "disc":
            walls.append(DiscCollider(normal=n, radius=1.6, **given))
        else:
            turn = {"axis": [0, 0, 1] if n[0] else [1, 0, 0], "angle": 0 if n[1] else 90}
            walls.append(RectangleCollider(size=[side, side], orientation=turn, **given))
    bounds = tuple(PlaneCollider(normal=n, point=[-x for x in n]) for n in AXES)
    return Scene(walls, False, 1.0, True, bounds=bounds)


def floor(rng: Any, rubs: bool) -> Scene:
    """Four solids of a kind that stand on a floor with flat sides, which nothing may be under: a plane, a box, or a sheet,
    turned in some way; in a hollow sphere. Boxes stand beside boxes, and one of the solids is pushed to and fro."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    angle = float(rng.choice([0.0, rng.uniform(0, 180)]))
    turned = Orientation(axis=axis.tolist(), angle=angle)
    axes = np.array(turned.rotation())
    kind = rng.choice(["plane", "box", "rectangle"])
    deep = 0.25
    ground: Collider
    if kind == "plane":
        ground = PlaneCollider(normal=axes[:, 1].tolist(), **surface(rng, rubs))
    elif kind == "box":
        center = (-axes[:, 1] * 2 * deep).tolist()
        ground = BoxCollider(size=(3, 4 * deep, 3), center=center, orientation=turned, **surface(rng, rubs))
    else:
        deep = float(rng.choice([5e-5, 0.005]))
        center, size = (-axes[:, 1] * deep).tolist(), (3, 3)
        ground = RectangleCollider(
            size=size, thickness=2 * deep, center=center, orientation=turned, **surface(rng, rubs)
        )
    walls: list[Collider] = [ground]
    bounds: list[Collider] = []
    pushed = bool(rng.random() < 0.4)
    solid = str(rng.choice(["box", "pair", "mesh", "union", "cylinder", "cone"]))
    speed = float(rng.uniform(0, 3))
    for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        made = standing(solid, rng, axes, turned, np.array((0.7 * i, 0, 0.7 * j)), deep, surface(rng, rubs))
        if pushed and i == j == 1:
            way = (0.2 * axes[:, 0]).tolist()
            path = [f"{w} + {u!r}*sin({speed!r}*t)" for w, u in zip("xyz", way, strict=True)]
            for each in made:
                each.lead(Motion(collider="c", path=path).record(), None)
        walls += made[:-1]
        bounds += made[-1:]
    world = SphereCollider(radius=WORLD, inside=True, **surface(rng, rubs))
    return Scene([*walls, world], pushed, WORLD, False, bounds=tuple(bounds), floor=axes)


def standing(
    kind: str,
    rng: Any,
    axes: NDArray[Any],
    turned: Orientation,
    at: NDArray[Any],
    deep: float,
    response: dict[str, Any],
) -> list[Collider]:
    """A solid, or two of them side by side, with the bottom on a floor through the origin with these axes; and last what is
    as wide and reaches into the floor."""
    wide, high = rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.6)

    def place(x: float, y: float) -> list[float]:
        return list(map(float, axes @ (at + np.array((x, y, 0.0)))))

    def box(x: float, width: float, low: float, made: type[Any] = BoxCollider, **more: Any) -> Any:
        size = (width, high - low, wide)
        return made(center=place(x, 0.5 * (low + high)), size=size, orientation=turned, **more)

    if kind == "box":
        return [box(0, wide, 0, **response), box(0, wide, -deep)]
    if kind == "mesh":
        high, middle = wide, place(0, 0.5 * wide)
        cube = MeshCollider(path="cube.obj", scale=wide, origin=middle, orientation=turned, **response)
        return [opened(cube), box(0, wide, -deep)]
    half = 0.5 * wide
    if kind == "pair":
        sides = [box(x, half, 0, **response) for x in (-0.5 * half, 0.5 * half)]
        return [*sides, box(0, wide, -deep)]
    if kind == "union":
        parts = tuple(box(x, half, 0, Box) for x in (-0.5 * half, 0.5 * half))
        return [UnionCollider(of=parts, **response), box(0, wide, -deep)]
    ends = {"start": place(0, 0), "end": place(0, high)}
    under = place(0, -deep)
    if kind == "cylinder":
        lower = CylinderCollider(start=under, end=ends["end"], radius=half)
        return [CylinderCollider(radius=half, **ends, **response), lower]
    top = float(rng.uniform(0, 0.9)) * half
    cone = ConeCollider(radius=half, end_radius=top, **ends, **response)
    wider = half + (half - top) * deep / high
    return [cone, ConeCollider(start=under, end=ends["end"], radius=wider, end_radius=top)]


ROOMS = {"room": room, "sheets": sheets}
SCENES = {**ROOMS, "floor": floor}
OF_LATER = 0.15
"""Of scenes whose names are not asked for, the part that is one of these."""


def about(name: str, rng: Any, rubs: bool) -> Scene:
    """A shape in the middle of a hollow sphere: at rest, twice in the same place, or led and turned."""
    given = COLLIDER_CASES[name]
    friction = {"friction": 0.0} if not rubs else {}
    made = [_with(given, {**friction, **surface(rng, rubs)})]
    world = SphereCollider(radius=WORLD, inside=True, **surface(rng, rubs))
    how = rng.integers(3)
    if how == 1:
        made.append(_with(given, {**friction, **surface(rng, rubs)}))
    if how == 2:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        speed, turn = rng.uniform(0, 2, 2)
        path = Motion(collider="c", path=[f"x + 0.2*sin({speed}*t)", "y", f"z + 0.1*cos({speed}*t) - 0.1"])
        made[0].lead(path.record(), SpinRecord(*axis.tolist(), float(turn)))
    return Scene([*made, world], how == 2, WORLD, False, CURVED.get(name, 1.0))


def _with(collider: Collider, values: dict[str, Any]) -> Collider:
    """The collider with another response, and its file read."""
    from particlesim.colliders.friction import Friction

    if isinstance(values.get("friction"), dict):
        values["friction"] = Friction(**values["friction"])
    made = collider.model_copy(update=values)
    made.__pydantic_private__ = dict(collider.__pydantic_private__ or {})
    return made


def start(rng: Any, scene: Scene, particles: int, radius: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places and velocities, of which some are in corners, on edges and at walls, some along them, and some at rest."""
    inner = scene.size - radius
    if scene.room:
        x = rng.uniform(-0.5, 0.5, (particles, 3))
        x[:, 1] = rng.uniform(0.55, 0.7, particles)
        side = rng.integers(0, 2, (particles, 3)) * rng.choice([-1, 1], (particles, 3))
        x = np.where(side != 0, side * inner, x)
    else:
        x = rng.uniform(-inner, inner, (particles, 3))
        # a third of them near the shape, where it is met
        near = rng.random(particles) < 0.3
        x[near] *= 0.5
    direction = rng.normal(size=(particles, 3))
    direction[rng.random((particles, 3)) < 0.2] = 0
    if scene.floor is not None:
        along = rng.random(particles) < 0.7  # on the floor among the solids, and on along it
        x[along] = rng.uniform(-1.2, 1.2, (int(along.sum()), 3))
        x[along, 1] = radius
        direction[along, 1] = 0
        x, direction = x @ scene.floor.T, direction @ scene.floor.T
    # The faster, the fewer: at 10⁵ m/s a step has a thousand impacts.
    v = direction * 10.0 ** (8 * rng.power(0.5, (particles, 1)) - 3)
    v[rng.random(particles) < 0.2] = 0
    return x, v


def gaps(scene: Scene, x: NDArray[Any], radius: float, t: float) -> NDArray[Any]:
    """The smallest gap of each place to any collider [m]."""
    sizes, found = np.full(len(x), radius), np.full(len(x), np.inf)
    columns_ = np.ascontiguousarray(x.T)
    out = np.empty(len(x))
    for each in (*scene.colliders, *scene.bounds):
        gaps_of(each.body(), *columns_, sizes, t, out)
        found = np.minimum(found, out)
    return found


def broken_rules(
    seed: int,
    particles: int = 1024,
    only: str | None = None,
    among: Sequence[int] | None = None,
    method: str = METHODS[0],
) -> tuple[str, int, list[str]]:
    """The scene and the particle-steps of a round, and what went wrong in it; of some `among` its particles, or all."""
    rng, later = np.random.default_rng([seed]), np.random.default_rng([seed, 7])
    return broken_in_scene(rng, later, f"seed {seed}", particles, only, among, method)


def broken_in_scene(
    rng: Any,
    later: Any,
    seed: str,
    particles: int,
    only: str | None = None,
    among: Sequence[int] | None = None,
    method: str = METHODS[0],
) -> tuple[str, int, list[str]]:
    """`broken_rules` in a scene that is drawn by something like a generator of numpy."""
    rubs, radius = bool(rng.integers(2)), float(rng.choice([0.0, 0.05]))
    name = only or str(rng.choice([*ROOMS, *SHAPES]))
    if only is None and later.random() < OF_LATER:
        name = str(later.choice(LATER))
    scene = SCENES[name](rng, rubs) if name in SCENES else about(name, rng, rubs)
    if name in CURVED:
        particles = max(particles // DEAR, 32)
    g = rng.normal(size=3) * float(rng.choice([0.0, 1.0, 9.8]))
    if scene.floor is not None:  # mostly towards the floor
        g = 0.3 * g - np.linalg.norm(g) * scene.floor[:, 1]
    h = float(10.0 ** rng.uniform(-4, -1.5))
    x, v = start(rng, scene, particles, radius)
    legal = gaps(scene, x, radius, 0.0) >= -4 * EPS
    x, v = x[legal], v[legal]
    if among is not None:
        x, v = x[among], v[among]
    if not len(x):
        return name, 0, []
    c = columns(x, v, radius=radius, method=method)._replace(missed=np.zeros(len(x), np.int64))
    size = max(each.reach() for each in scene.colliders)
    records = [each.record() for each in scene.colliders]
    shapes = closed([each.shape for each in records], size, np.dtype(float))
    records = [each._replace(shape=shape) for each, shape in zip(records, shapes, strict=True)]
    contacts = careful(continuous=records, tolerance=16 * EPS, reach=size)
    costly = any(each.costly for each in scene.colliders)
    contacts = contacts._replace(one_by_one=() if costly else None)
    stepped = program(method, (Gravity(acceleration=g.tolist()).record(),), contacts)
    wrong = []
    # Rounding of an impact is that of the way that a free step would go, and of the speed with which it comes.
    reach = scene.noise * (4 + WORLD + h * np.abs(v).max(axis=1) + h * h * np.abs(g).max())
    before = 0.5 * ((v + (0.5 * h * g if method == METHODS[1] else 0)) ** 2).sum(axis=1) - x @ g
    scale = before.max() if scene.room else np.abs(before)
    # Rounding adds up over the impacts of a step, of which a fast particle has many.
    roundings = 64 + np.minimum(h * np.linalg.norm(v, axis=1) / 0.01, 1024)
    slack = (
        roundings
        * EPS
        * STEPS
        * scene.noise
        * (scale + (v**2).sum(axis=1) + 10 * np.abs(g).max() * reach + 1)
    )
    if method == METHODS[1]:
        # It slides by its own velocities, which differ in energy from those of the places by h v·g/2.
        gained = h * np.linalg.norm(g)
        slack = slack + gained * (np.linalg.norm(v, axis=1) + STEPS * gained)
    for k in range(STEPS):
        if run(stepped, c, 1, h, first_step=k).any():
            wrong.append(f"{name}, {seed}, step {k}: not finite")
            break
        wrong += [f"{name}, {seed}, step {k}: particle {i} crossed" for i in np.flatnonzero(c.missed)[:3]]
        c.missed[:] = 0
        deep = gaps(scene, position(c), radius, (k + 1) * h)
        if scene.moves:  # what is pushed may become faster
            reach = np.maximum(reach, scene.noise * (7 + h * np.abs(velocity(c)).max(axis=1)))
        sunk = np.flatnonzero(~(deep >= -64 * EPS * reach))[:3]
        wrong += [f"{name}, {seed}, step {k}: particle {i} is {-deep[i]:.3g} m inside" for i in sunk]
        on_time = velocity(c) + (0.5 * h * g if method == METHODS[1] else 0)
        energy = 0.5 * (on_time**2).sum(axis=1) - position(c) @ g
        if scene.moves:
            continue
        gains = np.flatnonzero(energy > before + slack)[:3]
        wrong += [
            f"{name}, {seed}, step {k}: particle {i} gains {energy[i] - before[i]:.3g} J/kg" for i in gains
        ]
        before = np.minimum(before, energy)
    return name, len(x) * STEPS, wrong


class Drawn:
    """Draws scenes by hypothesis, which looks for simple and for extreme ones, and makes those that break a rule simpler;
    many numbers at once, such as places of all particles, come from a generator with a seed that it draws."""

    FEW = 4
    NOTHING = 1e-12
    """Parts of a direction that count as none. What 10⁻⁶⁹ of gravity presses on a floor may come 1 µm into a wall."""

    def __init__(self, draw: Any) -> None:
        self.draw = draw
        self.many = np.random.default_rng(draw(integers(0, 2**32 - 1)))

    def _each(self, strategy: Any, size: Any) -> Any:
        if size is None:
            return self.draw(strategy)
        return np.array([self.draw(strategy) for _ in range(int(np.prod(size)))]).reshape(size)

    def _few(self, size: Any) -> bool:
        return size is None or int(np.prod(size)) <= self.FEW

    def choice(self, options: Any, size: Any = None) -> Any:
        """As that of numpy."""
        return (
            self._each(sampled_from(list(options)), size)
            if self._few(size)
            else self.many.choice(options, size)
        )

    def integers(self, low: int, high: int | None = None, size: Any = None) -> Any:
        """As that of numpy."""
        low, high = (0, low) if high is None else (low, high)
        return (
            self._each(integers(low, high - 1), size)
            if self._few(size)
            else self.many.integers(low, high, size)
        )

    def uniform(self, low: float, high: float, size: Any = None) -> Any:
        """As that of numpy."""
        return self._each(floats(low, high), size) if self._few(size) else self.many.uniform(low, high, size)

    def random(self, size: Any = None) -> Any:
        """As that of numpy."""
        return self.uniform(0.0, 1.0, size)

    def normal(self, size: Any = None) -> Any:
        """As that of numpy, but for tails; a direction has a length."""
        if not self._few(size):
            return self.many.normal(size=size)
        found = self._each(floats(-3.0, 3.0), size)
        found[np.abs(found) < self.NOTHING] = 0.0
        assume(np.abs(found).max() > 0.01)
        return found

    def power(self, a: float, size: Any) -> Any:
        """As that of numpy."""
        return self.many.power(a, size)

    def spawn(self, number: int) -> list[Drawn]:
        """Draws that follow these."""
        return [self] * number


def search(particle_steps: float, particles: int, seed: int, only: str | None, method: str | None) -> int:
    """Rounds by hypothesis; the particle-steps of all. Raises AssertionError with the simplest scene that breaks a rule."""
    done = 0

    @hypothesis.seed(seed)
    @settings(
        max_examples=int(particle_steps / (particles * STEPS)) + 1,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(data())
    def look(found: Any) -> None:
        nonlocal done
        rng = Drawn(found.draw)
        by = method or found.draw(sampled_from(METHODS))
        _, steps, wrong = broken_in_scene(rng, rng, "hypothesis", particles, only, None, by)
        done += steps
        assert not wrong, f"{by}, {wrong}"

    look()
    return done


def main() -> None:
    """Rounds until there are enough particle-steps."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--particle-steps", type=float, default=1e8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--particles", type=int, default=1024, help="in a round")
    parser.add_argument("--only", help="the name of one scene")
    parser.add_argument("--method", choices=METHODS, help="one method")
    parser.add_argument(
        "--hypothesis", action="store_true", help="scenes that hypothesis draws, and makes simple"
    )
    asked = parser.parse_args()
    if asked.hypothesis:
        done = search(asked.particle_steps, asked.particles, asked.seed, asked.only, asked.method)
        print(f"{done:,} particle-steps by hypothesis, none broken")
        return
    done, seed, wrong = 0, asked.seed, 0
    table: dict[str, tuple[int, float, int]] = {}
    while done < asked.particle_steps:
        began = time.process_time()
        method = asked.method or METHODS[seed % len(METHODS)]
        name, steps, found = broken_rules(seed, asked.particles, asked.only, method=method)
        found = [f"{method}, {each}" for each in found]
        number, took, bad = table.get(name, (0, 0.0, 0))
        table[name] = (number + steps, took + time.process_time() - began, bad + len(found))
        done, seed, wrong = done + steps, seed + 1, wrong + len(found)
        for each in found:
            print(each, flush=True)
        if seed % 20 == 0:
            print(f"... {done:,} particle-steps, seed {seed}", flush=True)
    for name, (number, took, bad) in sorted(table.items()):
        print(
            f"  {name:24s} {number:14,} particle-steps, {1e6 * took / max(number, 1):8.2f} µs each, {bad} broken"
        )
    print(f"{done:,} particle-steps, {wrong} broken rules; next seed {seed}")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
