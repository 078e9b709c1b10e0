/* Reads a self-similar mark where a line of origins was found: its stripes to fractions of a pixel, where they end above
   and below, its barcode. */
#include <math.h>

#include "similar.h"

/* Edges that are looked for; each with its neighbours. */
enum { FIRST_EDGE = 1, LAST_EDGE = 9, ROUNDS = 5, TERMS = 5, TRACES = 9, LEAST_TRACES = 5, CELLS = 8, LEAST_WIDE = 20 };

/* x (to the right) and y (down) of the picture are u and v here: pattern widths from a point of the line of origins. The
   place in the pattern is t = (a u + b v + c) / (d u + e v + 1), as a plane seen in perspective has it. */
struct reader {
    const struct marks_luma *luma;
    const struct similar_chain *chain;
    double x, y, m[TERMS];
    double threshold, contrast;
    double ends[2][2];          /* v = ends[.][0] + ends[.][1] u: where the stripes end above, and below */
};

/* The luma between pixels of a row; -1 outside of the picture. */
static double sample(const struct marks_luma *luma, double x, int64_t y)
{
    if (!(x >= 0.0 && x < (double)(luma->width - 1)) || y < 0 || y >= (int64_t)luma->height)
        return -1.0;
    int64_t k = (int64_t)x;
    double part = x - (double)k;
    const uint8_t *pixel = luma->first + (size_t)y * luma->row + (size_t)k * luma->step;

    return (1.0 - part) * pixel[0] + part * pixel[luma->step];
}

/* Where in a row of the picture the pattern is at t. */
static double column(const struct reader *reader, double t, double y)
{
    const double *m = reader->m, width = reader->chain->width;
    double v = (y - reader->y) / width;

    return reader->x + width * ((t - m[2] - (m[1] - t * m[4]) * v) / (m[0] - t * m[3]));
}

/* Whether all of the mark is in front, and not too much aslant. */
static int sound(const double *m)
{
    return m[0] > 0.3 && m[0] < 3.0 && m[0] - 2.1 * m[3] > 0.1 && fabs(m[1]) < 1.0 && fabs(m[2]) < 0.5 &&
           fabs(m[3]) < 0.6 && fabs(m[4]) < 0.6;
}

/* Where the luma changes between two columns: the mean of places, weighed by the change there. */
static int edge(const struct reader *reader, int64_t from, int64_t to, int64_t y, double sign, double *at)
{
    const struct marks_luma *luma = reader->luma;

    if (from < 0 || to >= (int64_t)luma->width)
        return 0;
    const uint8_t *row = luma->first + (size_t)y * luma->row;
    double change = (double)row[(size_t)to * luma->step] - (double)row[(size_t)from * luma->step], sum = 0.0;

    if (change * sign < reader->chain->contrast / 4.0)
        return 0;
    for (int64_t j = from; j < to; j++)
        sum += ((double)j + 0.5) *
               ((double)row[(size_t)(j + 1) * luma->step] - (double)row[(size_t)j * luma->step]);
    *at = sum / change;
    return 1;
}

/* Solves a symmetric positive system in place; 0 if it has no solution. */
static int solve(double a[TERMS][TERMS + 1], double x[TERMS])
{
    for (int k = 0; k < TERMS; k++) {
        if (!(a[k][k] > 1.0e-9))
            return 0;
        for (int i = k + 1; i < TERMS; i++) {
            double factor = a[i][k] / a[k][k];

            for (int j = k; j <= TERMS; j++)
                a[i][j] -= factor * a[k][j];
        }
    }
    for (int k = TERMS - 1; k >= 0; k--) {
        double sum = a[k][TERMS];

        for (int j = k + 1; j < TERMS; j++)
            sum -= a[k][j] * x[j];
        x[k] = sum / a[k][k];
    }
    return 1;
}

/* The sums of a fit of the pattern to edges, how many were looked for, and how many were met. */
struct sums {
    double a[TERMS][TERMS + 1];
    int64_t looked, met;
};

/* Looks in a row for the edge at t, beyond which it is brighter (sign 1) or darker (-1); the next ones are at t + `right` and
   t - `left`. */
static void add(const struct reader *reader, double t, double left, double right, int64_t y, double sign,
                struct sums *sums)
{
    double here = column(reader, t, (double)y), most = 3.0 * (double)reader->chain->scale, at;
    double before = here - column(reader, t - left, (double)y), behind = column(reader, t + right, (double)y) - here;
    double half = (before < behind ? before : behind) / 2.0;

    if (half < 0.9)
        return;
    half = half < most ? half : most;
    int64_t from = (int64_t)floor(here - half + 0.5), to = (int64_t)floor(here + half + 0.5);

    sums->looked++;
    if (to - from < 2 || !edge(reader, from, to, y, sign, &at) || fabs(at - here) > half)
        return;
    sums->met++;
    double u = (at - reader->x) / reader->chain->width, v = ((double)y - reader->y) / reader->chain->width;
    const double row[TERMS + 1] = { u, v, 1.0, -t * u, -t * v, t };

    for (int i = 0; i < TERMS; i++)
        for (int j = 0; j <= TERMS; j++)
            sums->a[i][j] += row[i] * row[j];
}

/* The mean luma along the pattern's line at t, in the rows of the chain; -1 if it leaves the picture. */
static double mean(const struct reader *reader, double t)
{
    const struct similar_chain *chain = reader->chain;
    double sum = 0.0, n = 0.0;

    for (int64_t y = chain->first; y <= chain->last && y < (int64_t)reader->luma->height; y += chain->scale) {
        double value = sample(reader->luma, column(reader, t, (double)y), y);

        if (value < 0.0)
            return -1.0;
        sum += value;
        n += 1.0;
    }
    return sum / n;
}

static int levels(struct reader *reader)
{
    double white = mean(reader, 0.7415), gap = mean(reader, 1.05);
    double black = mean(reader, 0.908), bar = mean(reader, 1.15);

    if (white < 0.0 || gap < 0.0 || black < 0.0 || bar < 0.0)
        return 0;
    reader->threshold = (white + gap + black + bar) / 4.0;
    reader->contrast = (white + gap - black - bar) / 2.0;
    return reader->contrast >= 10.0;
}

/* Fits the pattern to the edges in all rows: those of the stripes, and so many of the barcode's as differ. */
static int refine(struct reader *reader, int cells)
{
    const struct similar_chain *chain = reader->chain;
    struct sums sums = { 0 };
    double m[TERMS], cell[CELLS + 2];

    for (int k = 0; k <= cells; k++)
        cell[k] = mean(reader, 1.15 + 0.1 * (double)k) < reader->threshold ? -1.0 : 1.0;
    /* Hardly any pull to a view without perspective, for marks of a few pixels. */
    sums.a[3][3] = sums.a[4][4] = 0.002;
    for (int64_t y = chain->first; y <= chain->last && y < (int64_t)reader->luma->height; y += chain->scale) {
        for (int k = FIRST_EDGE; k <= LAST_EDGE; k++) {
            const double *t = similar_edges + k;

            add(reader, t[0], t[0] - t[1], t[-1] - t[0], y, k % 2 ? -1.0 : 1.0, &sums);
        }
        for (int k = 0; k < cells; k++)
            if (cell[k] != cell[k + 1])
                add(reader, 1.2 + 0.1 * (double)k, 0.1, 0.1, y, cell[k + 1], &sums);
    }
    if (sums.met < 12 || 2 * sums.met < sums.looked || !solve(sums.a, m) || !sound(m))
        return 0;
    for (int k = 0; k < TERMS; k++)
        reader->m[k] = m[k];
    return 1;
}

/* Where the black at t ends, from the middle row upwards (step -1) or downwards. */
static int trace(const struct reader *reader, double t, int64_t step, double *u, double *v)
{
    const struct marks_luma *luma = reader->luma;
    const int64_t scale = reader->chain->scale;
    int64_t y = (int64_t)floor(reader->y), white = 0;
    double before = sample(luma, column(reader, t, (double)y), y), sum = 0.0;

    if (before < 0.0 || before >= reader->threshold)
        return 0;
    while (white < 2) {
        y += step;
        double value = sample(luma, column(reader, t, (double)y), y);

        if (value < 0.0)
            return 0;
        white = value >= reader->threshold ? white + 1 : 0;
    }
    /* The first white row is one back. */
    int64_t from = y - step - step * (2 * scale + 1), to = y - step + step * scale;
    double first = sample(luma, column(reader, t, (double)from), from), value = first;

    if (first < 0.0)
        return 0;
    for (int64_t j = from; j != to; j += step) {
        double next = sample(luma, column(reader, t, (double)(j + step)), j + step);

        if (next < 0.0)
            return 0;
        sum += ((double)j + 0.5 * (double)step) * (next - value);
        value = next;
    }
    if (value - first < reader->contrast / 3.0)
        return 0;
    double end = sum / (value - first);

    *u = (column(reader, t, end) - reader->x) / reader->chain->width;
    *v = (end - reader->y) / reader->chain->width;
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
static int end(struct reader *reader, int side)
{
    double u[TRACES], v[TRACES], *fitted = reader->ends[side];
    double most = (double)reader->chain->scale / reader->chain->width;
    int used[TRACES];

    for (int k = 0; k < TRACES; k++)
        used[k] = trace(reader, traces[k], side ? 1 : -1, u + k, v + k);
    if (!line(u, v, used, fitted))
        return 0;
    for (int k = 0; k < TRACES; k++)
        used[k] = used[k] && fabs(v[k] - (fitted[0] + fitted[1] * u[k])) <= most;
    return line(u, v, used, fitted) && fabs(fitted[1]) < 1.5;
}

/* Where the pattern's line at t meets an end of the stripes. */
static int meet(const struct reader *reader, double t, int side, double *u, double *v)
{
    const double *m = reader->m, *end = reader->ends[side];
    double across = m[0] - t * m[3] + (m[1] - t * m[4]) * end[1];

    if (!(across > 0.05))
        return 0;
    *u = (t - m[2] - (m[1] - t * m[4]) * end[0]) / across;
    *v = end[0] + end[1] * *u;
    return 1;
}

/* 1 if the pattern's line at t is black in at least seven of ten rows, 0 if it is white, else -1. */
static int majority(const struct reader *reader, double t)
{
    double u, top, bottom;
    int64_t black = 0, rows = 0;

    if (!meet(reader, t, 0, &u, &top) || !meet(reader, t, 1, &u, &bottom))
        return -1;
    double width = reader->chain->width, inside = (bottom - top) * 0.08;
    int64_t first = (int64_t)ceil(reader->y + width * (top + inside));
    int64_t last = (int64_t)floor(reader->y + width * (bottom - inside));

    for (int64_t y = first; y <= last; y += reader->chain->scale) {
        double value = sample(reader->luma, column(reader, t, (double)y), y);

        if (value < 0.0)
            return -1;
        black += value < reader->threshold;
        rows++;
    }
    if (rows < 8)
        return -1;
    return 10 * black >= 7 * rows ? 1 : 10 * black <= 3 * rows ? 0 : -1;
}

/* Whether there is white above and below. */
static int quiet(const struct reader *reader)
{
    static const double places[] = { 0.575, 0.605, 0.74, 0.88, 0.95, 1.05, 1.15, 1.35, 1.65, 1.95 };
    double u, top, bottom, width = reader->chain->width;

    for (int side = 0; side < 2; side++) {
        int white = 0;

        for (int k = 0; k < 10; k++) {
            if (!meet(reader, places[k], 0, &u, &top) || !meet(reader, places[k], 1, &u, &bottom))
                return 0;
            double v = side ? bottom + 0.06 * (bottom - top) : top - 0.06 * (bottom - top);
            int64_t y = (int64_t)floor(reader->y + width * v + 0.5);

            white += sample(reader->luma, column(reader, places[k], (double)y), y) >= reader->threshold;
        }
        if (white < 8)
            return 0;
    }
    return 1;
}

/* The id of the barcode; -1 if that, or what is about it, is none. */
static int code(const struct reader *reader)
{
    int word = 0;

    /* Stripes from the right that are two pixels wide. */
    for (int k = 2; k < 7; k++) {
        double left = similar_edges[k + 1], right = similar_edges[k];
        double y = reader->y, wide = column(reader, right, y) - column(reader, left, y);

        if (wide >= 2.0 && majority(reader, (left + right) / 2.0) != 1 - k % 2)
            return -1;
    }
    /* The white at the sides may be less than a pixel wide. */
    if (majority(reader, -0.05) == 1 || majority(reader, 1.05) != 0 || majority(reader, 1.15) != 1 ||
        majority(reader, 2.05) == 1)
        return -1;
    for (int k = 0; k < CELLS; k++) {
        int black = majority(reader, 1.25 + 0.1 * (double)k);

        if (black < 0)
            return -1;
        word = 2 * word + black;
    }
    /* Nothing is corrected: with one wrong cell, more than half of all words would be some id's. */
    for (int id = 0; id < 16; id++) {
        int a = id >> 3 & 1, b = id >> 2 & 1, c = id >> 1 & 1, d = id & 1;
        int p = a ^ b ^ d, q = a ^ c ^ d, r = b ^ c ^ d;

        int even = p ^ q ^ a ^ r ^ b ^ c ^ d;

        if (word == ((p << 7 | q << 6 | a << 5 | r << 4 | b << 3 | c << 2 | d << 1 | even) ^ 3))
            return id;
    }
    return -1;
}

/* Cells of the barcode are two pixels wide. The square is at least about as high as it seems to be wide: else a part of it is
   hidden. It is higher where the stripes say that it is nearer: heights go with 1 + d u. */
static int whole(const struct reader *reader, const double corners[4][2])
{
    double width = reader->chain->width, d = reader->m[3];
    double first = 1.0 + d * ((corners[0][0] + corners[3][0]) / 2.0 - reader->x) / width;
    double second = 1.0 + d * ((corners[1][0] + corners[2][0]) / 2.0 - reader->x) / width;
    double wide = (corners[1][0] + corners[2][0] - corners[0][0] - corners[3][0]) / 2.0;
    double left = corners[3][1] - corners[0][1], right = corners[2][1] - corners[1][1];

    return left > 0.0 && right > 0.0 && wide >= LEAST_WIDE && left + right >= 1.8 * wide && left + right <= 6.0 * wide &&
           left * second < 1.2 * right * first && right * first < 1.2 * left * second;
}

int similar_read(const struct marks_luma *luma, const struct similar_chain *chain, struct marks_found *found)
{
    /* The farther the pattern is known, the farther it can be followed. */
    static const int reaches[ROUNDS] = { 0, 0, 3, 6, CELLS + 1 };
    static const double sides[4] = { 0.0, 1.0, 1.0, 0.0 };
    struct reader reader = { .luma = luma, .chain = chain };
    int64_t last = chain->last < (int64_t)luma->height ? chain->last : (int64_t)luma->height - 1;

    reader.y = (double)(chain->first + last) / 2.0;
    reader.x = chain->x0 + chain->slope * reader.y;
    reader.m[0] = 1.0;
    reader.m[1] = -chain->slope;
    if (!sound(reader.m))
        return 0;
    for (int k = 0; k < ROUNDS; k++)
        if (!refine(&reader, reaches[k]) || !levels(&reader))
            return 0;
    if (!end(&reader, 0) || !end(&reader, 1))
        return 0;
    for (int k = 0; k < 4; k++) {
        double u, v;

        if (!meet(&reader, sides[k], k / 2, &u, &v))
            return 0;
        found->corners[k][0] = reader.x + chain->width * u;
        found->corners[k][1] = reader.y + chain->width * v;
    }
    if (!whole(&reader, found->corners) || !quiet(&reader))
        return 0;
    found->id = code(&reader);
    found->hamming = 0;
    found->margin = reader.contrast / 2.0;
    found->x = (found->corners[0][0] + found->corners[1][0] + found->corners[2][0] + found->corners[3][0]) / 4.0;
    found->y = (found->corners[0][1] + found->corners[1][1] + found->corners[2][1] + found->corners[3][1]) / 4.0;
    return found->id >= 0;
}
