"""Newton's grains and boxes, as a process that is told how many steps to make, for benches that take turns with it.

usage: python newton_peer.py grains|boxes START.npz DT ITERATIONS. `grains` are its particles, whose contacts are linear
springs without a memory, by its semi-implicit solver and its grid; `boxes` are its rigid bodies on a plane, by XPBD with so
many iterations. Every line of input is a number of steps; the answer is the CPU time that they took [s], and for boxes
START.npz.now.npy has then their places and orientations (x, y, z, and x, y, z, w of quaternions). One thread, float32.
"""

import subprocess
import sys
import time

import numpy as np


class Newton:
    """Such a process, run by a Python that has newton and told the start as arrays."""

    def __init__(self, python, what, start, dt, iterations=2, **arrays):
        self.start = str(start)
        np.savez(self.start, **arrays)
        command = [python, __file__, what, self.start, str(dt), str(iterations)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.spent(0)  # it has compiled then

    def spent(self, steps):
        """Make some steps; the CPU seconds that they took."""
        self._process.stdin.write(f"{steps}\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith("took "):
                return float(line[5:])
        raise RuntimeError("newton has ended")

    def now(self):
        """Places and orientations of boxes, shape [7, n]."""
        return np.load(f"{self.start}.now.npy").T

    def close(self):
        """End it."""
        self._process.stdin.close()
        self._process.wait()


def particles(newton, builder, given):
    """Grains as particles."""
    n = len(given["x"])
    mass, r = float(given["mass"]), float(given["radius"])
    builder.add_particles(given["x"].tolist(), np.zeros((n, 3)).tolist(), [mass] * n, radius=[r] * n)
    model = builder.finalize(device="cpu")
    model.particle_ke, model.particle_kd, model.particle_kf = float(given["stiffness"]), 1e-3, 1e-3
    model.particle_mu = float(given["friction"])
    return model, newton.solvers.SolverSemiImplicit(model, enable_tri_contact=False), lambda state: None


def boxes(newton, builder, given, iterations):
    """Boxes as rigid bodies upon a plane."""
    shape = newton.ModelBuilder.ShapeConfig(density=float(given["density"]), mu=float(given["friction"]))
    hx, hy, hz = (float(size) / 2 for size in given["size"])
    for x, q in zip(given["x"], given["q"], strict=True):
        body = builder.add_body(xform=(*x, *q))
        builder.add_shape_box(body, hx=hx, hy=hy, hz=hz, cfg=shape)
    builder.add_ground_plane(cfg=shape)
    model = builder.finalize(device="cpu")
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()

    def look(state):
        pipeline.collide(state, contacts)
        return contacts

    return model, newton.solvers.SolverXPBD(model, iterations=iterations), look


def main():
    """Answer."""
    import newton

    what, file, dt, iterations = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
    given = dict(np.load(file))
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -9.80665, 0.0))
    made = (
        particles(newton, builder, given) if what == "grains" else boxes(newton, builder, given, iterations)
    )
    model, solver, look = made
    control = model.control()

    def run(now, then, steps):
        for _ in range(steps):
            now.clear_forces()
            solver.step(now, then, control, look(now), dt)
            now, then = then, now
        return now, then

    run(model.state(), model.state(), 2)  # which compiles
    now, then = model.state(), model.state()
    for line in sys.stdin:
        begin = time.process_time()
        now, then = run(now, then, int(line))
        spent = time.process_time() - begin
        if what == "boxes":
            np.save(f"{file}.now.npy", now.body_q.numpy())
        print(f"took {spent}", flush=True)


if __name__ == "__main__":
    main()
