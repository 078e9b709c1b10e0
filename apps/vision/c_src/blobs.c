/* The blob finder: runs of equal masks, joined row by row. Knows nothing of Erlang. */
#include "blobs.h"

#include <stdlib.h>
#include <string.h>

#include "runs.h"

#define LARGEST 32768u          /* pixels per side, so that areas and labels fit into 32 bits */
#define FEWEST 256u             /* regions for which there is room at least */

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

/* The root of a label; halves the path for the next time. */
static uint32_t root(struct blobs_region *regions, uint32_t label)
{
    while (regions[label].parent != label)
        label = regions[label].parent = regions[regions[label].parent].parent;
    return label;
}

/* Joins two regions. */
static uint32_t unite(struct blobs_region *regions, uint32_t a, uint32_t b)
{
    a = root(regions, a);
    b = root(regions, b);
    if (a == b)
        return a;
    if (b < a) {
        uint32_t other = a;

        a = b;
        b = other;
    }
    struct blobs_region *into = regions + a, *from = regions + b;

    from->parent = a;
    into->area += from->area;
    into->sum_x += from->sum_x;
    into->sum_y += from->sum_y;
    if (from->top < into->top || (from->top == into->top && from->first < into->first))
        into->first = from->first;
    into->left = from->left < into->left ? from->left : into->left;
    into->right = from->right > into->right ? from->right : into->right;
    into->top = from->top < into->top ? from->top : into->top;
    into->bottom = from->bottom > into->bottom ? from->bottom : into->bottom;
    return a;
}

/* Adds a run of the lowest row so far, or of the one above it. */
static void add_run(struct blobs_region *region, const struct blobs_run *run, uint32_t row)
{
    uint64_t length = run->end - run->start;

    region->area += (uint32_t)length;
    region->sum_x += length * ((uint64_t)run->start + run->end - 1) / 2;
    region->sum_y += length * row;
    if (row == region->top && run->start < region->first)
        region->first = run->start;
    region->left = run->start < region->left ? run->start : region->left;
    region->right = run->end - 1 > region->right ? run->end - 1 : region->right;
    region->bottom = row > region->bottom ? row : region->bottom;
}

static int set_room(struct blobs_scratch *scratch, size_t room)
{
    struct blobs_region *at = NULL;

    if (room <= SIZE_MAX / sizeof *at)
        at = realloc(scratch->regions, room * sizeof *at);
    if (at == NULL)
        return -1;
    scratch->regions = at;
    scratch->room = room;
    return 0;
}

static int new_region(struct blobs_scratch *scratch, struct blobs_run *run, uint32_t row)
{
    if (scratch->count == scratch->room &&
        set_room(scratch, scratch->room ? 2 * scratch->room : FEWEST) != 0)
        return -1;
    run->label = (uint32_t)scratch->count++;
    scratch->regions[run->label] = (struct blobs_region){
        .mask = run->mask, .left = run->start, .top = row, .first = run->start, .parent = run->label
    };
    add_run(scratch->regions + run->label, run, row);
    return 0;
}

/* A run that has touched nothing is a region if it is large enough. In noise few are. */
static int end_run(struct blobs_scratch *scratch, struct blobs_run *run, uint32_t row, uint32_t min_area)
{
    if (run->label != RUNS_NONE || run->end - run->start < min_area)
        return 0;
    return new_region(scratch, run, row);
}

/* Joins a run to one that it touches in the row above. */
static int join(struct blobs_scratch *scratch, struct blobs_run *above, struct blobs_run *run, uint32_t row)
{
    if (above->label == RUNS_NONE) {
        if (run->label != RUNS_NONE) {
            add_run(scratch->regions + run->label, above, row - 1);
            above->label = run->label;
            return 0;
        }
        if (new_region(scratch, above, row - 1) != 0)
            return -1;
    }
    if (run->label != RUNS_NONE) {
        run->label = unite(scratch->regions, run->label, above->label);
    } else {
        run->label = root(scratch->regions, above->label);
        add_run(scratch->regions + run->label, run, row);
    }
    return 0;
}

/* Gives the runs of a row the regions that they touch above; ends those above that touch nothing. */
static int join_rows(struct blobs_run *above, size_t above_count, struct blobs_run *here,
                     size_t here_count, uint32_t row, uint32_t min_area, struct blobs_scratch *scratch)
{
    size_t first = 0;

    for (struct blobs_run *run = here; run < here + here_count; run++) {
        for (; first < above_count && above[first].end <= run->start; first++)
            if (end_run(scratch, above + first, row - 1, min_area) != 0)
                return -1;
        for (size_t k = first; k < above_count && above[k].start < run->end; k++)
            if (above[k].mask == run->mask && join(scratch, above + k, run, row) != 0)
                return -1;
    }
    for (; first < above_count; first++)
        if (end_run(scratch, above + first, row - 1, min_area) != 0)
            return -1;
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
    return a->first < b->first ? -1 : a->first > b->first;
}

static void keep(struct blobs_scratch *scratch, uint32_t min_area, uint32_t max_area)
{
    size_t kept = 0;

    for (size_t k = 0; k < scratch->count; k++) {
        const struct blobs_region *region = scratch->regions + k;

        if (region->parent == k && region->area >= min_area && (max_area == 0 || region->area <= max_area))
            scratch->regions[kept++] = *region;
    }
    scratch->count = kept;
}

static int make_rows(struct blobs_scratch *scratch, size_t width)
{
    if (scratch->rows && width <= scratch->width)
        return 0;
    struct blobs_run *runs = realloc(scratch->runs, 2 * width * sizeof *runs);

    if (runs == NULL)
        return -1;
    scratch->runs = runs;
    struct runs_rows *rows = runs_room(scratch->rows, width);

    if (rows == NULL)
        return -1;
    scratch->rows = rows;
    scratch->width = width;
    return 0;
}

/* Gives room back that many pictures in a row did not need. A realloc that fails keeps it. */
static void give_back(struct blobs_scratch *scratch)
{
    if (scratch->count > scratch->most)
        scratch->most = scratch->count;
    if (++scratch->pictures < BLOBS_LOOK)
        return;
    size_t room = scratch->most < FEWEST / 2 ? FEWEST : 2 * scratch->most;

    if (room < scratch->room / 2)
        (void)set_room(scratch, room);
    scratch->most = 0;
    scratch->pictures = 0;
}

/* Searches the rows that are left. */
static enum blobs_result find_rows(const struct blobs_picture *picture, uint32_t min_area, struct blobs_scratch *scratch,
                                   blobs_pause *pause, void *context)
{
    size_t width = picture->width, searched = 0, above_count = scratch->above_count;
    uint32_t row = scratch->row;
    enum blobs_result result = BLOBS_DONE;

    for (; result == BLOBS_DONE && row < picture->height; row++, searched += width) {
        if (pause && searched >= BLOBS_STEP) {
            searched = 0;
            if (pause(context)) {
                result = BLOBS_PAUSED;
                break;
            }
        }
        struct blobs_run *here = scratch->runs + row % 2 * width;
        struct blobs_run *above = scratch->runs + (row + 1) % 2 * width;
        size_t here_count = runs_find(scratch->rows, picture, row, min_area, here);

        if (join_rows(above, above_count, here, here_count, row, min_area, scratch) != 0)
            result = BLOBS_MEMORY;
        above_count = here_count;
    }
    /* The lowest row is above an empty one. */
    if (result == BLOBS_DONE &&
        join_rows(scratch->runs + (row + 1) % 2 * width, above_count, scratch->runs, 0, row, min_area, scratch) != 0)
        result = BLOBS_MEMORY;
    scratch->row = row;
    scratch->above_count = above_count;
    return result;
}

enum blobs_result blobs_find(const struct blobs_picture *picture, const uint32_t tables[768],
                             uint32_t min_area, uint32_t max_area, struct blobs_scratch *scratch,
                             blobs_pause *pause, void *context)
{
    enum blobs_result result = BLOBS_DONE;

    if (scratch->stage == BLOBS_IDLE) {
        scratch->count = scratch->above_count = 0;
        scratch->row = 0;
        if (make_rows(scratch, picture->width) != 0)
            return BLOBS_MEMORY;
        runs_begin(scratch->rows, tables);
        scratch->stage = BLOBS_ROWS;
    }
    if (scratch->stage == BLOBS_ROWS) {
        result = find_rows(picture, min_area, scratch, pause, context);
        if (result == BLOBS_PAUSED)
            return result;
        give_back(scratch);
        if (result == BLOBS_DONE)
            keep(scratch, min_area, max_area);
        else
            scratch->count = 0;
        scratch->stage = BLOBS_KEPT;
        if (pause && scratch->count > BLOBS_MANY)
            return BLOBS_PAUSED;
    }
    if (scratch->count > 1)
        qsort(scratch->regions, scratch->count, sizeof *scratch->regions, compare);
    scratch->stage = BLOBS_IDLE;
    return result;
}

void blobs_release(struct blobs_scratch *scratch)
{
    free(scratch->regions);
    free(scratch->runs);
    free(scratch->rows);
    *scratch = (struct blobs_scratch){ 0 };
}

size_t blobs_held(const struct blobs_scratch *scratch)
{
    return scratch->room * sizeof *scratch->regions + scratch->width * 2 * sizeof *scratch->runs +
           (scratch->rows ? runs_bytes(scratch->width) : 0);
}
