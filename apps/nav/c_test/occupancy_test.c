// sources: ../c_src/occupancy.c
/* Random windows and readings under the sanitizers: each result against one that looks at every cell by itself. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "occupancy.h"

#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) {                                                                    \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                    \
            exit(1);                                                                           \
        }                                                                                      \
    } while (0)

enum { SURE = 30 };

static uint64_t state = 88172645463325252u;

static uint32_t draw(uint32_t most)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 32) % most;
}

static double between(double low, double high)
{
    return low + (high - low) * (double)draw(1u << 30) / (double)(1u << 30);
}

/* Every size is allocated to the byte, so that the sanitizer sees one step too far. */
static void *exactly(size_t size)
{
    void *memory = malloc(size > 0 ? size : 1);
    CHECK(memory != NULL);
    return memory;
}

static int within(int value)
{
    return value > OCCUPANCY_MOST ? OCCUPANCY_MOST : value < OCCUPANCY_LEAST ? OCCUPANCY_LEAST : value;
}

/* What one reading does to one cell. */
static int told(int value, int64_t x, int64_t y, const occupancy_cone *c, double tangent, double thick)
{
    double dx = (double)x + 0.5 - c->x, dy = (double)y + 0.5 - c->y;
    double along = dx * c->cosine + dy * c->sine, side = dy * c->cosine - dx * c->sine, edge = along * tangent;
    double far = sqrt(dx * dx + dy * dy), off = side / edge;
    if (along <= 0.0 || fabs(side) > edge)
        return value;
    if (c->echo != 0.0 && far >= c->range - thick && far < c->range + thick)
        return within(value + (int)(OCCUPANCY_HIT * (1.0 - off * off)));
    return far < c->clear ? within(value + OCCUPANCY_MISS) : value;
}

static int moved(const int8_t *cells, int64_t size, int64_t x, int64_t y, int decay)
{
    if (x < 0 || y < 0 || x >= size || y >= size)
        return 0;
    int value = cells[y * size + x], left = abs(value) > decay ? abs(value) - decay : 0;
    return value < 0 ? -left : left;
}

static void once(void)
{
    int64_t size = 1 + draw(40), right = (int64_t)draw(2 * (uint32_t)size + 5) - size - 2,
            up = (int64_t)draw(2 * (uint32_t)size + 5) - size - 2, changes = 0;
    size_t cones_count = draw(5), discs_count = draw(4);
    int decay = (int)draw(5);
    double tangent = between(0.05, 0.6), thick = between(0.2, 2.0), angle = between(-4.0, 4.0);
    int8_t *cells = exactly((size_t)(size * size)), *result = exactly((size_t)(size * size));
    uint8_t *walls = exactly((size_t)(size * size));
    occupancy_cone *cones = exactly(cones_count * sizeof *cones);
    occupancy_disc *discs = exactly(discs_count * sizeof *discs);

    for (int64_t k = 0; k < size * size; k++)
        cells[k] = (int8_t)((int)draw(OCCUPANCY_MOST - OCCUPANCY_LEAST + 1) + OCCUPANCY_LEAST);
    for (size_t k = 0; k < cones_count; k++) {
        double a = between(-4.0, 4.0);
        cones[k] = (occupancy_cone){between(-20, 60), between(-20, 60), cos(a),      sin(a),
                                    between(-3, 50),  between(0, 50),   (double)draw(2)};
    }
    for (size_t k = 0; k < discs_count; k++)
        discs[k] = (occupancy_disc){between(-20, 60), between(-20, 60), between(0, 8)};

    occupancy_move(cells, size, right, up, decay, result);
    for (int64_t y = 0; y < size; y++)
        for (int64_t x = 0; x < size; x++)
            CHECK(result[y * size + x] == moved(cells, size, x + right, y + up, decay));
    memcpy(cells, result, (size_t)(size * size));

    int64_t counted = occupancy_add(result, size, cones, cones_count, tangent, thick, SURE);
    for (int64_t y = 0; y < size; y++)
        for (int64_t x = 0; x < size; x++) {
            int value = cells[y * size + x];
            for (size_t k = 0; k < cones_count; k++) {
                int now = told(value, x, y, &cones[k], tangent, thick);
                changes += (value >= SURE) != (now >= SURE);
                value = now;
            }
            CHECK(result[y * size + x] == value);
        }
    CHECK(counted == changes);
    memcpy(cells, result, (size_t)(size * size));

    counted = occupancy_clear(result, size, discs, discs_count, SURE);
    changes = 0;
    for (int64_t y = 0; y < size; y++)
        for (int64_t x = 0; x < size; x++) {
            int value = cells[y * size + x], in = 0;
            for (size_t k = 0; k < discs_count; k++) {
                double dx = (double)x + 0.5 - discs[k].x, dy = (double)y + 0.5 - discs[k].y;
                in |= dx * dx + dy * dy < discs[k].radius * discs[k].radius;
            }
            int now = in && value > OCCUPANCY_BODY ? OCCUPANCY_BODY : value;
            changes += (value >= SURE) != (now >= SURE);
            CHECK(result[y * size + x] == now);
        }
    CHECK(counted == changes);

    /* In its own frame every cell is where it was. */
    counted = occupancy_walls(result, size, 0.5, 0.5, 1.0, 0.0, SURE, walls);
    changes = 0;
    for (int64_t k = 0; k < size * size; k++) {
        CHECK(walls[k] == (result[k] >= SURE));
        changes += walls[k];
    }
    CHECK(counted == changes);
    occupancy_walls(result, size, between(-50, 50), between(-50, 50), cos(angle), sin(angle), SURE, walls);

    free(cells);
    free(result);
    free(walls);
    free(cones);
    free(discs);
}

int main(void)
{
    for (int k = 0; k < 3000; k++)
        once();
    printf("occupancy: 3000 windows\n");
    return 0;
}
