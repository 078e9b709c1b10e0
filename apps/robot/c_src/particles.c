#include "particles.h"

#include <math.h>

/* The same as in Robot.Localiser.MonteCarlo.Reference, in the same order: the results are equal to the bit. */
#define UNIT 0.02
#define OFF 0.71
#define LEAST_STEP 0.6
#define NEARER 0.03
#define FITS 0.2
#define FAR_OFF 0.6
#define TRIES 64
#define WITHIN_WALL (-65536)

/* By pointers: a compiler may put sine and cosine of one angle together, into a function that rounds in its own way. */
static double (*volatile cosine)(double) = cos;
static double (*volatile sine)(double) = sin;

static double wrap(double angle)
{
    if (angle > -M_PI && angle <= M_PI)
        return angle;
    double rest = fmod(angle, 2 * M_PI);
    return rest > M_PI ? rest - 2 * M_PI : rest <= -M_PI ? rest + 2 * M_PI : rest;
}

static uint32_t mix(uint32_t x)
{
    x += 0x9E3779B9u;
    x = (x ^ (x >> 16)) * 0x5BD1E95u;
    x = (x ^ (x >> 13)) * 0x6C8E9CFu;
    return x ^ (x >> 16);
}

static uint32_t hash(uint32_t draw, uint32_t use)
{
    return mix(mix(draw ^ use));
}

static double unit(uint32_t draw, uint32_t use)
{
    return hash(draw, use) / 4294967296.0;
}

static double gauss(uint32_t draw, uint32_t use)
{
    uint32_t h = hash(draw, use);
    int sum = (int)((h & 255) + (h >> 8 & 255) + (h >> 16 & 255) + (h >> 24));
    return (sum - 510) / 147.8;
}

void particles_move(particles_pose *poses, size_t count, const particles_step *step, uint32_t draw)
{
    for (size_t k = 0; k < count; k++) {
        particles_pose *pose = &poses[k];
        uint32_t use = (uint32_t)k * 4;
        double more = pose->slip * step->turned + step->heading_sd * gauss(draw, use);
        double c = cosine(pose->heading + more / 2), s = sine(pose->heading + more / 2);
        pose->x = pose->x + (c * step->x - s * step->y) + step->place_sd * gauss(draw, use + 1);
        pose->y = pose->y + (s * step->x + c * step->y) + step->place_sd * gauss(draw, use + 2);
        pose->heading = wrap(pose->heading + step->heading + more);
        pose->slip = pose->slip + step->slip_sd * gauss(draw, use + 3);
    }
}

/* A place in cells. */
static int clear_at(const particles_map *map, double u, double v)
{
    if (!(u >= 0.0 && v >= 0.0 && u < map->width && v < map->height))
        return 0;
    return map->clear[(size_t)v * (size_t)map->width + (size_t)u];
}

void particles_scatter(particles_pose *poses, size_t count, const particles_map *map, int need, double slip_sd, uint32_t draw)
{
    for (size_t k = 0; k < count; k++) {
        uint32_t use = (uint32_t)k * (2 * TRIES + 2);
        double u = 0.0, v = 0.0;
        for (uint32_t n = 0; n < TRIES; n++) {
            u = unit(draw, use + 2 + 2 * n) * map->width;
            v = unit(draw, use + 3 + 2 * n) * map->height;
            if (clear_at(map, u, v) >= need)
                break;
        }
        poses[k].x = map->left + u * map->cell;
        poses[k].y = map->low + v * map->cell;
        poses[k].heading = M_PI - unit(draw, use) * 2 * M_PI;
        poses[k].slip = slip_sd * gauss(draw, use + 1);
    }
}

/* How far a ray gets from each clearance (cells). */
static void step_table(double per, double steps[256])
{
    steps[0] = 0.0;
    for (int clear = 1; clear < 256; clear++) {
        double step = clear * per - OFF;
        steps[clear] = step > LEAST_STEP ? step : LEAST_STEP;
    }
}

/* How far the rays of a reading come (cells). Step by step side by side: one after the other, each would wait for memory. */
static void cast(const particles_map *map, const double steps[256], double u, double v, const double rays[][2], int count,
                 double most, double far[PARTICLES_RAYS])
{
    int going;

    for (int r = 0; r < PARTICLES_RAYS; r++)
        far[r] = r < count ? 0.0 : most;
    do {
        going = 0;
        for (int r = 0; r < PARTICLES_RAYS; r++) {
            int clear = far[r] < most ? clear_at(map, u + far[r] * rays[r][0], v + far[r] * rays[r][1]) : 0;
            far[r] += steps[clear];
            going |= clear;
        }
    } while (going);
}

void particles_weigh(const particles_pose *poses, size_t count, const particles_map *map, const particles_reading *readings,
                     size_t reading_count, const int16_t *tables, int32_t *weighed)
{
    const double cell = map->cell;
    double steps[256], rays[PARTICLES_RAYS][2], far[PARTICLES_RAYS];

    step_table(UNIT / cell, steps);
    for (size_t k = 0; k < count; k++) {
        const particles_pose *pose = &poses[k];
        double c = cosine(pose->heading), s = sine(pose->heading);
        int32_t sum = 0, fits = 0;

        if (clear_at(map, (pose->x - map->left) / cell, (pose->y - map->low) / cell) == 0)
            sum = WITHIN_WALL;
        else
            for (size_t n = 0; n < reading_count; n++) {
                const particles_reading *reading = &readings[n];
                double u = (pose->x + c * reading->x - s * reading->y - map->left) / cell;
                double v = (pose->y + s * reading->x + c * reading->y - map->low) / cell;
                double best = reading->most / cell;
                /* Whether a wall is yet nearer makes no difference. */
                double worst = (reading->range - FAR_OFF) / cell;
                int used = reading->counts > 0.0 ? PARTICLES_RAYS : 1;
                const int16_t *table = tables;

                for (int r = 0; r < PARTICLES_RAYS; r++) {
                    rays[r][0] = c * reading->rays[r][0] - s * reading->rays[r][1];
                    rays[r][1] = s * reading->rays[r][0] + c * reading->rays[r][1];
                }
                cast(map, steps, u, v, rays, used, best, far);
                for (int r = 0; r < used && best > worst; r++)
                    if (far[r] < best - NEARER / cell) {
                        best = far[r];
                        table = r > 2 ? tables + PARTICLES_TABLE : tables;
                    }

                double longer = reading->range - best * cell;
                double index = longer / UNIT + (PARTICLES_TABLE / 2 + 0.5);
                int at = index < 0.0 ? 0 : index >= PARTICLES_TABLE ? PARTICLES_TABLE - 1 : (int)index;
                sum += table[at];
                fits += reading->counts > 0.0 && longer < FITS && longer > -FITS;
            }
        weighed[2 * k] = sum;
        weighed[2 * k + 1] = fits;
    }
}
