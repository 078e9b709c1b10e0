/* See occupancy.h. */
#include <math.h>
#include <string.h>

#include "occupancy.h"

static int8_t decayed(int value, int decay)
{
    if (value > 0)
        return (int8_t)(value > decay ? value - decay : 0);
    return (int8_t)(value < -decay ? value + decay : 0);
}

void occupancy_move(const int8_t *cells, int64_t size, int64_t right, int64_t up, int decay, int8_t *moved)
{
    if (right == 0 && up == 0 && decay == 0) {
        memcpy(moved, cells, (size_t)(size * size));
        return;
    }
    memset(moved, 0, (size_t)(size * size));
    for (int64_t y = 0; y < size; y++) {
        if (y + up < 0 || y + up >= size)
            continue;
        const int8_t *from = cells + (y + up) * size;
        int64_t low = right < 0 ? -right : 0, high = right > 0 ? size - right : size;
        for (int64_t x = low; x < high; x++)
            moved[y * size + x] = decayed(from[x + right], decay);
    }
}

static int64_t add(int8_t *cell, int change, int sure)
{
    int before = *cell, after = before + change;
    after = after > OCCUPANCY_MOST ? OCCUPANCY_MOST : after < OCCUPANCY_LEAST ? OCCUPANCY_LEAST : after;
    *cell = (int8_t)after;
    return (before >= sure) != (after >= sure);
}

static double least(double a, double b, double c)
{
    double least = a < b ? a : b;
    return least < c ? least : c;
}

static double most(double a, double b, double c)
{
    double most = a > b ? a : b;
    return most > c ? most : c;
}

/* A column or row within the window. */
static int64_t within(double value, int64_t size)
{
    return value < 0.0 ? 0 : value > (double)(size - 1) ? size - 1 : (int64_t)value;
}

static int64_t cone(int8_t *cells, int64_t size, const occupancy_cone *c, double tangent, double thick, int sure)
{
    double reach = c->echo != 0.0 && c->range + thick > c->clear ? c->range + thick : c->clear;
    /* The triangle in which the cone lies, its far side at `reach`. */
    double ax = c->x + reach * (c->cosine - tangent * c->sine), ay = c->y + reach * (c->sine + tangent * c->cosine);
    double bx = c->x + reach * (c->cosine + tangent * c->sine), by = c->y + reach * (c->sine - tangent * c->cosine);
    int64_t left = within(least(c->x, ax, bx), size), right = within(most(c->x, ax, bx), size);
    int64_t low = within(least(c->y, ay, by), size), high = within(most(c->y, ay, by), size);
    int64_t changes = 0;

    for (int64_t y = low; y <= high; y++)
        for (int64_t x = left; x <= right; x++) {
            double dx = (double)x + 0.5 - c->x, dy = (double)y + 0.5 - c->y;
            double along = dx * c->cosine + dy * c->sine;
            double side = (dy * c->cosine - dx * c->sine), edge = along * tangent;
            if (along <= 0.0 || side > edge || side < -edge)
                continue;
            double far = sqrt(dx * dx + dy * dy);
            if (c->echo != 0.0 && far >= c->range - thick && far < c->range + thick) {
                double off = side / edge;
                changes += add(&cells[y * size + x], (int)(OCCUPANCY_HIT * (1.0 - off * off)), sure);
            } else if (far < c->clear)
                changes += add(&cells[y * size + x], OCCUPANCY_MISS, sure);
        }
    return changes;
}

int64_t occupancy_add(int8_t *cells, int64_t size, const occupancy_cone *cones, size_t count, double tangent,
                      double thick, int sure)
{
    int64_t changes = 0;
    for (size_t k = 0; k < count; k++)
        changes += cone(cells, size, &cones[k], tangent, thick, sure);
    return changes;
}

int64_t occupancy_clear(int8_t *cells, int64_t size, const occupancy_disc *discs, size_t count, int sure)
{
    int64_t changes = 0;
    for (const occupancy_disc *d = discs; d < discs + count; d++) {
        if (d->x + d->radius < 0.0 || d->y + d->radius < 0.0 || d->x - d->radius >= (double)size ||
            d->y - d->radius >= (double)size)
            continue;
        int64_t right = within(d->x + d->radius, size), high = within(d->y + d->radius, size);
        for (int64_t y = within(d->y - d->radius, size); y <= high; y++)
            for (int64_t x = within(d->x - d->radius, size); x <= right; x++) {
                double dx = (double)x + 0.5 - d->x, dy = (double)y + 0.5 - d->y;
                int8_t *cell = &cells[y * size + x];
                if (dx * dx + dy * dy < d->radius * d->radius && *cell > OCCUPANCY_BODY) {
                    changes += *cell >= sure;
                    *cell = OCCUPANCY_BODY;
                }
            }
    }
    return changes;
}

int64_t occupancy_walls(const int8_t *cells, int64_t size, double x, double y, double cosine, double sine, int sure,
                        uint8_t *walls)
{
    int64_t count = 0;
    for (int64_t j = 0; j < size; j++)
        for (int64_t i = 0; i < size; i++) {
            double px = x + cosine * (double)i - sine * (double)j, py = y + sine * (double)i + cosine * (double)j;
            int wall = px >= 0.0 && py >= 0.0 && px < (double)size && py < (double)size &&
                       cells[(int64_t)py * size + (int64_t)px] >= sure;
            walls[j * size + i] = (uint8_t)wall;
            count += wall;
        }
    return count;
}
