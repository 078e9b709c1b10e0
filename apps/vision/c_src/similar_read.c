/* Reads a self-similar mark where a line of origins was found: where its stripes end above and below, its barcode. */
#include <math.h>

#include "similar_fit.h"

enum { TRACES = 9, LEAST_TRACES = 5, LEAST_WIDE = 20 };

/* Where the black at t ends, from the middle row upwards (step -1) or downwards. */
static int trace(const struct similar_pattern *pattern, double t, int64_t step, double *u, double *v)
{
    const int64_t scale = pattern->chain->scale;
    int64_t y = (int64_t)floor(pattern->y), white = 0;
    double before = similar_look(pattern, t, y), sum = 0.0;

    if (before < 0.0 || before >= pattern->threshold)
        return 0;
    while (white < 2) {
        y += step;
        double value = similar_look(pattern, t, y);

        if (value < 0.0)
            return 0;
        white = value >= pattern->threshold ? white + 1 : 0;
    }
    /* The first white row is one back. */
    int64_t from = y - step - step * (2 * scale + 1), to = y - step + step * scale;
    double first = similar_look(pattern, t, from), value = first;

    if (first < 0.0)
        return 0;
    for (int64_t j = from; j != to; j += step) {
        double next = similar_look(pattern, t, j + step);

        if (next < 0.0)
            return 0;
        sum += ((double)j + 0.5 * (double)step) * (next - value);
        value = next;
    }
    if (value - first < pattern->contrast / 3.0)
        return 0;
    double end = sum / (value - first);

    *u = (similar_column(pattern, t, end) - pattern->x) / pattern->chain->width;
    *v = (end - pattern->y) / pattern->chain->width;
    return 1;
}

/* Black lines of the pattern that are wide enough. */
static const double traces[TRACES] = { 0.575, 0.605, 0.636, 0.85, 0.908, 0.965, 1.125, 1.15, 1.175 };

static int line(const double u[TRACES], const double v[TRACES], const int used[TRACES], double fitted[2])
{
    double n = 0.0, su = 0.0, sv = 0.0, suu = 0.0, suv = 0.0;

    for (int k = 0; k < TRACES; k++)
        if (used[k])
            n += 1.0, su += u[k], sv += v[k], suu += u[k] * u[k], suv += u[k] * v[k];
    double det = n * suu - su * su;

    if (n < LEAST_TRACES || !(det > 1.0e-3))
        return 0;
    fitted[1] = (n * suv - su * sv) / det;
    fitted[0] = (sv - fitted[1] * su) / n;
    return 1;
}

/* The line where stripes end above (side 0) or below (side 1). */
static int end(struct similar_pattern *pattern, int side)
{
    double u[TRACES], v[TRACES], *fitted = pattern->ends[side];
    double most = (double)pattern->chain->scale / pattern->chain->width;
    int used[TRACES];

    for (int k = 0; k < TRACES; k++)
        used[k] = trace(pattern, traces[k], side ? 1 : -1, u + k, v + k);
    if (!line(u, v, used, fitted))
        return 0;
    for (int k = 0; k < TRACES; k++)
        used[k] = used[k] && fabs(v[k] - (fitted[0] + fitted[1] * u[k])) <= most;
    return line(u, v, used, fitted) && fabs(fitted[1]) < 1.5;
}

/* Where the pattern's line at t meets an end of the stripes. */
static int meet(const struct similar_pattern *pattern, double t, int side, double *u, double *v)
{
    const double *m = pattern->m, *end = pattern->ends[side];
    double across = m[0] - t * m[3] + (m[1] - t * m[4]) * end[1];

    if (!(across > 0.05))
        return 0;
    *u = (t - m[2] - (m[1] - t * m[4]) * end[0]) / across;
    *v = end[0] + end[1] * *u;
    return 1;
}

/* 1 if the pattern's line at t is black in at least seven of ten rows, 0 if it is white, else -1. */
static int majority(const struct similar_pattern *pattern, double t)
{
    double u, top, bottom;
    int64_t black = 0, rows = 0;

    if (!meet(pattern, t, 0, &u, &top) || !meet(pattern, t, 1, &u, &bottom))
        return -1;
    double width = pattern->chain->width, inside = (bottom - top) * 0.08;
    int64_t first = (int64_t)ceil(pattern->y + width * (top + inside));
    int64_t last = (int64_t)floor(pattern->y + width * (bottom - inside));

    for (int64_t y = first; y <= last; y += pattern->chain->scale) {
        double value = similar_look(pattern, t, y);

        if (value < 0.0)
            return -1;
        black += value < pattern->threshold;
        rows++;
    }
    if (rows < 8)
        return -1;
    return 10 * black >= 7 * rows ? 1 : 10 * black <= 3 * rows ? 0 : -1;
}

/* Whether there is white above and below. */
static int quiet(const struct similar_pattern *pattern)
{
    static const double places[] = { 0.575, 0.605, 0.74, 0.88, 0.95, 1.05, 1.15, 1.35, 1.65, 1.95 };
    double u, top, bottom, width = pattern->chain->width;

    for (int side = 0; side < 2; side++) {
        int white = 0;

        for (int k = 0; k < 10; k++) {
            if (!meet(pattern, places[k], 0, &u, &top) || !meet(pattern, places[k], 1, &u, &bottom))
                return 0;
            double v = side ? bottom + 0.06 * (bottom - top) : top - 0.06 * (bottom - top);
            int64_t y = (int64_t)floor(pattern->y + width * v + 0.5);

            white += similar_look(pattern, places[k], y) >= pattern->threshold;
        }
        if (white < 8)
            return 0;
    }
    return 1;
}

/* The id of the barcode; -1 if that, or what is about it, is none. */
static int code(const struct similar_pattern *pattern)
{
    int word = 0;

    /* Stripes from the right that are two pixels wide. */
    for (int k = 2; k < 7; k++) {
        double left = similar_edges[k + 1], right = similar_edges[k];
        double y = pattern->y, wide = similar_column(pattern, right, y) - similar_column(pattern, left, y);

        if (wide >= 2.0 && majority(pattern, (left + right) / 2.0) != 1 - k % 2)
            return -1;
    }
    /* Where the last cells are narrower, the fit has not followed the barcode to its end. */
    if (similar_column(pattern, 2.0, pattern->y) - similar_column(pattern, 1.9, pattern->y) < SIMILAR_NEAREST)
        return -1;
    /* The white at the sides may be less than a pixel wide. */
    if (majority(pattern, -0.05) == 1 || majority(pattern, 1.05) != 0 || majority(pattern, 1.15) != 1 ||
        majority(pattern, 2.05) == 1)
        return -1;
    for (int k = 0; k < SIMILAR_CELLS; k++) {
        int black = majority(pattern, 1.25 + 0.1 * (double)k);

        if (black < 0)
            return -1;
        word = 2 * word + black;
    }
    /* Nothing is corrected: with one wrong cell, more than half of all words would be some id's. */
    for (int id = 0; id < 16; id++) {
        int a = id >> 3 & 1, b = id >> 2 & 1, c = id >> 1 & 1, d = id & 1;
        int p = a ^ b ^ d, q = a ^ c ^ d, r = b ^ c ^ d, even = p ^ q ^ a ^ r ^ b ^ c ^ d;

        if (word == ((p << 7 | q << 6 | a << 5 | r << 4 | b << 3 | c << 2 | d << 1 | even) ^ 3))
            return id;
    }
    return -1;
}

/* The square is wide enough for its barcode, and at least about as high as it seems to be wide: else a part of it
   is hidden. It is higher where the stripes say that it is nearer: heights go with 1 + d u. */
static int whole(const struct similar_pattern *pattern, const double corners[4][2])
{
    double width = pattern->chain->width, d = pattern->m[3];
    double first = 1.0 + d * ((corners[0][0] + corners[3][0]) / 2.0 - pattern->x) / width;
    double second = 1.0 + d * ((corners[1][0] + corners[2][0]) / 2.0 - pattern->x) / width;
    double wide = (corners[1][0] + corners[2][0] - corners[0][0] - corners[3][0]) / 2.0;
    double left = corners[3][1] - corners[0][1], right = corners[2][1] - corners[1][1];

    return left > 0.0 && right > 0.0 && wide >= LEAST_WIDE && left + right >= 1.8 * wide &&
           left + right <= 6.0 * wide && left * second < 1.2 * right * first && right * first < 1.2 * left * second;
}

int similar_read(const struct marks_luma *luma, const struct similar_chain *chain, struct marks_found *found)
{
    static const double sides[4] = { 0.0, 1.0, 1.0, 0.0 };
    struct similar_pattern pattern;

    if (!similar_fit(luma, chain, &pattern) || !end(&pattern, 0) || !end(&pattern, 1))
        return 0;
    for (int k = 0; k < 4; k++) {
        double u, v;

        if (!meet(&pattern, sides[k], k / 2, &u, &v))
            return 0;
        found->corners[k][0] = pattern.x + chain->width * u;
        found->corners[k][1] = pattern.y + chain->width * v;
    }
    if (!whole(&pattern, found->corners) || !quiet(&pattern))
        return 0;
    found->id = code(&pattern);
    found->hamming = 0;
    found->margin = pattern.contrast / 2.0;
    found->x = (found->corners[0][0] + found->corners[1][0] + found->corners[2][0] + found->corners[3][0]) / 4.0;
    found->y = (found->corners[0][1] + found->corners[1][1] + found->corners[2][1] + found->corners[3][1]) / 4.0;
    return found->id >= 0;
}
