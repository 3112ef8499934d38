"""Particles between random colliders: none is ever on the wrong side, and none gains energy.

    python tests/fuzz/fuzz_contact.py [--particle-steps 1e8] [--seed 0]

Every round draws a room of six walls, one of them twice (coincident planes), a wall across a corner and a ball in it, all
with some restitution, friction and loss, gravity or none, a step, and particles at speeds from 10⁻³ to 10⁵ m/s: anywhere,
in corners, on edges, grazing along walls, or at rest on them. Prints the particles that break a rule; exit code 1 if
there are any.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support import careful, columns, position, program, run, velocity

from particlesim.colliders import PlaneCollider, SphereCollider
from particlesim.forces import Gravity
from particlesim.laws.registry import Particle, gap

EPS = float(np.finfo(float).eps)
PARTICLES, STEPS = 256, 20
AXES = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


def room(rng: np.random.Generator, rubs: bool) -> list[Any]:
    """Walls of a box from −1 to 1, one of them twice, one across a corner, and a ball in the middle."""

    def surface() -> dict[str, Any]:
        chosen: dict[str, Any] = {"restitution": float(rng.choice([0, 0.3, 0.8, 1.0]))}
        chosen["tangential_loss"] = float(rng.choice([0, 0, 0.1, 1.0]))
        if rubs:  # always a record of friction, so that two programs are all
            chosen["friction"] = {
                "static": float(rng.choice([1e-9, 0.3, 2.0])),
                "kinetic": float(rng.choice([1e-9, 0.2, 1.0])),
            }
        return chosen

    walls = [PlaneCollider(normal=n, point=[-x for x in n], **surface()) for n in (*AXES, AXES[2])]
    across = PlaneCollider(normal=[1, 1, 0.5], point=[-0.8, -0.8, -0.5], **surface())
    ball = SphereCollider(center=rng.uniform(-0.2, 0.2, 3).tolist(), radius=0.25, **surface())
    return [*walls, across, ball]


def start(rng: np.random.Generator, radius: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Places and velocities, of which some are in corners, on edges and at walls, some along them, and some at rest."""
    inner = 1 - radius
    x = rng.uniform(-0.5, 0.5, (PARTICLES, 3))
    x[:, 1] = rng.uniform(0.55, 0.7, PARTICLES)
    side = rng.integers(0, 2, (PARTICLES, 3)) * rng.choice([-1, 1], (PARTICLES, 3))
    x = np.where(side != 0, side * inner, x)
    direction = rng.normal(size=(PARTICLES, 3))
    direction[rng.random((PARTICLES, 3)) < 0.2] = 0
    v = direction * 10.0 ** rng.uniform(-3, 5, (PARTICLES, 1))
    v[rng.random(PARTICLES) < 0.2] = 0
    return x, v


def broken_rules(seed: int) -> tuple[int, list[str]]:
    """Particle-steps of a round, and what went wrong in it."""
    rng = np.random.default_rng([seed])
    rubs, radius = bool(rng.integers(2)), float(rng.choice([0.0, 0.05]))
    colliders = room(rng, rubs)
    g = rng.normal(size=3) * float(rng.choice([0.0, 1.0, 9.8]))
    h = float(10.0 ** rng.uniform(-4, -1))
    x, v = start(rng, radius)
    shapes = [each.shape() for each in colliders]

    def gaps(places: NDArray[Any]) -> NDArray[Any]:
        p = Particle(*places.T, *places.T, 1.0, radius, 0.0, 0.0)  # type: ignore[arg-type]
        return np.min([np.broadcast_to(gap(shape, p), len(places)) for shape in shapes], axis=0)

    legal = gaps(x) >= -4 * EPS
    x, v = x[legal], v[legal]
    if not len(x):
        return 0, []
    c = columns(x, v, radius=radius, method="velocity_verlet")
    contacts = careful(continuous=[each.record() for each in colliders], tolerance=16 * EPS, reach=1.0)
    stepped = program("velocity_verlet", (Gravity(acceleration=g.tolist()).record(),), contacts)
    wrong = []
    # Rounding of an impact is that of the way that a free step would go, and of the speed with which it comes.
    reach = 4 + h * np.abs(v).max(axis=1) + h * h * np.abs(g).max()
    before = 0.5 * (v**2).sum(axis=1) - x @ g
    slack = 64 * EPS * (before.max() + (v**2).sum(axis=1) + 10 * np.abs(g).max() * reach + 1) * STEPS
    for k in range(STEPS):
        if run(stepped, c, 1, h, first_step=k).any():
            wrong.append(f"seed {seed}, step {k}: not finite")
            break
        deep = gaps(position(c))
        sunk = np.flatnonzero(deep < -64 * EPS * reach)[:3]
        wrong += [f"seed {seed}, step {k}: particle {i} is {-deep[i]:.3g} m inside" for i in sunk]
        energy = 0.5 * (velocity(c) ** 2).sum(axis=1) - position(c) @ g
        # What slides over the ball is put back by s²/2R after a step of length s.
        s = h * (np.sqrt((velocity(c) ** 2).sum(axis=1)) + h * np.linalg.norm(g))
        lifted = np.linalg.norm(g) * s * s / (2 * 0.25)
        gains = np.flatnonzero(energy > before + slack + lifted)[:3]
        wrong += [
            f"seed {seed}, step {k}: particle {i} gains {energy[i] - before[i]:.3g} J/kg" for i in gains
        ]
        before = np.minimum(before, energy)
    return len(x) * STEPS, wrong


def main() -> None:
    """Rounds until there are enough particle-steps."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--particle-steps", type=float, default=1e8)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    done, seed, wrong = 0, asked.seed, 0
    while done < asked.particle_steps:
        steps, found = broken_rules(seed)
        done, seed, wrong = done + steps, seed + 1, wrong + len(found)
        for each in found:
            print(each, flush=True)
    print(f"{done:,} particle-steps, {wrong} broken rules")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
