"""The stepping workload in other tools: gravity, quadratic drag in a wind, the plane y = 0, symplectic Euler, float64.

usage: python w1_peers.py numpy|taichi|jax|warp PARTICLES STEPS; prints the best rate in particle-steps per second.
"""

import os
import sys
import time

G, K, WIND, RESTITUTION, KEEP, DT = 9.80665, 0.5 * 1.225 * 0.01, 2.0, 0.6, 0.9, 1e-3


def initial(n):
    """Positions, velocities, masses."""
    import numpy as np

    rng = np.random.default_rng(1)
    return rng.uniform(0, 10, (n, 3)), rng.normal(0, 5, (n, 3)), rng.uniform(0.5, 2, n)


def best_rate(n, steps, run, repeats=3):
    """Best of some runs, after one that compiles."""
    run()
    best = 0.0
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        best = max(best, n * steps / (time.perf_counter() - begin))
    return best


def numpy_rate(n, steps):
    """Straightforward vectorised NumPy."""
    import numpy as np

    x0, v0, m = initial(n)
    c = (K / m)[:, None]
    bounce = np.array([KEEP, -RESTITUTION, KEEP])

    def run():
        x, v = x0.copy(), v0.copy()
        for _ in range(steps):
            u = v - np.array([WIND, 0, 0])
            v += DT * (np.array([0, -G, 0]) - c * np.sqrt(np.einsum("ij,ij->i", u, u))[:, None] * u)
            x += DT * v
            hit = x[:, 1] < 0
            x[hit, 1] = 0
            v[hit] *= bounce

    return best_rate(n, steps, run, repeats=1)


def taichi_rate(n, steps):
    """One fused Taichi kernel per step on the CPU."""
    import taichi as ti

    ti.init(arch=ti.cpu, default_fp=ti.f64, log_level=ti.ERROR)
    x, v, c = ti.Vector.field(3, ti.f64, n), ti.Vector.field(3, ti.f64, n), ti.field(ti.f64, n)
    x0, v0, m = initial(n)
    x.from_numpy(x0)
    v.from_numpy(v0)
    c.from_numpy(K / m)

    @ti.kernel
    def step():
        for i in range(n):
            vi = v[i]
            u = vi - ti.Vector([WIND, 0.0, 0.0])
            vi -= DT * (c[i] * u.norm() * u + ti.Vector([0.0, G, 0.0]))
            xi = x[i] + DT * vi
            if xi[1] < 0.0:
                xi[1] = 0.0
                vi = ti.Vector([vi[0] * KEEP, -vi[1] * RESTITUTION, vi[2] * KEEP])
            x[i] = xi
            v[i] = vi

    def run():
        for _ in range(steps):
            step()
        ti.sync()

    return best_rate(n, steps, run)


def jax_rate(n, steps):
    """A jitted JAX loop over all steps on the CPU."""
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    x0, v0, m = initial(n)
    c = jnp.asarray(K / m)

    def one(_, s):
        x, y, z, u, v, w = s
        r = u - WIND
        k = c * jnp.sqrt(r * r + v * v + w * w) * DT
        u, v, w = u - k * r, v - k * v - G * DT, w - k * w
        x, y, z = x + DT * u, y + DT * v, z + DT * w
        hit = y < 0
        return (
            x, jnp.where(hit, 0, y), z,
            jnp.where(hit, u * KEEP, u), jnp.where(hit, -v * RESTITUTION, v), jnp.where(hit, w * KEEP, w),
        )  # fmt: skip

    simulate = jax.jit(lambda s: jax.lax.fori_loop(0, steps, one, s))
    state = tuple(jnp.asarray(column) for column in (*x0.T, *v0.T))
    return best_rate(n, steps, lambda: jax.block_until_ready(simulate(state)))


def warp_rate(n, steps):
    """One fused Warp kernel per step on its CPU device."""
    import warp as wp

    wp.config.quiet = True
    wp.init()

    @wp.kernel
    def step(x: wp.array(dtype=wp.vec3d), v: wp.array(dtype=wp.vec3d), c: wp.array(dtype=wp.float64)):
        i = wp.tid()
        vi = v[i]
        u = vi - wp.vec3d(wp.float64(WIND), wp.float64(0.0), wp.float64(0.0))
        down = wp.vec3d(wp.float64(0.0), wp.float64(G), wp.float64(0.0))
        vi = vi - wp.float64(DT) * (c[i] * wp.length(u) * u + down)
        xi = x[i] + wp.float64(DT) * vi
        if xi[1] < wp.float64(0.0):
            xi = wp.vec3d(xi[0], wp.float64(0.0), xi[2])
            vi = wp.vec3d(
                vi[0] * wp.float64(KEEP), -vi[1] * wp.float64(RESTITUTION), vi[2] * wp.float64(KEEP)
            )
        x[i] = xi
        v[i] = vi

    x0, v0, m = initial(n)
    with wp.ScopedDevice("cpu"):
        x, v, c = (
            wp.array(x0, dtype=wp.vec3d),
            wp.array(v0, dtype=wp.vec3d),
            wp.array(K / m, dtype=wp.float64),
        )
        command = wp.launch(step, dim=n, inputs=[x, v, c], record_cmd=True)

        def run():
            for _ in range(steps):
                command.launch()

        return best_rate(n, steps, run)


if __name__ == "__main__":
    rates = {"numpy": numpy_rate, "taichi": taichi_rate, "jax": jax_rate, "warp": warp_rate}
    output = os.dup(1)
    os.dup2(2, 1)  # banners go to stderr
    rate = rates[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]))
    os.write(output, f"{rate:.6e}\n".encode())
