/* Gravity of all pairs by the textbook's loop, for bench_pairs.py:
   gcc -O3 -march=native -mprefer-vector-width=512 -ffast-math -fopenmp -shared -fPIC pairs.c -lm */

#include <math.h>
#include <omp.h>

void direct(long n, const double *x, const double *y, const double *z, const double *m, double eps2, double *a, int threads)
{
    omp_set_num_threads(threads);
#pragma omp parallel for schedule(static)
    for (long i = 0; i < n; i++) {
        double ax = 0, ay = 0, az = 0, xi = x[i], yi = y[i], zi = z[i];
        for (long j = 0; j < n; j++) {
            double dx = x[j] - xi, dy = y[j] - yi, dz = z[j] - zi;
            double r2 = dx * dx + dy * dy + dz * dz + eps2;
            double k = m[j] / (r2 * sqrt(r2));
            ax += k * dx;
            ay += k * dy;
            az += k * dz;
        }
        a[i] = ax;
        a[n + i] = ay;
        a[2 * n + i] = az;
    }
}
