// sources: ../c_src/grid.c
/* Random plans under the sanitizers: clearances against brute force, and ways against a search without a guess. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"

#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) {                                                                    \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                    \
            exit(1);                                                                           \
        }                                                                                      \
    } while (0)

static uint64_t state = 88172645463325252u;

static uint32_t draw(uint32_t most)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 32) % most;
}

/* Every size is allocated to the byte, so that the sanitizer sees one step too far. */
static void *exactly(size_t size)
{
    void *memory = malloc(size > 0 ? size : 1);
    CHECK(memory != NULL);
    return memory;
}

static uint8_t brute(const uint8_t *cells, int64_t width, int64_t height, int64_t x, int64_t y, double cell, int closed)
{
    int64_t least = (int64_t)1 << 28;
    for (int64_t j = -1; j <= height; j++)
        for (int64_t i = -1; i <= width; i++) {
            int outside = i < 0 || j < 0 || i >= width || j >= height;
            int64_t far = (x - i) * (x - i) + (y - j) * (y - j);
            if ((outside ? closed : cells[j * width + i]) && far < least)
                least = far;
        }
    if (least == 0)
        return 0;
    double units = (sqrt((double)least) - 0.71) * cell / GRID_UNIT;
    return units < 1.0 ? 1 : units > 255.0 ? 255 : (uint8_t)units;
}

static int open(const grid_map *map, const uint8_t *blocked, int need, int64_t goal, int64_t x, int64_t y)
{
    int64_t at = y * map->width + x;
    return x >= 0 && y >= 0 && x < map->width && y < map->height &&
           (at == goal || (map->clear[at] >= need && !blocked[at]));
}

static int64_t step(const grid_map *map, int need, int64_t to, int diagonal)
{
    int lacking = GRID_ROOMY - (map->clear[to] - need);
    lacking = lacking < 0 ? 0 : lacking > GRID_ROOMY ? GRID_ROOMY : lacking;
    return (int64_t)(diagonal ? GRID_DIAGONAL : GRID_STRAIGHT) *
           (GRID_WEIGHT + lacking * GRID_NARROW / GRID_ROOMY);
}

static int allowed(const grid_map *map, const uint8_t *blocked, int need, int64_t goal, int64_t at, int dx, int dy)
{
    int64_t x = at % map->width, y = at / map->width;
    return open(map, blocked, need, goal, x + dx, y + dy) &&
           (dx == 0 || dy == 0 ||
            (open(map, blocked, need, goal, x + dx, y) && open(map, blocked, need, goal, x, y + dy)));
}

/* The cost of the cheapest way: relaxed until nothing changes. */
static int64_t cheapest(const grid_map *map, const uint8_t *blocked, int need, int64_t start, int64_t goal)
{
    int64_t cells = map->width * map->height, *cost = exactly((size_t)cells * sizeof *cost);
    for (int64_t k = 0; k < cells; k++)
        cost[k] = -1;
    cost[start] = 0;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int64_t at = 0; at < cells; at++)
            for (int d = 0; cost[at] >= 0 && d < 9; d++) {
                int dx = d % 3 - 1, dy = d / 3 - 1;
                if ((dx == 0 && dy == 0) || !allowed(map, blocked, need, goal, at, dx, dy))
                    continue;
                int64_t to = at + dy * map->width + dx;
                int64_t total = cost[at] + step(map, need, to, dx != 0 && dy != 0);
                if (cost[to] < 0 || total < cost[to]) {
                    cost[to] = total;
                    changed = 1;
                }
            }
    }
    int64_t found = cost[goal];
    free(cost);
    return found;
}

/* The costs of all ways: relaxed until nothing changes. */
static void check_spread(const uint8_t *times, int64_t width, int64_t height, int64_t start)
{
    int64_t cells = width * height;
    int32_t *costs = exactly((size_t)cells * sizeof *costs), *expected = exactly((size_t)cells * sizeof *expected);
    void *scratch = exactly(grid_spread_scratch(width, height));

    grid_spread(times, width, height, start, scratch, costs);
    for (int64_t k = 0; k < cells; k++)
        expected[k] = k == start ? 0 : GRID_UNREACHED;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int64_t at = 0; at < cells; at++)
            for (int d = 0; expected[at] >= 0 && d < 9; d++) {
                int dx = d % 3 - 1, dy = d / 3 - 1;
                int64_t x = at % width + dx, y = at / width + dy, to = y * width + x;
                if ((dx == 0 && dy == 0) || x < 0 || y < 0 || x >= width || y >= height || times[to] == 0)
                    continue;
                int32_t total = expected[at] + times[to] * (dx != 0 && dy != 0 ? GRID_CORNER : GRID_SIDE);
                if (expected[to] < 0 || total < expected[to]) {
                    expected[to] = total;
                    changed = 1;
                }
            }
    }
    CHECK(memcmp(costs, expected, (size_t)cells * sizeof *costs) == 0);
    free(scratch);
    free(costs);
    free(expected);
}

int main(void)
{
    int ways = 0, none = 0;

    for (int round = 0; round < 400; round++) {
        int64_t width = 1 + draw(24), height = 1 + draw(24), cells = width * height;
        uint8_t *walls = exactly((size_t)cells), *clear = exactly((size_t)cells), *blocked = exactly((size_t)cells);
        uint32_t dense = 2 + draw(30);
        int closed = (int)draw(2), need = 1 + (int)draw(8);
        double cell = 0.05 * (1 + draw(3));
        for (int64_t k = 0; k < cells; k++)
            walls[k] = draw(dense) == 0;

        void *scratch = exactly(grid_clearance_scratch(width, height));
        grid_clearance(walls, width, height, cell, closed, scratch, clear);
        free(scratch);
        for (int64_t k = 0; k < cells; k++)
            CHECK(clear[k] == brute(walls, width, height, k % width, k / width, cell, closed));

        /* Walls laid over others leave the lesser clearance, and nothing is read or written beyond a window that juts out. */
        int64_t over_width = 1 + draw(24), over_height = 1 + draw(24), left = (int64_t)draw(60) - 30;
        int64_t low = (int64_t)draw(60) - 30;
        uint8_t *over = exactly((size_t)(over_width * over_height)), *both = exactly((size_t)cells);
        for (int64_t k = 0; k < over_width * over_height; k++)
            over[k] = (uint8_t)draw(256);
        memcpy(both, clear, (size_t)cells);
        grid_overlay(both, width, height, over, over_width, over_height, left, low);
        for (int64_t k = 0; k < cells; k++) {
            int64_t i = k % width - left, j = k / width - low;
            int within = i >= 0 && j >= 0 && i < over_width && j < over_height;
            uint8_t expected = within && over[j * over_width + i] < clear[k] ? over[j * over_width + i] : clear[k];
            CHECK(both[k] == expected);
        }
        free(over);
        free(both);

        uint8_t *times = exactly((size_t)cells);
        for (int64_t k = 0; k < cells; k++)
            times[k] = walls[k] ? 0 : (uint8_t)(1 + draw(GRID_TIMES));
        check_spread(times, width, height, draw((uint32_t)cells));
        free(times);

        grid_disc discs[3];
        size_t count = draw(4);
        for (size_t k = 0; k < count; k++)
            discs[k] = (grid_disc){(double)draw(40) - 8.0, (double)draw(40) - 8.0, (double)draw(30) / 10.0};
        grid_block(width, height, discs, count, blocked);

        grid_map map = {clear, width, height};
        int64_t start = draw((uint32_t)cells), goal = draw((uint32_t)cells);
        uint32_t *way = exactly((size_t)cells * sizeof *way);
        scratch = exactly(grid_way_scratch(width, height));
        size_t found = grid_way(&map, blocked, need, start, goal, scratch, way, (size_t)cells);
        free(scratch);
        int64_t least = cheapest(&map, blocked, need, start, goal);
        CHECK((found > 0) == (least >= 0));
        if (found > 0) {
            int64_t total = 0;
            CHECK(way[0] == goal && way[found - 1] == start);
            for (size_t k = found - 1; k > 0; k--) {
                int dx = (int)(way[k - 1] % width - way[k] % width), dy = (int)(way[k - 1] / width - way[k] / width);
                CHECK(dx >= -1 && dx <= 1 && dy >= -1 && dy <= 1);
                CHECK(allowed(&map, blocked, need, goal, way[k], dx, dy));
                total += step(&map, need, way[k - 1], dx != 0 && dy != 0);
            }
            CHECK(total == least);
            ways++;
        } else {
            none++;
        }
        free(walls);
        free(clear);
        free(blocked);
        free(way);
    }
    CHECK(ways > 50 && none > 50);
    printf("grid: %d ways, %d times none\n", ways, none);
    return 0;
}
