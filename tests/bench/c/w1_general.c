/* Hand-written reference for independent particles: gravity, quadratic drag in a wind, one plane by point and normal,
   symplectic Euler, blocked over time. All parameters are values at run time, as in a simulator.
   usage: w1_general PARTICLES STEPS BLOCK REPEATS; prints the best rate in particle-steps per second. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef struct {
  double gx, gy, gz, k, wx, wy, wz, px, py, pz, nx, ny, nz, e, loss, dt;
} Parameters;

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void step_block(int lo, int hi, int steps, const Parameters *p, double *restrict x, double *restrict y,
                       double *restrict z, double *restrict u, double *restrict v, double *restrict w,
                       const double *restrict m) {
  const Parameters q = *p;
  for (int s = 0; s < steps; s++) {
#pragma omp simd
    for (int i = lo; i < hi; i++) {
      double rx = u[i] - q.wx, ry = v[i] - q.wy, rz = w[i] - q.wz;
      double k = -q.k * sqrt(rx * rx + ry * ry + rz * rz), im = q.dt / m[i];
      double U = u[i] + (m[i] * q.gx + k * rx) * im;
      double V = v[i] + (m[i] * q.gy + k * ry) * im;
      double W = w[i] + (m[i] * q.gz + k * rz) * im;
      double X = x[i] + U * q.dt, Y = y[i] + V * q.dt, Z = z[i] + W * q.dt;
      double d = (X - q.px) * q.nx + (Y - q.py) * q.ny + (Z - q.pz) * q.nz;
      double vn = U * q.nx + V * q.ny + W * q.nz;
      int hit = d < 0 && vn < 0;
      double D = hit ? d : 0, j = hit ? -(1 + q.e) * vn : 0, f = hit ? q.loss : 0;
      x[i] = X - D * q.nx;
      y[i] = Y - D * q.ny;
      z[i] = Z - D * q.nz;
      u[i] = U + j * q.nx - f * (U - vn * q.nx);
      v[i] = V + j * q.ny - f * (V - vn * q.ny);
      w[i] = W + j * q.nz - f * (W - vn * q.nz);
    }
  }
}

int main(int argc, char **argv) {
  int n = atoi(argv[1]), steps = atoi(argv[2]), block = atoi(argv[3]), repeats = atoi(argv[4]);
  Parameters p = {0, -9.80665, 0, 0.006125, 2, 0, 0, 0, 0, 0, 0, 1, 0, 0.6, 0.1, 1e-3};
  if (argc > 5) p.wx = atof(argv[5]); /* keeps the compiler from folding the parameters */
  double *a[7];
  for (int k = 0; k < 7; k++) {
    a[k] = aligned_alloc(64, ((size_t)n * sizeof(double) + 63) / 64 * 64);
    for (int i = 0; i < n; i++)
      a[k][i] = k < 3 ? 10.0 * rand() / RAND_MAX : k < 6 ? 10.0 * rand() / RAND_MAX - 5 : 0.5 + 1.5 * rand() / RAND_MAX;
  }
  double best = 0;
  for (int r = 0; r < repeats; r++) {
    double t = now();
    int blocks = (n + block - 1) / block;
#pragma omp parallel for schedule(static)
    for (int b = 0; b < blocks; b++) {
      int lo = b * block, hi = lo + block < n ? lo + block : n;
      step_block(lo, hi, steps, &p, a[0], a[1], a[2], a[3], a[4], a[5], a[6]);
    }
    double rate = (double)n * steps / (now() - t);
    if (rate > best) best = rate;
  }
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[0][i] + a[1][i];
  fprintf(stderr, "checksum %.6f\n", sum);
  printf("%.6e\n", best);
  return 0;
}
