"""Gravity of all pairs in other tools: bodies in a ball, float64, softened.

usage: python pairs_peers.py pytreegrav|rebound BODIES; prints the best CPU time of a sum of forces, in pairs per second.
"""

import sys
import time


def initial(n):
    """Places in a ball, and masses."""
    import numpy as np

    rng = np.random.default_rng(1)
    x = rng.normal(size=(n, 3))
    x *= (rng.uniform(0, 1, n) ** (1 / 3) / np.linalg.norm(x, axis=1))[:, None]
    return x, np.full(n, 1.0 / n)


def best_rate(n, run, repeats=3):
    """Best of some runs by CPU time, after one that compiles."""
    run()
    best = 0.0
    for _ in range(repeats):
        begin = time.process_time()
        run()
        best = max(best, n * n / (time.process_time() - begin))
    return best


def pytreegrav_rate(n):
    """Its brute force, one thread."""
    import numpy as np
    import pytreegrav

    x, m = initial(n)
    h = np.full(n, 0.01)
    return best_rate(n, lambda: pytreegrav.Accel(x, m, h, method="bruteforce", parallel=False))


def rebound_rate(n):
    """A step of its leapfrog, which sums forces once."""
    import rebound

    x, m = initial(n)
    simulation = rebound.Simulation()
    simulation.integrator, simulation.gravity = "leapfrog", "basic"
    simulation.softening, simulation.dt = 0.01, 1e-6
    for place, mass in zip(x, m, strict=True):
        simulation.add(m=mass, x=place[0], y=place[1], z=place[2])
    return best_rate(n, lambda: simulation.steps(1))


print({"pytreegrav": pytreegrav_rate, "rebound": rebound_rate}[sys.argv[1]](int(sys.argv[2])))
