"""Gravity in a periodic box by a mesh: against the tree of as many bodies, at an error of 1e-3.

    python tests/bench/bench_mesh.py [--bodies 1000000] [--threads 2] [--rounds 3] [--nodes 128] [--accuracy 1e-3]

Bodies are spread at random. The plan is made for a mesh of `--nodes` along each axis, with the near part that the accuracy
then needs; its error is measured on a thousand bodies against Ewald's sums. Times are processor times of a sum of forces,
rounds of all in turn, the best of each: of clouds of the third order (TSC) alone, of the mesh alone (particles to it,
transforms and back), with the near part while lists hold, and with lists that are built. The tree sums over the bodies of
the box alone, without their images, at the same accuracy.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import particlesim as ps
from particlesim.compiler import kernel
from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.interaction import Lone
from particlesim.engine.interactions.mesh import plan
from particlesim.engine.interactions.mesh.bricks import new_bricks
from particlesim.engine.interactions.mesh.mesh_pairs import (
    MeshPairs,
    far_forces,
    on_mesh,
)
from particlesim.engine.interactions.near_pairs import near_forces
from particlesim.engine.interactions.neighbours.record import DUE, forget
from particlesim.engine.interactions.tree import calibration as tree_calibration
from particlesim.engine.interactions.tree.field import new_tree
from particlesim.engine.interactions.tree.form import Form, Gradient, OneSign, Plummer
from particlesim.engine.simulation import Simulation


@kernel
def on_mesh_alone(each: Any, share: Any) -> None:
    """The far part."""
    far_forces(on_mesh(each), each.influence, each.aim.strength, each.pull, share)


def scenario(count: int, accuracy: float) -> ps.Scenario:
    """Bodies at random in a box of 1 m."""
    shape = {"type": "box", "min": [0, 0, 0], "max": [1, 1, 1]}
    return ps.from_table(
        {
            "simulation": {"duration": 1e-3, "dt": 1e-3, "box": {"size": [1, 1, 1]}},
            "particles": [
                {
                    "name": "bodies",
                    "mass": 1 / count,
                    "layout": {"type": "random", "count": count, "shape": shape},
                }
            ],
            "interactions": [{"type": "gravity", "constant": 1.0, "accuracy": accuracy}],
        }
    )


def taken(work: Callable[[], Any]) -> float:
    """Processor time of some work [s]."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bodies", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--nodes", type=int, default=128)
    parser.add_argument("--accuracy", type=float, default=1e-3)
    options = parser.parse_args()
    plan.SIZES = [options.nodes]  # no other mesh
    simulation = Simulation(scenario(options.bodies, options.accuracy), threads=options.threads)
    island, team = simulation.islands[0], simulation.team
    island.begin(team)
    (each,) = island.interactions
    c = island.island_columns()
    assert isinstance(each, MeshPairs)
    print(each.summary(), flush=True)
    threads = options.threads
    mesh, gate = each.in_team(threads), new_gate()

    def together(work: Callable[[Lone], Any]) -> Callable[[], None]:
        return lambda: team.each(lambda k: work(Lone(0, 0, k, threads, gate)), threads)

    def all_of_it(share: Lone) -> None:
        near_forces(mesh, c, share, 0.0)

    room = len(mesh.pull)
    clouds = mesh._replace(spline=(None,) * 3, bricks=new_bricks(mesh.made.shape, room, threads))
    x = np.stack([c.x, c.y, c.z])
    mass = np.full(options.bodies, 1 / options.bodies)
    order = tree_calibration.order_for(options.accuracy)
    form = Form((None,) * order, OneSign(), Plummer(0.0), Gradient())
    tree = tree_calibration.for_threads(new_tree(form, options.bodies, 1), threads)
    limits = np.array([*tree_calibration.first_limits(options.accuracy), options.accuracy, 0.0])
    size = np.zeros(options.bodies)
    tree_calibration.calibrate(tree, limits, size, tuple(x), mass, team)
    print(f"tree: order {order}, rms {limits[tree_calibration.ERROR]:.1e}", flush=True)

    def with_tree() -> None:
        tree_calibration.evaluate(tree, limits, size, tuple(x), mass, team, threads)

    works = {
        "tree": with_tree,
        "clouds (TSC) alone": together(lambda share: on_mesh_alone(clouds, share)),
        "mesh alone": together(lambda share: on_mesh_alone(mesh, share)),
        "mesh and near part": together(all_of_it),
        "mesh, near part and lists": together(all_of_it),
    }
    best = dict.fromkeys(works, math.inf)
    for turn in range(options.rounds + 1):
        for name, work in works.items():
            mesh.near.report[DUE] = 1
            if "lists" in name:
                forget(mesh.near)
            spent = taken(work)
            if turn > 0:
                best[name] = min(best[name], spent)
    for name, spent in best.items():
        print(
            f"{name:26}: {spent / options.bodies * 1e6:6.3f} us a body, {spent / best['tree']:.2f} of the tree"
        )
    simulation.close()


if __name__ == "__main__":
    main()
