/* Camera pictures: columns of floor, wall and ceiling, poles before them, and noise. */
#include <math.h>
#include <string.h>

#include "kernel.h"

#define NEAREST 0.01
#define FARTHEST 1.0e6
#define WALL_HEIGHT 2.5
/* A ray meets no side that it is as good as parallel to. */
#define PARALLEL 1.0e-9
/* The lamp rides beside the camera, 8 degrees to its left. */
#define LAMP_COSINE 0.9902680687415704
#define LAMP_SINE 0.13917310096006544

static inline int64_t floored(double x)
{
    int64_t i = (int64_t)x;
    return i - (x < (double)i);
}

static inline int64_t ceiled(double x)
{
    int64_t i = (int64_t)x;
    return i + (x > (double)i);
}

static inline int64_t clamped(int64_t value, int64_t least, int64_t most)
{
    return value < least ? least : value > most ? most : value;
}

/* The columns a pole can cover, rather too many than too few. */
static sim_span columns(const sim_sight *sight, const sim_pole *pole)
{
    double dx = pole->x - sight->x, dy = pole->y - sight->y, r = pole->radius;
    double depth = sight->cosine * dx + sight->sine * dy;
    double side = sight->cosine * dy - sight->sine * dx;
    double middle = (double)(sight->width - 1) / 2;

    if (depth <= -r)
        return (sim_span){1, 0};
    if (depth <= 2 * r)
        return (sim_span){0, sight->width - 1};
    double left = middle - sight->focal * ((side + r) / (side + r < 0.0 ? depth + r : depth - r));
    double right = middle - sight->focal * ((side - r) / (side - r < 0.0 ? depth - r : depth + r));
    return (sim_span){clamped(floored(left) - 1, 0, sight->width),
                      clamped(ceiled(right) + 1, -1, sight->width - 1)};
}

/* Where a ray is between two sides of a box, in multiples of its direction; 0 if nowhere. */
static int between(double at, double along, double half, double *enters, double *leaves)
{
    if (along < PARALLEL && along > -PARALLEL)
        return at < half && at > -half;
    double low = (-half - at) / along, high = (half - at) / along;
    double first = low < high ? low : high, last = low < high ? high : low;
    *enters = first > *enters ? first : *enters;
    *leaves = last < *leaves ? last : *leaves;
    return 1;
}

/* The depth at which a ray meets a box from outside, negative where it does not. */
static double meet_box(const sim_sight *sight, const sim_pole *box, double rx, double ry)
{
    double mx = sight->x - box->x, my = sight->y - box->y;
    double enters = -FARTHEST, leaves = FARTHEST;

    if (!between(mx * box->cosine + my * box->sine, rx * box->cosine + ry * box->sine, box->half_x, &enters, &leaves) ||
        !between(my * box->cosine - mx * box->sine, ry * box->cosine - rx * box->sine, box->half_y, &enters, &leaves) ||
        !(enters > 0.0 && enters <= leaves))
        return -1.0;
    return enters < NEAREST ? NEAREST : enters;
}

/* The depth at which a ray meets a pole, negative where it does not. */
static double meet(const sim_sight *sight, const sim_pole *pole, double rx, double ry)
{
    if (pole->half_x > 0.0)
        return meet_box(sight, pole, rx, ry);
    double mx = pole->x - sight->x, my = pole->y - sight->y, r = pole->radius;
    double a = rx * rx + ry * ry, b = mx * rx + my * ry;
    double under = b * b - a * (mx * mx + my * my - r * r);
    if (!(b > 0.0 && under >= 0.0))
        return -1.0;
    double t = (b - sqrt(under)) / a;
    return t < NEAREST ? NEAREST : t;
}

/* Where the side of a box faces on which a ray meets it. */
static void side(const sim_sight *sight, const sim_pole *box, double rx, double ry, double depth, double *nx, double *ny)
{
    double mx = sight->x + rx * depth - box->x, my = sight->y + ry * depth - box->y;
    double along = (mx * box->cosine + my * box->sine) / box->half_x;
    double across = (my * box->cosine - mx * box->sine) / box->half_y;
    double end = along < 0.0 ? -1.0 : 1.0, flank = across < 0.0 ? -1.0 : 1.0;
    int ends = along * end >= across * flank;

    *nx = ends ? end * box->cosine : 0.0 - flank * box->sine;
    *ny = ends ? end * box->sine : flank * box->cosine;
}

static uint8_t luma(const sim_sight *sight, const sim_pole *pole, double rx, double ry,
                    double depth)
{
    double nx = (sight->x + rx * depth - pole->x) / pole->radius;
    double ny = (sight->y + ry * depth - pole->y) / pole->radius;
    if (pole->half_x > 0.0)
        side(sight, pole, rx, ry, depth, &nx, &ny);
    double length = sqrt(rx * rx + ry * ry);
    double lx = (ry * LAMP_SINE - rx * LAMP_COSINE) / length;
    double ly = (0.0 - rx * LAMP_SINE - ry * LAMP_COSINE) / length;
    double shade = 0.6 + 0.4 * (nx * lx + ny * ly);
    return (uint8_t)clamped((int64_t)(pole->paint[0] * shade + 0.5), 0, 255);
}

static void ray(const sim_sight *sight, double column, double *rx, double *ry)
{
    double k = ((double)(sight->width - 1) / 2 - column) / sight->focal;
    *rx = sight->cosine - sight->sine * k;
    *ry = sight->sine + sight->cosine * k;
}

/* The poles that a column's ray meets, nearest first. */
static size_t meet_all(const sim_sight *sight, const sim_pole *poles, size_t count, int64_t column,
                       double rx, double ry, const sim_scratch *scratch)
{
    size_t found = 0;

    for (size_t k = 0; k < count; k++) {
        if (column < scratch->spans[k].first || column > scratch->spans[k].last)
            continue;
        double depth = meet(sight, poles + k, rx, ry);
        if (depth < 0.0)
            continue;
        size_t n = found++;
        for (; n > 0 && scratch->hits[n - 1].depth > depth; n--)
            scratch->hits[n] = scratch->hits[n - 1];
        scratch->hits[n] = (sim_hit){depth, (uint32_t)k};
    }
    return found;
}

/* All stand on the floor, so what is nearer hides everything below its upper edge. */
static size_t cut(const sim_sight *sight, const sim_pole *poles, size_t found, double wall,
                  int64_t column, double rx, double ry, const sim_scratch *scratch, size_t made)
{
    int64_t covered = sight->height;

    for (size_t k = 0; k < found && covered > 0 && scratch->hits[k].depth <= wall; k++) {
        const double depth = scratch->hits[k].depth;
        const sim_pole *pole = poles + scratch->hits[k].pole;
        int64_t top = ceiled(sight->horizon - sight->focal * (pole->height - sight->eye) / depth);
        int64_t bottom = floored(sight->horizon + sight->focal * sight->eye / depth);
        top = top < 0 ? 0 : top;
        bottom = bottom > covered - 1 ? covered - 1 : bottom;
        if (top <= bottom) {
            scratch->pieces[made++] =
                (sim_piece){(uint16_t)column, (uint16_t)top, (uint16_t)bottom, pole->kind,
                            luma(sight, pole, rx, ry, depth)};
            covered = top;
        }
    }
    return made;
}

size_t sim_look(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
                const sim_scratch *scratch)
{
    int64_t first = sight->width, last = -1;
    size_t made = 0;

    for (size_t k = 0; k < count; k++) {
        sim_span span = scratch->spans[k] = columns(sight, poles + k);
        if (span.first <= span.last) {
            first = span.first < first ? span.first : first;
            last = span.last > last ? span.last : last;
        }
    }
    for (int64_t column = first; column <= last; column++) {
        double rx, ry;
        int axis;
        ray(sight, (double)column, &rx, &ry);
        size_t found = meet_all(sight, poles, count, column, rx, ry, scratch);
        if (found > 0) {
            double far = scratch->hits[found - 1].depth;
            double wall = sim_wall(map, sight->x, sight->y, rx, ry, far, &axis);
            made = cut(sight, poles, found, wall, column, rx, ry, scratch, made);
        }
    }
    return made;
}

static void blur(uint8_t *restrict plane, int64_t width, int64_t height, const sim_noise *noise,
                 uint32_t first, const int8_t *restrict table)
{
    for (int64_t v = 0; v < height; v++, plane += width) {
        const int8_t *restrict draws =
            table + sim_hash(noise->seed, noise->step, noise->robot, first + (uint32_t)v) %
                        SIM_TABLE;
        for (int64_t u = 0; u < width; u++)
            plane[u] = (uint8_t)(plane[u] + draws[u]);
    }
}

/* One pixel in a thousand is white or black. */
static void salt(uint8_t *plane, int64_t size, const sim_noise *noise)
{
    for (int64_t n = 0; n < size / 1000; n++) {
        uint32_t hash =
            sim_hash(noise->seed, noise->step, noise->robot, 0x70000u + (uint32_t)n);
        plane[hash % (uint32_t)size] = hash >> 31 ? 235 : 16;
    }
}

static void room(const sim_sight *sight, const sim_scratch *scratch, uint8_t *restrict picture)
{
    const int16_t *restrict tops = scratch->tops, *restrict bottoms = scratch->bottoms;
    const uint8_t *restrict lumas = scratch->lumas;

    for (int64_t v = 0; v < sight->height; v++, picture += sight->width) {
        const uint8_t ceiling = (uint8_t)(145 - 20 * v / sight->height);
        const uint8_t ground = (uint8_t)(75 + 45 * v / sight->height);
        const int16_t row = (int16_t)v;
        for (int64_t u = 0; u < sight->width; u++) {
            const uint8_t wall = lumas[u];
            const uint8_t below = row <= bottoms[u] ? wall : ground;
            picture[u] = row < tops[u] ? ceiling : below;
        }
    }
}

static void put(const sim_sight *sight, const sim_piece *piece, const uint8_t *paint,
                uint8_t *picture)
{
    const int64_t width = sight->width, half = width / 2;
    uint8_t *u = picture + width * sight->height, *v = u + half * (sight->height / 2);

    for (int64_t row = piece->top; row <= piece->bottom; row++)
        picture[row * width + piece->column] = piece->luma;
    if (piece->column % 2 == 0) {
        /* The darker, the greyer. */
        int full = paint[0] < 1 ? 1 : paint[0], sum = piece->luma + full;
        uint8_t cu = (uint8_t)(128 + (paint[1] - 128) * sum / (2 * full));
        uint8_t cv = (uint8_t)(128 + (paint[2] - 128) * sum / (2 * full));
        for (int64_t row = (piece->top + 1) / 2; row <= piece->bottom / 2; row++) {
            u[row * half + piece->column / 2] = cu;
            v[row * half + piece->column / 2] = cv;
        }
    }
}

/* Marks: SAMPLES x SAMPLES points of a pixel are looked at, or their cells would be found too well. */
enum { SAMPLES = 4, WHITE = 225, BLACK = 30 };

/* Nearer than this nothing is painted of a mark. */
#define MARK_NEAREST 0.05
/* From the side there is nothing to see. */
#define MARK_EDGE 1.0e-6

/* The columns and rows that a mark can cover; 0 if none. */
static int mark_box(const sim_sight *sight, const sim_mark *mark, sim_span *columns, sim_span *rows)
{
    const double half = (double)mark->rows * mark->row / 2, middle = (double)(sight->width - 1) / 2;
    double left = FARTHEST * FARTHEST, right = -left, top = left, bottom = right;

    for (int end = 0; end <= 1; end++) {
        double edge = mark->edges[end * mark->columns];
        double dx = mark->x - edge * mark->sine - sight->x;
        double dy = mark->y + edge * mark->cosine - sight->y;
        double depth = sight->cosine * dx + sight->sine * dy;
        double side = sight->cosine * dy - sight->sine * dx;
        if (depth < MARK_NEAREST)
            return 0;
        double column = middle - sight->focal * (side / depth);
        double upper = sight->horizon - sight->focal * ((mark->middle + half - sight->eye) / depth);
        double lower = sight->horizon - sight->focal * ((mark->middle - half - sight->eye) / depth);
        left = column < left ? column : left;
        right = column > right ? column : right;
        top = upper < top ? upper : top;
        bottom = lower > bottom ? lower : bottom;
    }
    *columns = (sim_span){clamped(floored(left), 0, sight->width), clamped(ceiled(right), -1, sight->width - 1)};
    *rows = (sim_span){clamped(floored(top), 0, sight->height), clamped(ceiled(bottom), -1, sight->height - 1)};
    return 1;
}

/* The depth at which a ray meets the front of a mark's plane, negative where it does not. */
static double front(const sim_sight *sight, const sim_mark *mark, double rx, double ry)
{
    double ahead = (mark->x - sight->x) * mark->cosine + (mark->y - sight->y) * mark->sine;
    double along = rx * mark->cosine + ry * mark->sine;
    return along < -MARK_EDGE && ahead < 0.0 ? ahead / along : -1.0;
}

/* The number of a column, -1 beside the mark. */
static int64_t column_at(const sim_mark *mark, double at)
{
    int64_t k = 0;

    if (!(at >= mark->edges[0] && at < mark->edges[mark->columns]))
        return -1;
    while (at >= mark->edges[k + 1])
        k++;
    return k;
}

/* The same of a row. */
static int64_t row_at(const sim_mark *mark, double at)
{
    return at >= 0.0 && at < (double)mark->rows ? (int64_t)at : -1;
}

static double sample(int k)
{
    return ((double)k - (double)(SAMPLES - 1) / 2) / SAMPLES;
}

/* The row above which a mark at this depth is not hidden by a pole; 0 if a wall hides all of it. */
static int64_t unhidden(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
                        int64_t column, double rx, double ry, double depth, const sim_scratch *scratch)
{
    int64_t above = sight->height;
    int axis;

    if (sim_wall(map, sight->x, sight->y, rx, ry, depth, &axis) < depth)
        return 0;
    size_t found = meet_all(sight, poles, count, column, rx, ry, scratch);
    for (size_t k = 0; k < found && scratch->hits[k].depth < depth; k++) {
        const sim_pole *pole = poles + scratch->hits[k].pole;
        int64_t top =
            ceiled(sight->horizon - sight->focal * (pole->height - sight->eye) / scratch->hits[k].depth);
        above = top < above ? top : above;
    }
    return above;
}

static void put_mark(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
                     const sim_mark *mark, const sim_scratch *scratch, uint8_t *picture)
{
    const int64_t width = sight->width, half = width / 2;
    const double middle = (double)mark->rows / 2;
    uint8_t *u = picture + width * sight->height, *v = u + half * (sight->height / 2);
    sim_span columns, rows;

    if (!mark_box(sight, mark, &columns, &rows))
        return;
    for (int64_t column = columns.first; column <= columns.last; column++) {
        double rx, ry, depths[SAMPLES];
        int64_t across[SAMPLES];
        ray(sight, (double)column, &rx, &ry);
        double depth = front(sight, mark, rx, ry);
        if (depth < 0.0)
            continue;
        int64_t above = unhidden(map, sight, poles, count, column, rx, ry, depth, scratch);
        for (int k = 0; k < SAMPLES; k++) {
            ray(sight, (double)column + sample(k), &rx, &ry);
            double d = depths[k] = front(sight, mark, rx, ry);
            double x = sight->x + rx * d - mark->x, y = sight->y + ry * d - mark->y;
            across[k] = d < 0.0 ? -1 : column_at(mark, y * mark->cosine - x * mark->sine);
        }
        for (int64_t row = rows.first; row <= rows.last && row < above; row++) {
            int sum = 0, inside = 0;
            for (int j = 0; j < SAMPLES; j++)
                for (int k = 0; k < SAMPLES; k++) {
                    if (across[k] < 0)
                        continue;
                    double height =
                        sight->eye + (sight->horizon - ((double)row + sample(j))) * depths[k] / sight->focal;
                    int64_t down = row_at(mark, (mark->middle - height) / mark->row + middle);
                    if (down < 0)
                        continue;
                    sum += mark->white[down * mark->columns + across[k]] ? WHITE : BLACK;
                    inside++;
                }
            if (inside == 0)
                continue;
            uint8_t *pixel = picture + row * width + column;
            *pixel = (uint8_t)((sum + (SAMPLES * SAMPLES - inside) * *pixel + SAMPLES * SAMPLES / 2) /
                               (SAMPLES * SAMPLES));
            if (column % 2 == 0 && row % 2 == 0)
                u[row / 2 * half + column / 2] = v[row / 2 * half + column / 2] = 128;
        }
    }
}

void sim_paint(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
               const sim_mark *marks, size_t mark_count, const sim_noise *noise, const int8_t *tables, const sim_scratch *scratch,
               uint8_t *picture)
{
    const int64_t width = sight->width, height = sight->height;
    const uint8_t *paints[256] = {0};
    size_t made = 0;
    sim_rays rays;
    double walls[SIM_CHUNK];
    uint8_t axes[SIM_CHUNK];

    for (size_t k = 0; k < count; k++) {
        scratch->spans[k] = columns(sight, poles + k);
        paints[poles[k].kind] = poles[k].paint;
    }
    for (int64_t column = 0; column < width; column++) {
        const int64_t n = column % SIM_CHUNK;
        if (n == 0) {
            rays.count = (size_t)(width - column < SIM_CHUNK ? width - column : SIM_CHUNK);
            for (size_t m = 0; m < rays.count; m++) {
                rays.x[m] = sight->x;
                rays.y[m] = sight->y;
                ray(sight, (double)(column + (int64_t)m), rays.rx + m, rays.ry + m);
            }
            sim_walls(map, &rays, FARTHEST, walls, axes);
        }
        const double rx = rays.rx[n], ry = rays.ry[n];
        double wall = walls[n];
        size_t found = meet_all(sight, poles, count, column, rx, ry, scratch);
        made = cut(sight, poles, found, wall, column, rx, ry, scratch, made);

        wall = wall < NEAREST ? NEAREST : wall;
        int64_t top = ceiled(sight->horizon - sight->focal * (WALL_HEIGHT - sight->eye) / wall);
        int64_t bottom = floored(sight->horizon + sight->focal * sight->eye / wall);
        int64_t dark = (int64_t)(wall * 4);
        scratch->tops[column] = (int16_t)clamped(top, 0, height);
        scratch->bottoms[column] = (int16_t)clamped(bottom, -1, height - 1);
        scratch->lumas[column] =
            (uint8_t)(150 - (dark > 70 ? 70 : dark) - (axes[n] == 1 ? 14 : 0));
    }
    room(sight, scratch, picture);
    memset(picture + width * height, 128, (size_t)(width * height / 2));
    for (size_t k = 0; k < made; k++)
        put(sight, scratch->pieces + k, paints[scratch->pieces[k].kind], picture);
    for (size_t k = 0; k < mark_count; k++)
        put_mark(map, sight, poles, count, marks + k, scratch, picture);
    if (noise->on) {
        const int8_t *chroma = tables + SIM_TABLE + SIM_WIDEST;
        uint8_t *u = picture + width * height, *v = u + width * height / 4;
        blur(picture, width, height, noise, 0x40000u, tables);
        salt(picture, width * height, noise);
        blur(u, width / 2, height / 2, noise, 0x50000u, chroma);
        blur(v, width / 2, height / 2, noise, 0x60000u, chroma);
    }
}
