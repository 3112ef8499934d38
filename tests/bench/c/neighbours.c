// Lennard-Jones forces over the same lists as bench_neighbours.py, two ways, for comparison only.
//   lanes:  the eight particles of a group in one vector, candidate after candidate (the loop of psim)
//   packed: the candidates of a group packed once, four particles at a time, vectors along the candidates
// gcc -O3 -march=native -ffast-math -mprefer-vector-width=512 -shared -fPIC
#include <math.h>
#include <stdint.h>

#define MASK ((1u << 27) - 1)

void lanes(const double *x, long room, const double *images, const int64_t *begin, const int64_t *count,
           const uint32_t *candidates, long groups, double depth, double square, double most, double *pull) {
    const double *y = x + room, *z = y + room;
    for (long g = 0; g < groups; g++) {
        double tx[8], ty[8], tz[8], ax[8] = {0}, ay[8] = {0}, az[8] = {0};
        for (int i = 0; i < 8; i++) tx[i] = x[8 * g + i], ty[i] = y[8 * g + i], tz[i] = z[8 * g + i];
        const uint32_t *list = candidates + begin[g];
        for (long j = 0; j < count[g]; j++) {
            uint32_t q = list[j] & MASK, image = list[j] >> 27;
            double u = x[q] + images[image], v = y[q] + images[27 + image], w = z[q] + images[54 + image];
#pragma GCC ivdep
            for (int i = 0; i < 8; i++) {
                double dx = tx[i] - u, dy = ty[i] - v, dz = tz[i] - w, s = dx * dx + dy * dy + dz * dz;
                int near = (s > 0) & (s < most);
                double inverse = 1 / (near ? s : 1), ratio = square * inverse, sixth = ratio * ratio * ratio;
                double k = near ? 6 * depth * sixth * (2 * sixth - 1) * inverse : 0;
                ax[i] += k * dx, ay[i] += k * dy, az[i] += k * dz;
            }
        }
        for (int i = 0; i < 8; i++) {
            pull[3 * (8 * g + i)] = ax[i], pull[3 * (8 * g + i) + 1] = ay[i], pull[3 * (8 * g + i) + 2] = az[i];
        }
    }
}

void packed(const double *x, long room, const double *images, const int64_t *begin, const int64_t *count,
            const uint32_t *candidates, long groups, double depth, double square, double most, double *pull) {
    static _Thread_local double sx[8192] __attribute__((aligned(64))), sy[8192] __attribute__((aligned(64))),
        sz[8192] __attribute__((aligned(64)));
    const double *y = x + room, *z = y + room;
    for (long g = 0; g < groups; g++) {
        const uint32_t *list = candidates + begin[g];
        long n = count[g];
        for (long j = 0; j < n; j++) {
            uint32_t q = list[j] & MASK, image = list[j] >> 27;
            sx[j] = x[q] + images[image], sy[j] = y[q] + images[27 + image], sz[j] = z[q] + images[54 + image];
        }
        while (n % 8) sx[n] = sy[n] = sz[n] = 1e9, n++;
        for (long t = 8 * g; t < 8 * g + 8; t += 4) {
            double f[4][3] = {{0}};
            for (long j = 0; j < n; j++) {
#pragma GCC unroll 4
                for (int i = 0; i < 4; i++) {
                    double dx = x[t + i] - sx[j], dy = y[t + i] - sy[j], dz = z[t + i] - sz[j];
                    double s = dx * dx + dy * dy + dz * dz;
                    s = s > 0 ? s : most;
                    double inverse = 1 / s, ratio = square * inverse, sixth = ratio * ratio * ratio;
                    double k = s < most ? 6 * depth * sixth * (2 * sixth - 1) * inverse : 0;
                    f[i][0] += k * dx, f[i][1] += k * dy, f[i][2] += k * dz;
                }
            }
            for (int i = 0; i < 4; i++)
                for (int d = 0; d < 3; d++) pull[3 * (t + i) + d] = f[i][d];
        }
    }
}
