"""The spring workload in other tools: a lying cloth of W × W particles held at two corners, springs with dampers between
neighbours, diagonals and every other particle, gravity, symplectic Euler.

usage: python w2_peers.py warp|newton W STEPS DT; prints the best rate in springs per second, whole steps. Warp is written by
hand in float64; Newton's own semi-implicit solver knows float32 alone. Both have one thread on their CPU device.
"""

import os
import sys
import time

STIFFNESS, DAMPING, MASS, G = 50.0, 1e-3, 0.2, 9.80665


def cloth(width):
    """Positions, springs [n, 2], rest lengths, inverse masses."""
    import numpy as np

    ids = np.arange(width * width).reshape(width, width)
    i, j = np.divmod(ids.ravel(), width)
    x = np.stack([j, np.zeros_like(i), i], axis=1) / (width - 1)
    ends = [
        (ids[:-1], ids[1:]),
        (ids[:, :-1], ids[:, 1:]),
        (ids[:-1, :-1], ids[1:, 1:]),
        (ids[:-1, 1:], ids[1:, :-1]),
        (ids[:-2], ids[2:]),
        (ids[:, :-2], ids[:, 2:]),
    ]
    springs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in ends])
    rest = np.linalg.norm(x[springs[:, 0]] - x[springs[:, 1]], axis=1)
    inverse = np.full(width * width, width * width / MASS)
    inverse[0] = inverse[width - 1] = 0
    return x, springs.astype(np.int32), rest, inverse


def best_rate(springs, steps, run, repeats=3):
    """Best of some runs, after one that compiles."""
    run()
    best = 0.0
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        best = max(best, springs * steps / (time.perf_counter() - begin))
    return best


def captured(wp, loop):
    """The launches of a loop as one graph, the fastest way to run them again."""
    with wp.ScopedCapture() as capture:
        loop()
    return lambda: wp.capture_launch(capture.graph)


def warp_rate(width, steps, dt):
    """A kernel that adds every spring's force to both ends, and one that moves particles."""
    import warp as wp

    wp.config.quiet = True
    wp.config.enable_backward = False
    wp.init()

    @wp.kernel
    def pull(
        x: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        ends: wp.array(dtype=wp.vec2i),
        rest: wp.array(dtype=wp.float64),
        f: wp.array(dtype=wp.vec3d),
    ):
        s = wp.tid()
        i, j = ends[s][0], ends[s][1]
        d = x[j] - x[i]
        length = wp.length(d)
        e = d / length
        strength = wp.float64(STIFFNESS) * (length - rest[s]) + wp.float64(DAMPING) * wp.dot(v[j] - v[i], e)
        wp.atomic_add(f, i, strength * e)
        wp.atomic_sub(f, j, strength * e)

    @wp.kernel
    def move(
        x: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        f: wp.array(dtype=wp.vec3d),
        inverse: wp.array(dtype=wp.float64),
        h: wp.float64,
    ):
        i = wp.tid()
        if inverse[i] > wp.float64(0.0):
            down = wp.vec3d(wp.float64(0.0), wp.float64(G), wp.float64(0.0))
            u = v[i] + h * (inverse[i] * f[i] - down)
            v[i] = u
            x[i] = x[i] + h * u
        f[i] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))

    x0, springs, rest0, inverse0 = cloth(width)
    n, number = len(x0), len(springs)
    with wp.ScopedDevice("cpu"):
        x, v, f = wp.array(x0, dtype=wp.vec3d), wp.zeros(n, dtype=wp.vec3d), wp.zeros(n, dtype=wp.vec3d)
        ends = wp.array(springs, dtype=wp.vec2i)
        rest, inverse = wp.array(rest0, dtype=wp.float64), wp.array(inverse0, dtype=wp.float64)

        def loop():
            for _ in range(steps):
                wp.launch(pull, dim=number, inputs=[x, v, ends, rest, f])
                wp.launch(move, dim=n, inputs=[x, v, f, inverse, wp.float64(dt)])

        loop()
        return best_rate(number, steps, captured(wp, loop))


def newton_rate(width, steps, dt):
    """Newton's semi-implicit solver, springs alone."""
    import newton
    import numpy as np
    import warp as wp

    wp.config.quiet = True
    x0, springs, _, inverse = cloth(width)
    mass = np.divide(1, inverse, out=np.zeros_like(inverse), where=inverse > 0)
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -G, 0.0))
        builder.add_particles(
            pos=x0.tolist(), vel=np.zeros_like(x0).tolist(), mass=mass.tolist(), radius=[0.0] * len(x0)
        )
        for i, j in springs.tolist():
            builder.add_spring(i, j, STIFFNESS, DAMPING, 0.0)
        model = builder.finalize()
        model.particle_grid = None
        solver = newton.solvers.SolverSemiImplicit(model, enable_tri_contact=False)
        a, b = model.state(), model.state()

        def loop():
            for _ in range(steps // 2):
                a.clear_forces()
                solver.step(a, b, None, None, dt)
                b.clear_forces()
                solver.step(b, a, None, None, dt)

        loop()
        return best_rate(len(springs), steps // 2 * 2, captured(wp, loop))


if __name__ == "__main__":
    rates = {"warp": warp_rate, "newton": newton_rate}
    output = os.dup(1)
    os.dup2(2, 1)  # banners go to stderr
    rate = rates[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
    os.write(output, f"{rate:.6e}\n".encode())
