/* A cloth of w × w particles, symplectic Euler, float64, in C that knows the grid.

   usage: w2_cloth W STEPS REPEATS DT grid|scatter; prints the best rate in springs per second.

   "grid": every particle adds up its own springs, so that nothing is shared between threads; each spring is evaluated
   twice, without any index list, in vectors along a row. "scatter": an index list on one thread, each spring evaluated
   once and added to both of its ends. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double STIFFNESS[3] = {50, 50, 50}, DAMPING = 1e-3, GRAVITY = 9.80665;
static const int NEIGHBOUR[12][3] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {1, 1, 1},  {1, -1, 1},
                                     {-1, 1, 1}, {-1, -1, 1}, {0, 2, 2}, {0, -2, 2}, {2, 0, 2}, {-2, 0, 2}};

typedef struct {
    double *x[3], *v[3], *f[3], *inverse_mass;
    int w;
} Cloth;

static Cloth cloth(int w)
{
    Cloth c = {.w = w};
    size_t n = (size_t)w * w;
    for (int k = 0; k < 3; k++) {
        c.x[k] = calloc(n, sizeof(double));
        c.v[k] = calloc(n, sizeof(double));
        c.f[k] = calloc(n, sizeof(double));
    }
    c.inverse_mass = calloc(n, sizeof(double));
    return c;
}

static void reset(Cloth c)
{
    for (int i = 0; i < c.w; i++)
        for (int j = 0; j < c.w; j++) {
            size_t p = (size_t)i * c.w + j;
            c.x[0][p] = (double)j / (c.w - 1);
            c.x[1][p] = 0;
            c.x[2][p] = (double)i / (c.w - 1);
            c.v[0][p] = c.v[1][p] = c.v[2][p] = 0;
            c.inverse_mass[p] = (double)c.w * c.w / 0.2;
        }
    c.inverse_mass[0] = c.inverse_mass[c.w - 1] = 0;
}

static void forces_on_row(Cloth c, int row, const double rest[3])
{
    const double *restrict x = c.x[0], *restrict y = c.x[1], *restrict z = c.x[2];
    const double *restrict u = c.v[0], *restrict v = c.v[1], *restrict w = c.v[2];
    ptrdiff_t a = (ptrdiff_t)row * c.w;
    double *restrict fx = c.f[0] + a, *restrict fy = c.f[1] + a, *restrict fz = c.f[2] + a;
    for (int j = 0; j < c.w; j++)
        fx[j] = fy[j] = fz[j] = 0;
    for (int t = 0; t < 12; t++) {
        int up = NEIGHBOUR[t][0], aside = NEIGHBOUR[t][1], kind = NEIGHBOUR[t][2];
        if (row + up < 0 || row + up >= c.w)
            continue;
        int first = aside < 0 ? -aside : 0, last = aside > 0 ? c.w - aside : c.w;
        ptrdiff_t b = a + (ptrdiff_t)up * c.w + aside;
        double k = STIFFNESS[kind], length = rest[kind];
#pragma omp simd
        for (int j = first; j < last; j++) {
            double dx = x[b + j] - x[a + j], dy = y[b + j] - y[a + j], dz = z[b + j] - z[a + j];
            double square = dx * dx + dy * dy + dz * dz, inverse = 1 / sqrt(square);
            double along = ((u[b + j] - u[a + j]) * dx + (v[b + j] - v[a + j]) * dy + (w[b + j] - w[a + j]) * dz) *
                           inverse;
            double s = (k * (square * inverse - length) + DAMPING * along) * inverse;
            fx[j] += s * dx;
            fy[j] += s * dy;
            fz[j] += s * dz;
        }
    }
}

static void move(Cloth c, ptrdiff_t first, ptrdiff_t last, double dt)
{
    for (int k = 0; k < 3; k++) {
        double *restrict x = c.x[k], *restrict v = c.v[k], *restrict f = c.f[k], fall = k == 1 ? GRAVITY * dt : 0;
#pragma omp simd
        for (ptrdiff_t i = first; i < last; i++) {
            v[i] += c.inverse_mass[i] * dt * f[i] - (c.inverse_mass[i] > 0 ? fall : 0);
            x[i] += dt * v[i];
        }
    }
}

static void run_grid(Cloth c, int steps, double dt, const double rest[3])
{
#pragma omp parallel
    for (int t = 0; t < steps; t++) {
#pragma omp for schedule(static)
        for (int row = 0; row < c.w; row++)
            forces_on_row(c, row, rest);
#pragma omp for schedule(static)
        for (int row = 0; row < c.w; row++)
            move(c, (ptrdiff_t)row * c.w, (ptrdiff_t)(row + 1) * c.w, dt);
    }
}

static void run_scatter(Cloth c, int steps, double dt, const double rest[3], const int (*springs)[3], size_t count)
{
    size_t n = (size_t)c.w * c.w;
    for (int t = 0; t < steps; t++) {
        for (int k = 0; k < 3; k++)
            memset(c.f[k], 0, n * sizeof(double));
        for (size_t q = 0; q < count; q++) {
            int i = springs[q][0], j = springs[q][1], kind = springs[q][2];
            double d[3], square = 0, along = 0;
            for (int k = 0; k < 3; k++) {
                d[k] = c.x[k][j] - c.x[k][i];
                square += d[k] * d[k];
                along += (c.v[k][j] - c.v[k][i]) * d[k];
            }
            double inverse = 1 / sqrt(square);
            double s = (STIFFNESS[kind] * (square * inverse - rest[kind]) + DAMPING * along * inverse) * inverse;
            for (int k = 0; k < 3; k++) {
                c.f[k][i] += s * d[k];
                c.f[k][j] -= s * d[k];
            }
        }
        move(c, 0, (ptrdiff_t)n, dt);
    }
}

int main(int argc, char **argv)
{
    if (argc != 6)
        return 2;
    int w = atoi(argv[1]), steps = atoi(argv[2]), repeats = atoi(argv[3]), scatter = argv[5][0] == 's';
    double dt = atof(argv[4]), d = 1.0 / (w - 1), rest[3] = {d, sqrt(2) * d, 2 * d}, best = 0;
    Cloth c = cloth(w);
    int(*springs)[3] = malloc(sizeof(int[3]) * 6 * w * w);
    size_t count = 0;
    for (int t = 0; t < 12; t++)
        for (int i = 0; i < w; i++)
            for (int j = 0; j < w; j++) {
                int ni = i + NEIGHBOUR[t][0], nj = j + NEIGHBOUR[t][1];
                if (ni < 0 || nj < 0 || ni >= w || nj >= w || ni * w + nj < i * w + j)
                    continue;
                springs[count][0] = i * w + j, springs[count][1] = ni * w + nj, springs[count++][2] = NEIGHBOUR[t][2];
            }
    for (int r = 0; r <= repeats; r++) {
        struct timespec begin, end;
        reset(c);
        clock_gettime(CLOCK_MONOTONIC, &begin);
        if (scatter)
            run_scatter(c, steps, dt, rest, springs, count);
        else
            run_grid(c, steps, dt, rest);
        clock_gettime(CLOCK_MONOTONIC, &end);
        double seconds = (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
        double rate = (double)count * steps / seconds;
        best = r > 0 && rate > best ? rate : best;
    }
    printf("%.6g\n", best);
    return 0;
}
