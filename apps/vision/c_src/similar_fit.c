/* Fits a self-similar pattern to the edges about a line of origins, to fractions of a pixel. */
#include <math.h>

#include "similar_fit.h"

/* Edges that are looked for; each with its neighbours. */
enum { FIRST_EDGE = 1, LAST_EDGE = 9, ROUNDS = 5 };

double similar_column(const struct similar_pattern *pattern, double t, double y)
{
    const double *m = pattern->m, width = pattern->chain->width;
    double v = (y - pattern->y) / width;

    return pattern->x + width * ((t - m[2] - (m[1] - t * m[4]) * v) / (m[0] - t * m[3]));
}

double similar_look(const struct similar_pattern *pattern, double t, int64_t y)
{
    const struct marks_luma *luma = pattern->luma;
    double x = similar_column(pattern, t, (double)y);

    if (!(x >= 0.0 && x < (double)(luma->width - 1)) || y < 0 || y >= (int64_t)luma->height)
        return -1.0;
    int64_t k = (int64_t)x;
    double part = x - (double)k;
    const uint8_t *pixel = luma->first + (size_t)y * luma->row + (size_t)k * luma->step;

    return (1.0 - part) * pixel[0] + part * pixel[luma->step];
}

/* Whether all of the mark is in front, and not too much aslant. */
static int sound(const double *m)
{
    return m[0] > 0.3 && m[0] < 3.0 && m[0] - 2.1 * m[3] > 0.1 && fabs(m[1]) < 1.0 && fabs(m[2]) < 0.5 &&
           fabs(m[3]) < 0.6 && fabs(m[4]) < 0.6;
}

/* Where the luma changes between two columns: the mean of places, weighed by the change there. */
static int edge(const struct similar_pattern *pattern, int64_t from, int64_t to, int64_t y, double sign, double *at)
{
    const struct marks_luma *luma = pattern->luma;

    if (from < 0 || to >= (int64_t)luma->width)
        return 0;
    const uint8_t *row = luma->first + (size_t)y * luma->row;
    double change = (double)row[(size_t)to * luma->step] - (double)row[(size_t)from * luma->step], sum = 0.0;

    if (change * sign < pattern->chain->contrast / 4.0)
        return 0;
    for (int64_t j = from; j < to; j++)
        sum += ((double)j + 0.5) *
               ((double)row[(size_t)(j + 1) * luma->step] - (double)row[(size_t)j * luma->step]);
    *at = sum / change;
    return 1;
}

/* Solves a symmetric positive system in place; 0 if it has no solution. */
static int solve(double a[SIMILAR_TERMS][SIMILAR_TERMS + 1], double x[SIMILAR_TERMS])
{
    for (int k = 0; k < SIMILAR_TERMS; k++) {
        if (!(a[k][k] > 1.0e-9))
            return 0;
        for (int i = k + 1; i < SIMILAR_TERMS; i++) {
            double factor = a[i][k] / a[k][k];

            for (int j = k; j <= SIMILAR_TERMS; j++)
                a[i][j] -= factor * a[k][j];
        }
    }
    for (int k = SIMILAR_TERMS - 1; k >= 0; k--) {
        double sum = a[k][SIMILAR_TERMS];

        for (int j = k + 1; j < SIMILAR_TERMS; j++)
            sum -= a[k][j] * x[j];
        x[k] = sum / a[k][k];
    }
    return 1;
}

/* The sums of a fit of the pattern to edges, how many were looked for, and how many were met. */
struct sums {
    double a[SIMILAR_TERMS][SIMILAR_TERMS + 1];
    int64_t looked, met;
};

/* Looks in a row for the edge at t, beyond which it is brighter (sign 1) or darker (-1); the next ones are at t + `right`
   and t - `left`. */
static void add(const struct similar_pattern *pattern, double t, double left, double right, int64_t y, double sign,
                struct sums *sums)
{
    double here = similar_column(pattern, t, (double)y), most = 3.0 * (double)pattern->chain->scale, at;
    double before = here - similar_column(pattern, t - left, (double)y);
    double behind = similar_column(pattern, t + right, (double)y) - here;
    double next = before < behind ? before : behind, half = next / 2.0 < most ? next / 2.0 : most;

    if (next < SIMILAR_NEAREST)
        return;
    int64_t from = (int64_t)floor(here - half + 0.5), to = (int64_t)floor(here + half + 0.5);

    sums->looked++;
    if (to - from < 2 || !edge(pattern, from, to, y, sign, &at) || fabs(at - here) > half)
        return;
    sums->met++;
    double u = (at - pattern->x) / pattern->chain->width, v = ((double)y - pattern->y) / pattern->chain->width;
    const double row[SIMILAR_TERMS + 1] = { u, v, 1.0, -t * u, -t * v, t };

    for (int i = 0; i < SIMILAR_TERMS; i++)
        for (int j = 0; j <= SIMILAR_TERMS; j++)
            sums->a[i][j] += row[i] * row[j];
}

/* The mean luma along the pattern's line at t, in the rows of the chain; -1 if it leaves the picture. */
static double mean(const struct similar_pattern *pattern, double t)
{
    const struct similar_chain *chain = pattern->chain;
    double sum = 0.0, n = 0.0;

    for (int64_t y = chain->first; y <= chain->last && y < (int64_t)pattern->luma->height; y += chain->scale) {
        double value = similar_look(pattern, t, y);

        if (value < 0.0)
            return -1.0;
        sum += value;
        n += 1.0;
    }
    return sum / n;
}

static int levels(struct similar_pattern *pattern)
{
    double white = mean(pattern, 0.7415), gap = mean(pattern, 1.05);
    double black = mean(pattern, 0.908), bar = mean(pattern, 1.15);

    if (white < 0.0 || gap < 0.0 || black < 0.0 || bar < 0.0)
        return 0;
    pattern->threshold = (white + gap + black + bar) / 4.0;
    pattern->contrast = (white + gap - black - bar) / 2.0;
    return pattern->contrast >= 10.0;
}

/* Fits the pattern to the edges in all rows: those of the stripes, and so many of the barcode's as differ. */
static int refine(struct similar_pattern *pattern, int cells)
{
    const struct similar_chain *chain = pattern->chain;
    struct sums sums = { 0 };
    double m[SIMILAR_TERMS], cell[SIMILAR_CELLS + 2];

    for (int k = 0; k <= cells; k++)
        cell[k] = mean(pattern, 1.15 + 0.1 * (double)k) < pattern->threshold ? -1.0 : 1.0;
    /* Hardly any pull to a view without perspective, for marks of a few pixels. */
    sums.a[3][3] = sums.a[4][4] = 0.002;
    for (int64_t y = chain->first; y <= chain->last && y < (int64_t)pattern->luma->height; y += chain->scale) {
        for (int k = FIRST_EDGE; k <= LAST_EDGE; k++) {
            const double *t = similar_edges + k;

            add(pattern, t[0], t[0] - t[1], t[-1] - t[0], y, k % 2 ? -1.0 : 1.0, &sums);
        }
        for (int k = 0; k < cells; k++)
            if (cell[k] != cell[k + 1])
                add(pattern, 1.2 + 0.1 * (double)k, 0.1, 0.1, y, cell[k + 1], &sums);
    }
    if (sums.met < 12 || 2 * sums.met < sums.looked || !solve(sums.a, m) || !sound(m))
        return 0;
    for (int k = 0; k < SIMILAR_TERMS; k++)
        pattern->m[k] = m[k];
    return 1;
}

int similar_fit(const struct marks_luma *luma, const struct similar_chain *chain, struct similar_pattern *pattern)
{
    /* The farther the pattern is known, the farther it can be followed. */
    static const int reaches[ROUNDS] = { 0, 0, 3, 6, SIMILAR_CELLS + 1 };
    int64_t last = chain->last < (int64_t)luma->height ? chain->last : (int64_t)luma->height - 1;

    *pattern = (struct similar_pattern){ .luma = luma, .chain = chain, .y = (double)(chain->first + last) / 2.0 };
    pattern->x = chain->x0 + chain->slope * pattern->y;
    pattern->m[0] = 1.0;
    pattern->m[1] = -chain->slope;
    if (!sound(pattern->m))
        return 0;
    for (int k = 0; k < ROUNDS; k++)
        if (!refine(pattern, reaches[k]) || !levels(pattern))
            return 0;
    return 1;
}
