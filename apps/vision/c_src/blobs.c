/* The blob finder: runs of equal masks, joined row by row. Knows nothing of Erlang. */
#include "blobs.h"

#include <stdlib.h>
#include <string.h>

#define NONE SIZE_MAX
#define LARGEST 32768u          /* pixels per side, so that areas fit into 32 bits */

struct run {
    uint32_t start, end, mask;  /* end is exclusive */
    size_t label;
};

int blobs_lay(int format, uint32_t width, uint32_t height, const uint8_t *bytes, size_t size,
              struct blobs_picture *picture)
{
    if (width == 0 || height == 0 || width > LARGEST || height > LARGEST || width % 2)
        return -1;
    size_t w = width, pixels = w * height;

    *picture = (struct blobs_picture){ .width = width, .height = height, .y = bytes };
    if (format == BLOBS_YUYV) {
        if (size != 2 * pixels)
            return -1;
        picture->u = bytes + 1;
        picture->v = bytes + 3;
        picture->y_step = 2;
        picture->y_row = picture->chroma_row = 2 * w;
        picture->chroma_step = 4;
        picture->chroma_rows = 1;
        return 0;
    }
    if ((format != BLOBS_I420 && format != BLOBS_NV12) || height % 2 || size != pixels + pixels / 2)
        return -1;
    int planar = format == BLOBS_I420;

    picture->u = bytes + pixels;
    picture->v = planar ? picture->u + pixels / 4 : picture->u + 1;
    picture->y_step = 1;
    picture->y_row = w;
    picture->chroma_step = planar ? 1 : 2;
    picture->chroma_row = planar ? w / 2 : w;
    picture->chroma_rows = 2;
    return 0;
}

/* Finds the classes that the chroma of each pair of pixels allows; returns those of the row. */
static uint32_t allow_chroma(const struct blobs_picture *picture, uint32_t row,
                             const uint32_t *tables, uint32_t *restrict pairs)
{
    size_t step = picture->chroma_step, at = row / picture->chroma_rows * picture->chroma_row;
    const uint8_t *u = picture->u + at, *v = picture->v + at;
    const uint32_t *u_table = tables + 256, *v_table = tables + 512;
    uint32_t any = 0, count = picture->width / 2;

    for (uint32_t k = 0; k < count; k++, u += step, v += step)
        any |= pairs[k] = u_table[*u] & v_table[*v];
    return any;
}

/* Finds the runs of one row, from its pairs and its luma. There are at most `width` of them. */
static inline __attribute__((always_inline)) size_t find_runs_by(size_t step, const uint8_t *luma,
                                                                  uint32_t width,
                                                                  const uint32_t *y_table,
                                                                  const uint32_t *pairs,
                                                                  struct run *runs)
{
    size_t count = 0;
    uint32_t open = 0;

    for (uint32_t x = 0; x < width; x += 2) {
        const uint32_t *pair = pairs + x / 2;

        if (open == 0) {
            /* Most of a picture is background: skips 8 pixels at a time. */
            while (width - x >= 8 && (pair[0] | pair[1] | pair[2] | pair[3]) == 0) {
                x += 8;
                pair += 4;
            }
            if (x == width)
                break;
        }
        uint32_t left = *pair & y_table[luma[x * step]], right = *pair & y_table[luma[(x + 1) * step]];

        if (left != open) {
            if (open)
                runs[count - 1].end = x;
            if (left)
                runs[count++] = (struct run){ .start = x, .mask = left, .label = NONE };
        }
        if (right != left) {
            if (left)
                runs[count - 1].end = x + 1;
            if (right)
                runs[count++] = (struct run){ .start = x + 1, .mask = right, .label = NONE };
        }
        open = right;
    }
    if (open)
        runs[count - 1].end = width;
    return count;
}

static size_t find_runs(const struct blobs_picture *picture, uint32_t row, const uint32_t *y_table,
                        const uint32_t *pairs, struct run *runs)
{
    const uint8_t *luma = picture->y + row * picture->y_row;

    /* Two copies with a constant step are faster than one. */
    return picture->y_step == 1 ? find_runs_by(1, luma, picture->width, y_table, pairs, runs)
                                : find_runs_by(2, luma, picture->width, y_table, pairs, runs);
}

/* The root of a label; halves the path for the next time. */
static size_t root(struct blobs_region *regions, size_t label)
{
    while (regions[label].parent != label)
        label = regions[label].parent = regions[regions[label].parent].parent;
    return label;
}

/* Joins two regions. The older root stays, so roots keep the order of their first pixels. */
static size_t unite(struct blobs_region *regions, size_t a, size_t b)
{
    a = root(regions, a);
    b = root(regions, b);
    if (a == b)
        return a;
    if (b < a) {
        size_t other = a;

        a = b;
        b = other;
    }
    struct blobs_region *into = regions + a, *from = regions + b;

    from->parent = a;
    into->area += from->area;
    into->sum_x += from->sum_x;
    into->sum_y += from->sum_y;
    into->left = from->left < into->left ? from->left : into->left;
    into->right = from->right > into->right ? from->right : into->right;
    into->top = from->top < into->top ? from->top : into->top;
    into->bottom = from->bottom > into->bottom ? from->bottom : into->bottom;
    return a;
}

static void add_run(struct blobs_region *region, const struct run *run, uint32_t row)
{
    uint64_t length = run->end - run->start;

    region->area += (uint32_t)length;
    region->sum_x += length * ((uint64_t)run->start + run->end - 1) / 2;
    region->sum_y += length * row;
    region->left = run->start < region->left ? run->start : region->left;
    region->right = run->end - 1 > region->right ? run->end - 1 : region->right;
    region->bottom = row;
}

static size_t new_region(struct blobs_regions *regions, const struct run *run, uint32_t row)
{
    if (regions->count == regions->room) {
        size_t room = regions->room ? 2 * regions->room : 256;
        struct blobs_region *at = NULL;

        if (room <= SIZE_MAX / sizeof *at)
            at = realloc(regions->at, room * sizeof *at);
        if (at == NULL)
            return NONE;
        regions->at = at;
        regions->room = room;
    }
    regions->at[regions->count] = (struct blobs_region){
        .mask = run->mask, .left = run->start, .top = row, .parent = regions->count
    };
    return regions->count++;
}

/* Gives each run of a row its region: that of the runs that it touches above, or a new one. */
static int join_rows(const struct run *above, size_t above_count, struct run *here, size_t here_count,
                     uint32_t row, struct blobs_regions *regions)
{
    size_t first = 0;

    for (struct run *run = here; run < here + here_count; run++) {
        while (first < above_count && above[first].end <= run->start)
            first++;
        size_t label = NONE;

        for (size_t k = first; k < above_count && above[k].start < run->end; k++) {
            if (above[k].mask != run->mask)
                continue;
            label = label == NONE ? root(regions->at, above[k].label)
                                  : unite(regions->at, label, above[k].label);
        }
        if (label == NONE)
            label = new_region(regions, run, row);
        if (label == NONE)
            return -1;
        run->label = label;
        add_run(regions->at + label, run, row);
    }
    return 0;
}

static int compare(const void *one, const void *two)
{
    const struct blobs_region *a = one, *b = two;
    int class_a = __builtin_ctz(a->mask), class_b = __builtin_ctz(b->mask);

    if (class_a != class_b)
        return class_a < class_b ? -1 : 1;
    if (a->area != b->area)
        return a->area > b->area ? -1 : 1;
    if (a->top != b->top)
        return a->top < b->top ? -1 : 1;
    if (a->left != b->left)
        return a->left < b->left ? -1 : 1;
    return a->parent < b->parent ? -1 : a->parent > b->parent;
}

static void keep_and_sort(struct blobs_regions *regions, uint32_t min_area, uint32_t max_area)
{
    size_t kept = 0;

    for (size_t k = 0; k < regions->count; k++) {
        const struct blobs_region *region = regions->at + k;

        if (region->parent == k && region->area >= min_area && (max_area == 0 || region->area <= max_area))
            regions->at[kept++] = *region;
    }
    regions->count = kept;
    if (kept > 1)
        qsort(regions->at, kept, sizeof *regions->at, compare);
}

int blobs_find(const struct blobs_picture *picture, const uint32_t tables[768], uint32_t min_area,
               uint32_t max_area, struct blobs_regions *found)
{
    size_t width = picture->width, above_count = 0;
    uint32_t *pairs = malloc(width / 2 * sizeof *pairs), any = 0;
    struct run *runs = malloc(2 * width * sizeof *runs), *above = runs, *here = runs + width;
    int result = pairs && runs ? 0 : -1;

    *found = (struct blobs_regions){ 0 };
    for (uint32_t row = 0; result == 0 && row < picture->height; row++) {
        if (row % picture->chroma_rows == 0)
            any = allow_chroma(picture, row, tables, pairs);
        size_t here_count = any ? find_runs(picture, row, tables, pairs, here) : 0;

        result = join_rows(above, above_count, here, here_count, row, found);
        struct run *spent = above;

        above = here;
        above_count = here_count;
        here = spent;
    }
    if (result == 0)
        keep_and_sort(found, min_area, max_area);
    free(pairs);
    free(runs);
    return result;
}
