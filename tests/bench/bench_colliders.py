"""Particles about a mesh: particle-steps per second of CPU time, against no mesh and against Warp's mesh query.

    python tests/bench/bench_colliders.py [--particles N] [--warp PYTHON]

A cloud of particles flies about a ball with dents of 81 920 triangles, in a box twice as wide, so that most of them are
far from it, as from most of any surface; those that meet it bounce. With --warp, the interpreter of an environment with
warp-lang and numpy steps some of the same particles on the CPU as its example of particles on a mesh does: symplectic
Euler in single precision, and where the nearest point of the mesh says that a step ends inside, back to the surface with
the same restitution. The bound of that query is the reach of a step, which must be known before, or 1.5 m as in the
example. psim finds the time of impact along the way instead, in double precision. Both run on one thread.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import careful, columns, position, program, run

from particlesim.colliders import MeshCollider
from particlesim.colliders.gaps import gaps_of
from particlesim.forces import Gravity

WARPED = 200_000
"""Particles that Warp steps: few enough that it does not take minutes."""
WARP = """
import sys, time
import numpy as np, warp as wp
wp.config.quiet = True
wp.init()
data = np.load(sys.argv[1])
@wp.kernel
def step(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), reach: float, dt: float):
    i = wp.tid()
    u = v[i] + wp.vec3(0.0, -9.80665, 0.0) * dt
    end = x[i] + u * dt
    q = wp.mesh_query_point_sign_normal(mesh, end, reach)
    if q.result:
        there = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
        gap = q.sign * wp.length(end - there)
        if gap < 0.0:
            n = q.sign * wp.normalize(end - there)
            end = end - gap * n
            u = u - 1.5 * wp.min(wp.dot(u, n), 0.0) * n
    x[i] = end
    v[i] = u
points = wp.array(data["vertices"].astype(np.float32), dtype=wp.vec3, device="cpu")
faces = wp.array(data["faces"].astype(np.int32).ravel(), dtype=int, device="cpu")
mesh = wp.Mesh(points=points, indices=faces)
for reach, steps in ((float(data["reach"]), 50), (1.5, 1)):
    best = 1e300
    for _ in range(4):
        x, v = (wp.array(data[k].astype(np.float32), dtype=wp.vec3, device="cpu") for k in ("x", "v"))
        begin = time.process_time()
        for _ in range(steps):
            wp.launch(step, dim=len(x), inputs=[mesh.id, x, v, reach, float(data["dt"])], device="cpu")
        wp.synchronize()
        best = min(best, (time.process_time() - begin) / steps)
    print(best)
"""


def dented_ball() -> MeshCollider:
    """81 920 triangles."""
    ico = trimesh.creation.icosphere(subdivisions=6)
    v = np.asarray(ico.vertices)
    r = 1 + 0.12 * np.sin(7 * v[:, 0]) * np.sin(6 * v[:, 1] + 1) * np.sin(8 * v[:, 2])
    mesh = MeshCollider(path="ball.ply", restitution=0.5)
    mesh.take((v * r[:, None], np.asarray(ico.faces)))
    return mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--particles", type=int, default=1_000_000)
    parser.add_argument("--warp", help="the Python of an environment with warp-lang")
    options = parser.parse_args()
    n, steps, dt = options.particles, 50, 1e-3  # as many as a run of a million takes at a time
    rng = np.random.default_rng(1)
    x = rng.uniform(-2, 2, (n, 3))
    began = time.process_time()
    mesh = dented_ball()
    record = mesh.record()
    print(f"the tree of {len(mesh.triangles().faces):,} triangles: {time.process_time() - began:.2f} s")
    out = np.empty(n)
    gaps_of(record.shape, *np.ascontiguousarray(x.T), np.zeros(n), 0.0, out)
    x = x[out > 0]
    n = len(x)
    v = rng.normal(0, 1, (n, 3))
    forces = (Gravity().record(),)
    rates = {}
    for name, contacts in (("without a collider", careful()), ("with the mesh", None)):
        if contacts is None:
            contacts = careful(continuous=[record], reach=mesh.reach(), tolerance=16 * np.finfo(float).eps)
            contacts = contacts._replace(one_by_one=())
        best = 0.0
        for _ in range(4):  # the first one compiles
            c = columns(x, v, radius=0.0)
            began = time.process_time()
            run(program("velocity_verlet", forces, contacts), c, steps, dt)
            best = max(best, n * steps / (time.process_time() - began))
        rates[name] = best
        print(f"{name}: {best / 1e6:.1f} M particle-steps per second of CPU time")
    gaps_of(record.shape, *np.ascontiguousarray(position(c).T), np.zeros(n), 0.0, out[:n])
    print(f"smallest gap at the end: {out[:n].min():.1e} m")
    if options.warp:
        with tempfile.TemporaryDirectory() as folder:
            data = Path(folder) / "data.npz"
            surface = mesh.triangles()
            reach = float(np.abs(v).max() * dt)
            given = {"x": x[:WARPED], "v": v[:WARPED], "reach": reach, "dt": dt}
            np.savez(data, vertices=surface.corners, faces=surface.faces, **given)
            script = Path(folder) / "ask.py"
            script.write_text(WARP)
            found = subprocess.run(
                [options.warp, str(script), str(data)], capture_output=True, text=True, check=True
            ).stdout
        for what, line in zip(
            ("within the reach of a step", "within 1.5 m"), found.split()[-2:], strict=True
        ):
            rate = len(given["x"]) / float(line)
            ratio = rates["with the mesh"] / rate
            print(
                f"Warp, nearest point {what}: {rate / 1e6:.2f} M particle-steps a second; psim {ratio:.1f} ×"
            )


if __name__ == "__main__":
    main()
