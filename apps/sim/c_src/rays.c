/* Noise, distance fields, and rays among walls and discs. */
#include <math.h>
#include <string.h>

#include "kernel.h"

static uint32_t mix(uint32_t x)
{
    x += 0x9E3779B9u;
    x = (x ^ (x >> 16)) * 0x5BD1E95u;
    x = (x ^ (x >> 13)) * 0x6C8E9CFu;
    return x ^ (x >> 16);
}

uint32_t sim_hash(uint32_t seed, uint32_t a, uint32_t b, uint32_t c)
{
    return mix(mix(mix(mix(seed) ^ a) ^ b) ^ c);
}

double sim_gauss(uint32_t hash)
{
    int sum = (int)((hash & 255) + ((hash >> 8) & 255) + ((hash >> 16) & 255) + (hash >> 24));
    return (sum - 510) / 147.8;
}

static uint8_t least3(uint8_t a, uint8_t b, uint8_t c)
{
    uint8_t m = a < b ? a : b;
    return m < c ? m : c;
}

static uint8_t further(uint8_t steps)
{
    return steps < 255 ? steps + 1 : 255;
}

/* One row of a pass: first from the row before it, which any order will do for, then from the
 * cell before each in this row. Beyond the border is wall. */
static void sweep(const uint8_t *restrict before, uint8_t *restrict row, int64_t width,
                  int64_t step)
{
    uint8_t last = 0;

    if (before == NULL) {
        for (int64_t i = 0; i < width; i++)
            row[i] = row[i] < 1 ? row[i] : 1;
        return;
    }
    row[0] = row[0] < 1 ? row[0] : 1;
    row[width - 1] = row[width - 1] < 1 ? row[width - 1] : 1;
    for (int64_t i = 1; i < width - 1; i++) {
        uint8_t m = further(least3(before[i - 1], before[i], before[i + 1]));
        row[i] = m < row[i] ? m : row[i];
    }
    for (int64_t n = 0, i = step > 0 ? 0 : width - 1; n < width; n++, i += step) {
        uint8_t m = further(last);
        row[i] = last = m < row[i] ? m : row[i];
    }
}

void sim_field(const uint8_t *walls, int64_t width, int64_t height, uint8_t *field)
{
    for (int64_t k = 0; k < width * height; k++)
        field[k] = walls[k] ? 0 : 255;
    for (int64_t j = 0; j < height; j++)
        sweep(j > 0 ? field + (j - 1) * width : NULL, field + j * width, width, 1);
    for (int64_t j = height - 1; j >= 0; j--)
        sweep(j < height - 1 ? field + (j + 1) * width : NULL, field + j * width, width, -1);
}

static inline int64_t floored(double x)
{
    int64_t i = (int64_t)x;
    return i - (x < (double)i);
}

/* When the ray leaves the free square along one axis. */
static inline double leave(double inverse, int64_t i, int64_t d, double cell, double p)
{
    if (inverse == 0.0)
        return 1.0e30;
    if (inverse > 0.0)
        return ((double)(i + d) * cell - p) * inverse;
    return ((double)(i - d + 1) * cell - p) * inverse;
}

/* The cell along the other axis: inside the free square, and never backwards. */
static inline int64_t aside(double inverse, double r, double p, int64_t j, int64_t d, double cell,
                            double t)
{
    if (inverse == 0.0)
        return j;
    int64_t to = floored((p + r * t) / cell);
    if (inverse > 0.0)
        return to < j ? j : to > j + d - 1 ? j + d - 1 : to;
    return to > j ? j : to < j - d + 1 ? j - d + 1 : to;
}

double sim_wall(const sim_map *map, double x, double y, double rx, double ry, double most,
                int *axis)
{
    const double cell = map->cell;
    const double px = x + (double)map->width * cell / 2;
    const double py = y + (double)map->height * cell / 2;
    const double ix = fabs(rx) < 1.0e-12 ? 0.0 : 1.0 / rx;
    const double iy = fabs(ry) < 1.0e-12 ? 0.0 : 1.0 / ry;
    int64_t i = floored(px / cell), j = floored(py / cell);
    double t = 0.0;

    *axis = 2;
    /* Each jump goes at least one cell on along one axis: more than these cannot be. */
    for (int64_t cap = map->width + map->height + 2; cap > 0; cap--) {
        int64_t d = i < 0 || j < 0 || i >= map->width || j >= map->height
                        ? 0
                        : map->field[j * map->width + i];
        if (d == 0)
            return t;

        double tx = leave(ix, i, d, cell, px), ty = leave(iy, j, d, cell, py);
        if ((tx < ty ? tx : ty) >= most)
            break;
        if (tx <= ty) {
            t = tx > t ? tx : t;
            i = ix > 0.0 ? i + d : i - d;
            j = aside(iy, ry, py, j, d, cell, t);
            *axis = 0;
        } else {
            t = ty > t ? ty : t;
            i = aside(ix, rx, px, i, d, cell, t);
            j = iy > 0.0 ? j + d : j - d;
            *axis = 1;
        }
    }
    *axis = 2;
    return most;
}

static double meet_discs(const sim_disc *near, size_t count, double rx, double ry, double best)
{
    for (size_t k = 0; k < count; k++) {
        /* An offset, and the squared distance to the edge. */
        double b = near[k].x * rx + near[k].y * ry, under = b * b - near[k].radius;
        if (near[k].radius <= 0.0)
            best = 0.0;
        else if (b > 0.0 && under >= 0.0) {
            double t = b - sqrt(under);
            best = t < best ? t : best;
        }
    }
    return best;
}

/* The discs that are within `most` of a sensor, but for the robot's own: an offset, and the squared distance to the edge. */
static size_t around(const sim_disc *discs, size_t count, size_t self, double ox, double oy,
                     double most, sim_disc *near)
{
    size_t found = 0;

    for (size_t n = 0; n < count; n++) {
        double mx = discs[n].x - ox, my = discs[n].y - oy, r = discs[n].radius;
        double m2 = mx * mx + my * my;
        if (n != self && m2 <= (most + r) * (most + r))
            near[found++] = (sim_disc){mx, my, m2 - r * r};
    }
    return found;
}

/* The discs that may be within `most` of one of the sensors, rather too many than too few, but for the robot's own. */
static size_t about(const sim_disc *discs, size_t count, const sim_ring *ring, sim_disc *close)
{
    double reach = 0.0;
    size_t found = 0;

    for (size_t k = 0; k < ring->sensors; k++) {
        const double *sensor = ring->geometry + k * SIM_SENSOR;
        double r = fabs(sensor[0]) + fabs(sensor[1]);
        reach = r > reach ? r : reach;
    }
    reach = reach + ring->most + 1.0e-6;
    for (size_t n = 0; n < count; n++) {
        double mx = discs[n].x - ring->x, my = discs[n].y - ring->y, far = reach + discs[n].radius;
        if (n != ring->self && mx * mx + my * my <= far * far)
            close[found++] = discs[n];
    }
    return found;
}

void sim_sonar(const sim_map *map, const sim_disc *discs, size_t count, const sim_ring *ring,
               const sim_noise *noise, sim_disc *near, double *ranges)
{
    const double c = ring->cosine, s = ring->sine, most = ring->most;
    sim_disc *close = near + count;
    size_t candidates = about(discs, count, ring, close);
    sim_rays rays;
    double walls[SIM_CHUNK];
    uint8_t axes[SIM_CHUNK];

    for (size_t k = 0; k < ring->sensors; k++) {
        const size_t in_chunk = k % (SIM_CHUNK / SIM_RAYS);
        if (in_chunk == 0) {
            rays.count = 0;
            for (size_t m = k; m < ring->sensors && rays.count + SIM_RAYS <= SIM_CHUNK; m++) {
                const double *sensor = ring->geometry + m * SIM_SENSOR;
                for (size_t n = 0; n < SIM_RAYS; n++, rays.count++) {
                    double dx = sensor[2 + 2 * n], dy = sensor[3 + 2 * n];
                    rays.x[rays.count] = ring->x + c * sensor[0] - s * sensor[1];
                    rays.y[rays.count] = ring->y + s * sensor[0] + c * sensor[1];
                    rays.rx[rays.count] = c * dx - s * dy;
                    rays.ry[rays.count] = s * dx + c * dy;
                }
            }
            sim_walls(map, &rays, most, walls, axes);
        }
        const size_t first = in_chunk * SIM_RAYS;
        size_t found = around(close, candidates, SIZE_MAX, rays.x[first], rays.y[first], most, near);
        double best = most;

        for (size_t n = first; n < first + SIM_RAYS; n++) {
            best = meet_discs(near, found, rays.rx[n], rays.ry[n], best);
            best = walls[n] < best ? walls[n] : best;
        }
        if (noise->on && best < most) {
            uint32_t hash =
                sim_hash(noise->seed, noise->step, (uint32_t)ring->self, (uint32_t)k);
            best = best + (0.01 + 0.01 * best) * sim_gauss(hash);
        }
        best = best < ring->least ? ring->least : best;
        ranges[k] = best > most ? most : best;
    }
}

enum { SILENT = 65535 };

/* A range with noise, in millimetres; SILENT for a ray without an answer: lost, or from nearer or farther than the lidar measures. */
static uint32_t measured(const sim_lidar *lidar, const sim_noise *noise, size_t k, double range)
{
    if (range >= lidar->most)
        return SILENT;
    if (noise->on) {
        uint32_t self = (uint32_t)lidar->self;
        uint32_t hash = sim_hash(noise->seed, noise->step, self, 0x10000u + (uint32_t)k);
        double sd = 0.007 * range;
        if (mix(hash) < 85899345u)
            return SILENT;
        range = range + (sd < 0.003 ? 0.003 : sd) * sim_gauss(hash);
    }
    if (range < lidar->least || range > lidar->most)
        return SILENT;
    return (uint32_t)(range * 1000.0 + 0.5);
}

void sim_scan(const sim_map *map, const sim_disc *discs, size_t count, const sim_lidar *lidar,
              const sim_noise *noise, sim_disc *near, uint8_t *ranges)
{
    const double c = lidar->cosine, s = lidar->sine, most = lidar->most;
    const double *at = lidar->geometry;
    double ox = lidar->x + c * at[0] - s * at[1];
    double oy = lidar->y + s * at[0] + c * at[1];
    size_t found = around(discs, count, lidar->self, ox, oy, most, near);

    sim_rays rays;
    double walls[SIM_CHUNK];
    uint8_t axes[SIM_CHUNK];

    for (size_t k = 0; k < lidar->rays; k++) {
        const size_t n = k % SIM_CHUNK;
        if (n == 0) {
            rays.count = lidar->rays - k < SIM_CHUNK ? lidar->rays - k : SIM_CHUNK;
            for (size_t m = 0; m < rays.count; m++) {
                double dx = at[2 + 2 * (k + m)], dy = at[3 + 2 * (k + m)];
                rays.x[m] = ox;
                rays.y[m] = oy;
                rays.rx[m] = c * dx - s * dy;
                rays.ry[m] = s * dx + c * dy;
            }
            sim_walls(map, &rays, most, walls, axes);
        }
        double best = meet_discs(near, found, rays.rx[n], rays.ry[n], most);
        uint32_t mm = measured(lidar, noise, k, walls[n] < best ? walls[n] : best);
        ranges[2 * k] = (uint8_t)(mm >> 8);
        ranges[2 * k + 1] = (uint8_t)(mm & 255);
    }
}
