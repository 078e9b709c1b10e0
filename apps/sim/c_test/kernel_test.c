// sources: ../c_src/rays.c ../c_src/walls.c ../c_src/paint.c
/* Random plans, sonars and pictures under the sanitizers: no access outside, no endless ray,
 * and what the geometry promises. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kernel.h"

#define CHECK(condition)                                                             \
    do {                                                                             \
        if (!(condition)) {                                                          \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);          \
            exit(1);                                                                 \
        }                                                                            \
    } while (0)

static uint32_t drawn;

static uint32_t draw(void)
{
    return sim_hash(1, 2, 3, drawn++);
}

static double unit(void)
{
    return draw() / 4294967296.0;
}

static int64_t upto(int64_t most)
{
    return 1 + (int64_t)(unit() * (double)most);
}

/* Every size is allocated to the byte, so that the sanitizer sees one step too far. */
static void *exactly(size_t size)
{
    void *memory = malloc(size > 0 ? size : 1);
    CHECK(memory != NULL);
    return memory;
}

static int64_t king(const uint8_t *walls, int64_t width, int64_t height, int64_t i, int64_t j)
{
    int64_t least = 255;

    for (int64_t y = -1; y <= height; y++)
        for (int64_t x = -1; x <= width; x++) {
            int inside = x >= 0 && y >= 0 && x < width && y < height;
            int64_t dx = llabs(x - i), dy = llabs(y - j), d = dx > dy ? dx : dy;
            if ((!inside || walls[y * width + x]) && d < least)
                least = d;
        }
    return least;
}

static sim_map plan(uint8_t **walls)
{
    int64_t width = upto(40), height = upto(40);
    double share = unit() * unit();
    uint8_t *field = exactly((size_t)(width * height));

    *walls = exactly((size_t)(width * height));
    for (int64_t k = 0; k < width * height; k++)
        (*walls)[k] = unit() < share;
    sim_field(*walls, width, height, field);
    return (sim_map){field, width, height, 0.02 + unit() * 0.3};
}

static double place(int64_t cells, double cell)
{
    return (unit() - 0.5) * 1.2 * (double)cells * cell;
}

/* The hard directions are those along the axes and the diagonals. */
static void direction(double *rx, double *ry)
{
    double angle = unit() * 7;
    if (draw() % 3 == 0)
        angle = (double)(draw() % 8) * 0.78539816339744831;
    *rx = draw() % 9 == 0 ? 0.0 : cos(angle);
    *ry = draw() % 9 == 0 ? 0.0 : sin(angle);
}

static void rays(const sim_map *map)
{
    for (int n = 0; n < 50; n++) {
        double rx, ry, most = unit() * 30;
        int axis = -1;
        direction(&rx, &ry);
        double t = sim_wall(map, place(map->width, map->cell), place(map->height, map->cell), rx,
                            ry, most, &axis);
        CHECK(t >= 0.0 && t <= most && axis >= 0 && axis <= 2);
    }
}

/* Many rays at once go as far as each alone, to the bit. */
static void together(const sim_map *map)
{
    double most = draw() % 2 ? unit() * 30 : 1.0e6, goes[SIM_CHUNK];
    uint8_t axes[SIM_CHUNK];
    sim_rays many;

    many.count = draw() % (SIM_CHUNK + 1);
    for (size_t k = 0; k < many.count; k++) {
        many.x[k] = place(map->width, map->cell);
        many.y[k] = place(map->height, map->cell);
        direction(many.rx + k, many.ry + k);
    }
    sim_walls(map, &many, most, goes, axes);
    for (size_t k = 0; k < many.count; k++) {
        int axis;
        double t = sim_wall(map, many.x[k], many.y[k], many.rx[k], many.ry[k], most, &axis);
        CHECK(memcmp(&t, goes + k, sizeof t) == 0 && axis == axes[k]);
    }
}

static void sonars(const sim_map *map)
{
    size_t count = draw() % 5, sensors = draw() % 17;
    sim_disc *discs = exactly(count * sizeof *discs), *near = exactly(2 * count * sizeof *near);
    double *geometry = exactly(sensors * SIM_SENSOR * sizeof *geometry);
    double *ranges = exactly(sensors * sizeof *ranges);
    sim_noise noise = {draw() % 2, draw(), draw(), draw()};
    sim_ring ring = {draw() % 5, place(map->width, map->cell), place(map->height, map->cell), 1.0,
                     0.0,        0.15, 5.1, geometry, sensors};

    direction(&ring.cosine, &ring.sine);
    for (size_t k = 0; k < count; k++)
        discs[k] = (sim_disc){place(map->width, map->cell), place(map->height, map->cell), unit()};
    for (size_t k = 0; k < sensors; k++) {
        geometry[k * SIM_SENSOR] = unit() - 0.5;
        geometry[k * SIM_SENSOR + 1] = unit() - 0.5;
        for (int n = 0; n < SIM_RAYS; n++)
            direction(geometry + k * SIM_SENSOR + 2 + 2 * n,
                      geometry + k * SIM_SENSOR + 3 + 2 * n);
    }
    sim_sonar(map, discs, count, &ring, &noise, near, ranges);
    for (size_t k = 0; k < sensors; k++)
        CHECK(ranges[k] >= 0.15 && ranges[k] <= 5.1);
    free(discs);
    free(near);
    free(geometry);
    free(ranges);
}

static void pictures(const sim_map *map, const int8_t *tables)
{
    int64_t width = 2 * upto(24), height = 2 * upto(20);
    size_t count = draw() % 7, each = count < (size_t)height ? count : (size_t)height;
    sim_pole *poles = exactly(count * sizeof *poles);
    sim_sight sight = {place(map->width, map->cell), place(map->height, map->cell), 1.0, 0.0, 0.6,
                       5 + unit() * 100, unit() * 2 * (double)height - (double)height / 2, width, height};
    sim_noise noise = {draw() % 2, draw(), draw(), draw()};
    sim_scratch scratch = {exactly(count * sizeof(sim_hit)),
                           exactly(count * sizeof(sim_span)),
                           exactly((size_t)width * each * sizeof(sim_piece)),
                           exactly((size_t)width * sizeof(int16_t)),
                           exactly((size_t)width * sizeof(int16_t)),
                           exactly((size_t)width)};
    uint8_t *picture = exactly((size_t)(width * height / 2 * 3));

    direction(&sight.cosine, &sight.sine);
    for (size_t k = 0; k < count; k++) {
        /* Every third one is a box. */
        double half_x = k % 3 ? 0.0 : 0.001 + unit() / 2, half_y = k % 3 ? 0.0 : 0.001 + unit() / 2;
        double radius = k % 3 ? 0.001 + unit() : half_x + half_y;
        poles[k] = (sim_pole){place(map->width, map->cell), place(map->height, map->cell), radius, unit() * 2,
                              half_x, half_y, 1.0, 0.0, k % 4, {205, 75, 137}};
        direction(&poles[k].cosine, &poles[k].sine);
    }
    size_t made = sim_look(map, &sight, poles, count, &scratch);
    CHECK(made <= (size_t)width * each);
    for (size_t k = 0; k < made; k++) {
        const sim_piece *piece = scratch.pieces + k;
        CHECK(piece->column < width && piece->top <= piece->bottom && piece->bottom < height);
    }
    size_t mark_count = draw() % 4;
    sim_mark *marks = exactly(mark_count * sizeof *marks);
    for (size_t k = 0; k < mark_count; k++) {
        int64_t rows = upto(12), columns = upto(12);
        uint8_t *white = exactly((size_t)(rows * columns));
        for (int64_t n = 0; n < rows * columns; n++)
            white[n] = draw() % 2;
        /* Anywhere, or right before the camera. */
        double reach = draw() % 2 ? 1.0 : 100.0;
        marks[k] = (sim_mark){sight.x + place(map->width, map->cell) / reach,
                              sight.y + place(map->height, map->cell) / reach, 1.0, 0.0, unit() * 2,
                              0.001 + unit() / 4, rows, columns, {-unit()}, white};
        for (int64_t n = 0; n < columns; n++)
            marks[k].edges[n + 1] = marks[k].edges[n] + unit() / 4;
        direction(&marks[k].cosine, &marks[k].sine);
    }
    sim_paint(map, &sight, poles, count, marks, mark_count, &noise, tables, &scratch, picture);
    for (size_t k = 0; k < mark_count; k++)
        free((uint8_t *)marks[k].white);
    free(marks);
    free(poles);
    free(scratch.hits);
    free(scratch.spans);
    free(scratch.pieces);
    free(scratch.tops);
    free(scratch.bottoms);
    free(scratch.lumas);
    free(picture);
}

/* A wall, a disc and a pole where the answer is known. */
static void known(void)
{
    uint8_t walls[100 * 100] = {0}, field[100 * 100];
    double geometry[SIM_SENSOR] = {0.2, 0.0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0}, range;
    sim_map map = {field, 100, 100, 0.05};
    sim_ring ring = {0, 0.0, 0.0, 1.0, 0.0, 0.15, 5.1, geometry, 1};
    sim_disc discs[2] = {{0, 0, 0.2}, {1.0, 0, 0.2}}, near[4];
    sim_noise quiet = {0, 0, 0, 0};
    int axis;

    sim_field(walls, 100, 100, field);
    CHECK(fabs(sim_wall(&map, 0, 0, 1, 0, 9, &axis) - 2.5) < 1e-12 && axis == 0);
    CHECK(fabs(sim_wall(&map, 0, 0.3, 0, -1, 9, &axis) - 2.8) < 1e-12 && axis == 1);
    CHECK(sim_wall(&map, 0, 0, 1, 0, 1, &axis) == 1 && axis == 2);
    CHECK(sim_wall(&map, 9, 0, 1, 0, 1, &axis) == 0);
    sim_sonar(&map, discs, 2, &ring, &quiet, near, &range);
    CHECK(fabs(range - 0.6) < 1e-12);
    sim_sonar(&map, discs, 1, &ring, &quiet, near, &range);
    CHECK(fabs(range - 2.3) < 1e-12);
}

int main(void)
{
    int8_t *tables = exactly(2 * (SIM_TABLE + SIM_WIDEST));

    for (int k = 0; k < 2 * (SIM_TABLE + SIM_WIDEST); k++)
        tables[k] = (int8_t)(draw() % 21 - 10);
    known();
    for (int round = 0; round < 400; round++) {
        uint8_t *walls;
        sim_map map = plan(&walls);
        for (int n = 0; n < 5; n++) {
            int64_t i = upto(map.width) - 1, j = upto(map.height) - 1;
            CHECK(map.field[j * map.width + i] == king(walls, map.width, map.height, i, j));
        }
        rays(&map);
        together(&map);
        sonars(&map);
        pictures(&map, tables);
        free(walls);
        free((void *)map.field);
    }
    free(tables);
    return 0;
}
