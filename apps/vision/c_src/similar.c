/* Finds where self-similar patterns begin: a score for each pixel of each band of rows, its maxima, and lines of them. */
#include <math.h>
#include <stdlib.h>

#include "similar.h"

/* The score compares so many pixels to the right of a place. A picture is looked at in coarser and coarser copies, each
   half as wide and high, so that patterns of WINDOW to 2 * WINDOW pixels are enough. */
enum { WINDOW = 24, BAND = 4, LEAST_CONTRAST = 40, GAP = 2, ASIDE = 2, LEAST_BANDS = 4 };
/* What a line of origins shows to the right of it, and how wide the pattern there can be, in half pixels. */
enum { PROFILE = 64, NARROWEST = 36, WIDEST = 104, SHIFT = 2 };

const double similar_edges[SIMILAR_EDGES] = {
    1.2, 1.1, 1.0, 0.816496580927726, 0.6666666666666666, 0.5443310539518174, 0.4444444444444445, 0.36288736930121157,
    0.2962962962962963, 0.2419249128674744, 0.19753086419753088, 0.16128327524498293, 0.13168724279835392,
    0.10752218349665528,
};

/* The sums of BAND rows, 0 to 1020; of coarser ones the means of four of the finer. */
struct bands {
    int64_t width, height, scale;
    uint16_t *sums;
};

struct peak {
    int64_t band, x, before;    /* the peak before it in its chain, or -1 */
    int64_t count;
};

struct peaks {
    struct peak *all;
    size_t count, room;
};

static int first_bands(const struct marks_luma *luma, struct bands *bands)
{
    *bands = (struct bands){ luma->width, luma->height / BAND, 1, NULL };
    bands->sums = malloc((size_t)(bands->width * bands->height) * sizeof *bands->sums + 1);
    if (bands->sums == NULL)
        return -1;
    for (int64_t r = 0; r < bands->height; r++)
        for (int64_t x = 0; x < bands->width; x++) {
            const uint8_t *pixel = luma->first + (size_t)(r * BAND) * luma->row + (size_t)x * luma->step;
            unsigned sum = 0;

            for (int k = 0; k < BAND; k++, pixel += luma->row)
                sum += *pixel;
            bands->sums[r * bands->width + x] = (uint16_t)sum;
        }
    return 0;
}

/* In place: what is written was read before. */
static void halve(struct bands *bands)
{
    const int64_t width = bands->width / 2, height = bands->height / 2;

    for (int64_t r = 0; r < height; r++)
        for (int64_t x = 0; x < width; x++) {
            const uint16_t *from = bands->sums + 2 * r * bands->width + 2 * x;

            bands->sums[r * width + x] =
                (uint16_t)((from[0] + from[1] + from[bands->width] + from[bands->width + 1] + 2) >> 2);
        }
    bands->width = width;
    bands->height = height;
    bands->scale *= 2;
}

/* The sum over k of |I(x + k) - I(x + sqrt(2/3) k)| - |I(x + k) - I(x + 2/3 k)|, in 256ths of a sum. */
static void score(const uint16_t *restrict band, int64_t count, int32_t *restrict scores)
{
    for (int64_t x = 0; x < count; x++)
        scores[x] = 0;
    for (int32_t k = 1; k <= WINDOW; k++) {
        const int32_t turned = (k * 13698540 + 32768) >> 16, same = (k * 512 + 1) / 3;
        const uint16_t *restrict here = band + k, *restrict a = band + (turned >> 8), *restrict b = band + (same >> 8);
        const int32_t ta = turned & 255, tb = same & 255;

        for (int64_t x = 0; x < count; x++) {
            int32_t value = here[x] << 8;

            scores[x] += abs(value - (a[x] * (256 - ta) + a[x + 1] * ta)) -
                         abs(value - (b[x] * (256 - tb) + b[x + 1] * tb));
        }
    }
}

static int peak_at(const uint16_t *band, const int32_t *scores, int64_t count, int64_t x)
{
    uint16_t least = band[x], most = band[x];

    for (int64_t k = 1; k <= 3; k++)
        if ((x >= k && scores[x - k] >= scores[x]) || (x + k < count && scores[x + k] > scores[x]))
            return 0;
    for (int64_t k = 1; k <= WINDOW; k++) {
        least = band[x + k] < least ? band[x + k] : least;
        most = band[x + k] > most ? band[x + k] : most;
    }
    /* A fifth of what a pattern with the same contrast can have. */
    return most - least >= LEAST_CONTRAST && scores[x] * 5 >= (most - least) * 256 * WINDOW;
}

static int put_peak(struct peaks *peaks, struct peak peak)
{
    if (peaks->count == peaks->room) {
        size_t room = 2 * peaks->room + 256;
        struct peak *all = realloc(peaks->all, room * sizeof *all);

        if (all == NULL)
            return -1;
        peaks->all = all;
        peaks->room = room;
    }
    peaks->all[peaks->count++] = peak;
    return 0;
}

/* The peaks of a band, each at the end of the nearest chain that ends in one of the bands above; open: where chains end. */
static int link(struct peaks *peaks, int64_t *open, size_t *ends, int64_t r, int64_t x)
{
    size_t best = *ends;
    int64_t near = ASIDE + 1;

    for (size_t k = 0; k < *ends; k++) {
        const struct peak *end = peaks->all + open[k];
        int64_t off = llabs(end->x - x);

        if (end->band < r && off < near) {
            near = off;
            best = k;
        }
    }
    struct peak peak = { r, x, best < *ends ? open[best] : -1, 1 };

    if (best < *ends)
        peak.count += peaks->all[open[best]].count;
    if (put_peak(peaks, peak) != 0)
        return -1;
    open[best] = (int64_t)peaks->count - 1;
    *ends += best == *ends;
    return 0;
}

static double between(const uint16_t *row, int64_t width, double x)
{
    if (x <= 0.0)
        return row[0];
    if (x >= (double)(width - 1))
        return row[width - 1];
    int64_t k = (int64_t)x;
    double part = x - (double)k;

    return (1.0 - part) * row[k] + part * row[k + 1];
}

/* Black is -1, white 1. */
static double stripe(double t)
{
    int k = 1;

    while (t < similar_edges[k])
        k++;
    return k % 2 ? -1.0 : 1.0;
}

/* How well a pattern of this width, which begins so far to the right, fits. */
static double fit(const double *profile, double width, int64_t shift)
{
    double both = 0.0, signs = 0.0, values = 0.0, n = 0.0;

    for (int64_t u = 0; u < PROFILE; u++) {
        double t = (double)(u - shift) / width;

        if (t < 0.2 || t > 1.15)
            continue;
        double sign = stripe(t);

        both += sign * profile[u];
        signs += sign;
        values += profile[u];
        n += 1.0;
    }
    return (both - signs * values / n) / n;
}

/* The line of a chain, and what its pattern is like; 0 if it is none. */
static int measure(const struct bands *bands, const struct peaks *peaks, int64_t end, struct similar_chain *chain)
{
    int64_t n = 0, sr = 0, sx = 0, srr = 0, srx = 0, first = 0, last = peaks->all[end].band;

    for (int64_t k = end; k >= 0; k = peaks->all[k].before) {
        int64_t r = peaks->all[k].band, x = peaks->all[k].x;

        n++, sr += r, sx += x, srr += r * r, srx += r * x, first = r;
    }
    double slope = (double)(n * srx - sr * sx) / (double)(n * srr - sr * sr);
    double x0 = ((double)sx - slope * (double)sr) / (double)n, off = 0.0;

    for (int64_t k = end; k >= 0; k = peaks->all[k].before) {
        double d = (double)peaks->all[k].x - (x0 + slope * (double)peaks->all[k].band);

        off += d * d;
    }
    if (off > 2.25 * (double)n)
        return 0;

    double profile[PROFILE], least = 0.0, most = 0.0, best = -1.0e9, width = 0.0;
    int64_t shift = 0;

    for (int64_t u = 0; u < PROFILE; u++) {
        profile[u] = 0.0;
        for (int64_t r = first; r <= last; r++)
            profile[u] += between(bands->sums + r * bands->width, bands->width, x0 + slope * (double)r + (double)u);
    }
    for (int64_t half = NARROWEST; half <= WIDEST; half++)
        for (int64_t aside = -SHIFT; aside <= SHIFT; aside++) {
            double fits = fit(profile, (double)half / 2.0, aside);

            if (fits > best) {
                best = fits;
                width = (double)half / 2.0;
                shift = aside;
            }
        }
    least = most = profile[0];
    for (int64_t u = 1; u < PROFILE && (double)u < 1.2 * width; u++) {
        least = profile[u] < least ? profile[u] : least;
        most = profile[u] > most ? profile[u] : most;
    }
    double scale = (double)bands->scale;
    double from = x0 + (double)shift + slope * (0.125 / scale - 0.5);

    *chain = (struct similar_chain){ .x0 = (from + 0.5) * scale - 0.5, .slope = slope / 4.0, .width = width * scale,
                                     .contrast = (most - least) / (double)(4 * (last - first + 1)),
                                     .first = first * BAND * bands->scale,
                                     .last = (last + 1) * BAND * bands->scale - 1, .scale = bands->scale };
    return 1;
}

struct search {
    const struct marks_luma *luma;
    struct marks_found *found;
    size_t count, room;
};

/* Coarser copies show some marks again. */
static int put_mark(struct search *search, struct marks_found mark)
{
    for (size_t k = 0; k < search->count; k++) {
        const struct marks_found *other = search->found + k;
        double dx = other->x - mark.x, dy = other->y - mark.y, wide = other->corners[1][0] - other->corners[0][0];

        if (dx * dx + dy * dy < wide * wide / 4.0)
            return 0;
    }
    if (search->count == search->room) {
        size_t room = 2 * search->room + 16;
        struct marks_found *found = realloc(search->found, room * sizeof *found);

        if (found == NULL)
            return -1;
        search->found = found;
        search->room = room;
    }
    search->found[search->count++] = mark;
    return 0;
}

/* `open` and `scores` have room for a row. */
static int search_bands(const struct bands *bands, struct search *search, struct peaks *peaks, int64_t *open,
                        int32_t *scores)
{
    const int64_t count = bands->width - WINDOW - 1;
    size_t ends = 0;

    peaks->count = 0;
    for (int64_t r = 0; r < bands->height; r++) {
        const uint16_t *band = bands->sums + r * bands->width;
        size_t kept = 0;

        for (size_t k = 0; k < ends; k++)
            if (peaks->all[open[k]].band >= r - GAP)
                open[kept++] = open[k];
        ends = kept;
        score(band, count, scores);
        for (int64_t x = 0; x < count; x++)
            if (peak_at(band, scores, count, x) && link(peaks, open, &ends, r, x) != 0)
                return -1;
    }
    /* The ends of chains are the peaks that are before no other. */
    for (size_t k = 0; k < peaks->count; k++)
        if (peaks->all[k].before >= 0)
            peaks->all[peaks->all[k].before].count = 0;
    for (size_t k = 0; k < peaks->count; k++) {
        struct similar_chain chain;
        struct marks_found mark;

        if (peaks->all[k].count >= LEAST_BANDS && measure(bands, peaks, (int64_t)k, &chain) &&
            similar_read(search->luma, &chain, &mark) && put_mark(search, mark) != 0)
            return -1;
    }
    return 0;
}

int similar_find(const struct marks_luma *luma, marks_report *report, void *context)
{
    struct search search = { luma, NULL, 0, 0 };
    struct peaks peaks = { NULL, 0, 0 };
    struct bands bands;
    /* Of chains that are open at a time each has another peak in one of three bands. */
    int64_t *open = malloc(3 * (size_t)luma->width * sizeof *open);
    int32_t *scores = malloc((size_t)luma->width * sizeof *scores);
    int result = open == NULL || scores == NULL || first_bands(luma, &bands) != 0 ? -1 : 0;

    if (result == 0) {
        for (; result == 0 && bands.width > WINDOW + 1 && bands.height >= LEAST_BANDS; halve(&bands))
            result = search_bands(&bands, &search, &peaks, open, scores);
        free(bands.sums);
    }
    for (size_t k = 0; result == 0 && k < search.count; k++)
        report(search.found + k, context);
    free(search.found);
    free(peaks.all);
    free(scores);
    free(open);
    return result;
}
