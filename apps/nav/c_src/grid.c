/* See grid.h. */
#include <math.h>
#include <string.h>

#include "grid.h"

/* --- Clearance: exact Euclidean distances between the centres of cells, by columns and then by rows (Meijster,
   Roerdink and Hesselink 2000), in whole numbers. */

#define FAR ((int32_t)1 << 14)

size_t grid_clearance_scratch(int64_t width, int64_t height)
{
    return (size_t)(width * height + 2 * width) * sizeof(int32_t);
}

/* The distance of each cell from the nearest wall of its column: row by row, which compilers make fast. */
static void columns(const uint8_t *cells, int64_t width, int64_t height, int closed, int32_t *down)
{
    for (int64_t y = 0; y < height; y++) {
        int32_t *row = down + y * width;
        for (int64_t x = 0; x < width; x++) {
            int32_t last = y > 0 ? row[x - width] : closed ? 0 : FAR;
            row[x] = cells[y * width + x] ? 0 : last < FAR ? last + 1 : FAR;
        }
    }
    for (int64_t y = height - 1; y >= 0; y--) {
        int32_t *row = down + y * width;
        for (int64_t x = 0; x < width; x++) {
            int32_t last = y < height - 1 ? row[x + width] : closed ? 0 : FAR;
            last = last < FAR ? last + 1 : FAR;
            row[x] = last < row[x] ? last : row[x];
        }
    }
}

static int64_t square(int64_t x)
{
    return x * x;
}

/* From here on column u is nearer than column i < u. */
static int64_t apart(int64_t i, int64_t u, const int32_t *row)
{
    int64_t over = u * u - i * i + square(row[u]) - square(row[i]), under = 2 * (u - i);
    /* Rounded down. */
    return over >= 0 ? over / under : -((-over + under - 1) / under);
}

static uint8_t clearance(int64_t squared, int64_t edge, int64_t deaf, double cell)
{
    if (edge * edge < squared)
        squared = edge * edge;
    if (squared == 0)
        return 0;
    if (squared >= deaf * deaf)
        return GRID_MOST;
    /* A wall's corner is at most 0.71 cells nearer than its centre. */
    double units = (sqrt((double)squared) - 0.71) * cell / GRID_UNIT;
    return units < 1.0 ? 1 : units > (double)GRID_MOST ? GRID_MOST : (uint8_t)units;
}

void grid_clearance(const uint8_t *cells, int64_t width, int64_t height, double cell, int closed,
                    void *scratch, uint8_t *clear)
{
    int32_t *down = scratch, *from = down + width * height, *of = from + width;

    columns(cells, width, height, closed, down);
    /* From this far on, walls of a column change no byte: a row of which all are as far is done. */
    int32_t deaf = (int32_t)(GRID_MOST * GRID_UNIT / cell < FAR - 3 ? GRID_MOST * GRID_UNIT / cell + 3.0 : FAR);
    for (int64_t y = 0; y < height; y++, down += width, clear += width) {
        int64_t q = -1;
        for (int64_t u = 0; u < width; u++) {
            if (down[u] >= deaf)
                continue;
            while (q >= 0 && square(from[q] - of[q]) + square(down[of[q]]) >
                                 square(from[q] - u) + square(down[u]))
                q--;
            if (q < 0) {
                q = 0;
                from[0] = 0;
                of[0] = (int32_t)u;
            } else {
                int64_t w = apart(of[q], u, down) + 1;
                if (w < width) {
                    q++;
                    of[q] = (int32_t)u;
                    from[q] = (int32_t)w;
                }
            }
        }
        for (int64_t x = width - 1; x >= 0; x--) {
            int64_t edge = closed ? (x + 1 < width - x ? x + 1 : width - x) : FAR;
            clear[x] = clearance(q < 0 ? square(FAR) : square(x - of[q]) + square(down[of[q]]), edge, deaf,
                                 cell);
            if (q >= 0 && x == from[q])
                q--;
        }
    }
}

void grid_overlay(uint8_t *clear, int64_t width, int64_t height, const uint8_t *over, int64_t over_width,
                  int64_t over_height, int64_t left, int64_t low)
{
    int64_t from = left > 0 ? left : 0, to = left + over_width < width ? left + over_width : width;
    int64_t high = low + over_height < height ? low + over_height : height;

    for (int64_t y = low > 0 ? low : 0; y < high; y++)
        for (int64_t x = from; x < to; x++) {
            uint8_t least = over[(y - low) * over_width + x - left];
            if (least < clear[y * width + x])
                clear[y * width + x] = least;
        }
}

/* --- Discs. */

static int64_t bound(double value, int64_t most)
{
    return value < 0.0 ? 0 : value > (double)most ? most : (int64_t)value;
}

void grid_block(int64_t width, int64_t height, const grid_disc *discs, size_t count, uint8_t *blocked)
{
    memset(blocked, 0, (size_t)(width * height));
    for (const grid_disc *disc = discs; disc < discs + count; disc++) {
        double square = disc->radius * disc->radius;
        int64_t right = bound(disc->x + disc->radius, width - 1), high = bound(disc->y + disc->radius, height - 1);
        for (int64_t y = bound(disc->y - disc->radius, height - 1); y <= high; y++)
            for (int64_t x = bound(disc->x - disc->radius, width - 1); x <= right; x++) {
                double dx = (double)x + 0.5 - disc->x, dy = (double)y + 0.5 - disc->y;
                if (dx * dx + dy * dy < square)
                    blocked[y * width + x] = 1;
            }
    }
}

/* --- The cheapest way: A* with the octile distance. Cells are taken by {estimate, number}, so that the way does not
   depend on the heap. */

typedef struct {
    uint32_t *cost;
    uint8_t *from; /* 0: not reached; else the direction of the step that led here, plus 1; 16: taken */
    uint64_t *heap;
    size_t size;
} search;

#define TAKEN 16

size_t grid_way_scratch(int64_t width, int64_t height)
{
    /* A cell is put on the heap again each time that it is reached more cheaply, from each neighbour at most once. */
    size_t cells = (size_t)(width * height);
    return cells * 8 * sizeof(uint64_t) + sizeof(uint64_t) + cells * sizeof(uint32_t) + cells;
}

static void push(search *s, uint64_t key)
{
    size_t k = s->size++;
    while (k > 0 && s->heap[(k - 1) / 2] > key) {
        s->heap[k] = s->heap[(k - 1) / 2];
        k = (k - 1) / 2;
    }
    s->heap[k] = key;
}

static uint64_t pop(search *s)
{
    uint64_t top = s->heap[0], last = s->heap[--s->size];
    size_t k = 0;
    for (;;) {
        size_t child = 2 * k + 1;
        if (child >= s->size)
            break;
        if (child + 1 < s->size && s->heap[child + 1] < s->heap[child])
            child++;
        if (s->heap[child] >= last)
            break;
        s->heap[k] = s->heap[child];
        k = child;
    }
    s->heap[k] = last;
    return top;
}

static const int DX[8] = {1, 1, 0, -1, -1, -1, 0, 1}, DY[8] = {0, 1, 1, 1, 0, -1, -1, -1};

static uint32_t guess(int64_t width, int64_t a, int64_t b)
{
    int64_t dx = a % width - b % width, dy = a / width - b / width;
    dx = dx < 0 ? -dx : dx;
    dy = dy < 0 ? -dy : dy;
    int64_t least = dx < dy ? dx : dy, most = dx < dy ? dy : dx;
    return (uint32_t)(GRID_WEIGHT * (GRID_STRAIGHT * (most - least) + GRID_DIAGONAL * least));
}

static uint32_t weight(int clear, int need)
{
    int lacking = GRID_ROOMY - (clear - need);
    lacking = lacking < 0 ? 0 : lacking > GRID_ROOMY ? GRID_ROOMY : lacking;
    return (uint32_t)(GRID_WEIGHT + lacking * GRID_NARROW / GRID_ROOMY);
}

size_t grid_way(const grid_map *map, const uint8_t *blocked, int need, int64_t start, int64_t goal, void *scratch,
                uint32_t *way, size_t most)
{
    const int64_t width = map->width, height = map->height, cells = width * height;
    search s = {.heap = scratch};
    s.cost = (uint32_t *)(s.heap + 8 * cells + 1);
    s.from = (uint8_t *)(s.cost + cells);
    memset(s.from, 0, (size_t)cells);

    s.cost[start] = 0;
    s.from[start] = 9;
    push(&s, ((uint64_t)guess(width, start, goal) << 32) | (uint64_t)start);

    while (s.size > 0) {
        int64_t at = (int64_t)(pop(&s) & 0xFFFFFFFFu);
        if (s.from[at] & TAKEN)
            continue;
        s.from[at] |= TAKEN;
        if (at == goal)
            break;
        int64_t x = at % width, y = at / width;
        uint8_t open = 0;
        for (int d = 0; d < 8; d++) {
            int64_t nx = x + DX[d], ny = y + DY[d];
            if (nx < 0 || ny < 0 || nx >= width || ny >= height)
                continue;
            int64_t next = ny * width + nx;
            if (next == goal || (map->clear[next] >= need && !blocked[next]))
                open |= (uint8_t)(1 << d);
        }
        for (int d = 0; d < 8; d++) {
            if (!(open & (1 << d)))
                continue;
            /* A diagonal step needs both cells beside it. */
            if (d % 2 == 1 && !((open & (1 << (d - 1))) && (open & (1 << ((d + 1) % 8)))))
                continue;
            int64_t next = (y + DY[d]) * width + x + DX[d];
            uint32_t cost = s.cost[at] + (d % 2 == 1 ? GRID_DIAGONAL : GRID_STRAIGHT) *
                                             weight(map->clear[next], need);
            if (s.from[next] & TAKEN || (s.from[next] != 0 && s.cost[next] <= cost))
                continue;
            s.cost[next] = cost;
            s.from[next] = (uint8_t)(d + 1);
            push(&s, ((uint64_t)(cost + guess(width, next, goal)) << 32) | (uint64_t)next);
        }
    }
    if (!(s.from[goal] & TAKEN))
        return 0;

    size_t count = 0;
    for (int64_t at = goal;; ) {
        if (count == most)
            return 0;
        way[count++] = (uint32_t)at;
        if (at == start)
            return count;
        int d = (s.from[at] & (TAKEN - 1)) - 1;
        at -= DY[d] * width + DX[d];
    }
}

/* --- Costs of ways to everywhere: Dijkstra's algorithm with a bucket for each cost (Dial 1969), round and round, because no
   step costs more than there are buckets. */

#define BUCKETS (GRID_CORNER * GRID_TIMES + 1)
#define NONE -1

size_t grid_spread_scratch(int64_t width, int64_t height)
{
    return (size_t)(2 * width * height + BUCKETS) * sizeof(int32_t);
}

void grid_spread(const uint8_t *times, int64_t width, int64_t height, int64_t start, void *scratch, int32_t *costs)
{
    const int64_t cells = width * height;
    /* Each bucket is a list, linked both ways. */
    int32_t *first = scratch, *next = first + BUCKETS, *before = next + cells;

    for (int64_t k = 0; k < BUCKETS; k++)
        first[k] = NONE;
    for (int64_t k = 0; k < cells; k++)
        costs[k] = GRID_UNREACHED;
    costs[start] = 0;
    first[0] = (int32_t)start;
    next[start] = before[start] = NONE;

    int64_t waiting = 1;
    for (int64_t cost = 0; waiting > 0; cost++) {
        int32_t *bucket = first + cost % BUCKETS;
        while (*bucket != NONE) {
            int64_t at = *bucket, x = at % width, y = at / width;
            *bucket = next[at];
            if (*bucket != NONE)
                before[*bucket] = NONE;
            waiting--;
            for (int d = 0; d < 8; d++) {
                int64_t nx = x + DX[d], ny = y + DY[d];
                if (nx < 0 || ny < 0 || nx >= width || ny >= height)
                    continue;
                int64_t to = ny * width + nx, total = cost + times[to] * (d % 2 == 1 ? GRID_CORNER : GRID_SIDE);
                if (times[to] == 0 || (costs[to] != GRID_UNREACHED && costs[to] <= total))
                    continue;
                if (costs[to] == GRID_UNREACHED) {
                    waiting++;
                } else {
                    if (before[to] == NONE)
                        first[costs[to] % BUCKETS] = next[to];
                    else
                        next[before[to]] = next[to];
                    if (next[to] != NONE)
                        before[next[to]] = before[to];
                }
                costs[to] = (int32_t)total;
                int32_t *list = first + total % BUCKETS;
                next[to] = *list;
                before[to] = NONE;
                if (*list != NONE)
                    before[*list] = (int32_t)to;
                *list = (int32_t)to;
            }
        }
    }
}
