/* Two ways to the runs of a row: pixel by pixel, and from the bits of masks.c. */
#include "runs.h"

#include <stdlib.h>
#include <string.h>

#include "masks.h"

/* Inlined into one loop over the rows they are slower by a quarter: there are not enough registers. */
#define NOINLINE __attribute__((noinline))

struct runs_rows {
    struct masks_tables tables;
    size_t width;
    uint32_t any;               /* of the pairs */
    uint32_t *pairs;            /* pixel by pixel: the masks that the chroma of each pair allows */
    struct masks_row in_turn[3]; /* by bits */
    /* Of both, from the first whole vector on; of a row its planes, then its words and their planes. */
    uint8_t room[];
};

static size_t lanes(size_t width)
{
    return (width + MASKS_LANES - 1) / MASKS_LANES * MASKS_LANES;
}

static size_t row_bytes(size_t width)
{
    return (MASKS_PLANES * (MASKS_LANES + lanes(width)) + 3 * lanes(width) / 8 + lanes(width) / 64 + MASKS_LANES - 1) / MASKS_LANES * MASKS_LANES;
}

size_t runs_bytes(size_t width)
{
    return sizeof(struct runs_rows) + MASKS_LANES + 3 * row_bytes(width);
}

static void lay_rows(struct runs_rows *rows)
{
    uint8_t *begin = rows->room + (MASKS_LANES - (uintptr_t)rows->room % MASKS_LANES);
    size_t words = lanes(rows->width) / 64;

    rows->pairs = (uint32_t *)begin;
    for (int k = 0; k < 3; k++) {
        struct masks_row *row = rows->in_turn + k;
        uint8_t *at = begin + k * row_bytes(rows->width);

        for (int plane = 0; plane < MASKS_PLANES; plane++, at += MASKS_LANES + lanes(rows->width))
            row->planes[plane] = at + MASKS_LANES;
        row->on = (uint64_t *)at;
        row->left = row->on + words;
        row->above = row->left + words;
        row->planes_on = (uint8_t *)(row->above + words);
    }
}

struct runs_rows *runs_room(struct runs_rows *rows, size_t width)
{
    struct runs_rows *grown = realloc(rows, runs_bytes(width));

    if (grown == NULL)
        return NULL;
    memset(grown, 0, runs_bytes(width));
    grown->width = width;
    lay_rows(grown);
    return grown;
}

void runs_begin(struct runs_rows *rows, const uint32_t tables[768])
{
    masks_make(&rows->tables, tables);
    rows->any = 0;
    /* There are no classes above the first row, nor before the first pixels. */
    memset(rows->room, 0, MASKS_LANES + 3 * row_bytes(rows->width));
}

/* --- pixel by pixel --------------------------------------------------------------------------------------------------------- */

/* Finds the classes that the chroma of each pair of pixels allows; returns those of the row. */
static NOINLINE uint32_t allow_chroma(const struct blobs_picture *picture, uint32_t row, const uint32_t *tables,
                                      uint32_t *restrict pairs)
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
                                                                  struct blobs_run *runs)
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
                runs[count++] = (struct blobs_run){ .start = x, .mask = left, .label = RUNS_NONE };
        }
        if (right != left) {
            if (left)
                runs[count - 1].end = x + 1;
            if (right)
                runs[count++] = (struct blobs_run){ .start = x + 1, .mask = right, .label = RUNS_NONE };
        }
        open = right;
    }
    if (open)
        runs[count - 1].end = width;
    return count;
}

static NOINLINE size_t find_portable(const struct blobs_picture *picture, uint32_t row, const uint32_t *y_table,
                                     const uint32_t *pairs, struct blobs_run *runs)
{
    const uint8_t *luma = picture->y + row * picture->y_row;

    /* Two copies with a constant step are faster than one. */
    return picture->y_step == 1 ? find_runs_by(1, luma, picture->width, y_table, pairs, runs)
                                : find_runs_by(2, luma, picture->width, y_table, pairs, runs);
}

static size_t portable(struct runs_rows *rows, const struct blobs_picture *picture, uint32_t row, struct blobs_run *runs)
{
    if (row % picture->chroma_rows == 0)
        rows->any = allow_chroma(picture, row, rows->tables.source, rows->pairs);
    return rows->any ? find_portable(picture, row, rows->tables.source, rows->pairs, runs) : 0;
}

/* --- by bits ---------------------------------------------------------------------------------------------------------------- */

static uint32_t mask_at(const struct masks_row *row, int planes, size_t x)
{
    uint32_t mask = 0;

    for (int k = 0; k < planes; k++)
        mask |= (uint32_t)row->planes[k][x] << 8 * k;
    return mask;
}

/* The bits of a word moved up by n, with those that come from the word before. */
static inline uint64_t up(uint64_t word, uint64_t before, unsigned n)
{
    return word << n | before >> (64 - n);
}

/* Pixels of runs that are as long as `min_area`, or as 8, 4 or 2 pixels where that is less; `before` is kept from word to word. */
static inline uint64_t long_runs(uint64_t on, uint64_t left, uint32_t min_area, uint64_t before[3])
{
    if (min_area < 2)
        return on;
    uint64_t three = left & up(left, before[0], 1);                         /* from 3 pixels on */
    uint64_t four = three & up(left, before[0], 2), five = three & up(three, before[1], 2);
    uint64_t eight = five & up(five, before[2], 3);

    before[0] = left;
    before[1] = three;
    before[2] = five;
    return min_area < 4 ? left : min_area < 8 ? four : eight;
}

/* Finds the runs of a row that are long or touch one above or below; the others cannot be part of any region that is kept. Goes
   from each such pixel to the right by the carry of an addition: R. Cameron et al., "Bitwise data parallelism in regular expression
   matching", 2014. There are at most `width` of them. */
static NOINLINE size_t find_by_bits(const struct masks_row *here, const uint64_t *below, int planes, size_t words,
                                    uint32_t min_area, struct blobs_run *runs)
{
    uint64_t before[3] = { 0 }, seeds_before = 0, carry = 0;
    size_t count = 0;

    for (size_t word = 0; word < words; word++) {
        uint64_t on = here->on[word], left = here->left[word];

        if (on == 0) {
            before[0] = before[1] = before[2] = seeds_before = carry = 0;
            continue;
        }
        uint64_t seeds = here->above[word] | below[word] | long_runs(on, left, min_area, before);
        uint64_t from = up(seeds, seeds_before, 1), sum;
        uint64_t over = __builtin_add_overflow(from & left, left, &sum);

        over |= __builtin_add_overflow(sum, carry, &sum);
        carry = over;
        seeds_before = seeds;
        uint64_t next = word + 1 < words ? here->left[word + 1] : 0;
        uint64_t reached = seeds | (((sum ^ left) | from) & left);
        uint64_t ends = on & ~(left >> 1 | next << 63) & reached;

        for (; ends; ends &= ends - 1) {
            unsigned bit = (unsigned)__builtin_ctzll(ends);
            size_t at = word;
            uint64_t starts = on & ~left & (UINT64_MAX >> (63 - bit));

            while (starts == 0) {
                at--;
                starts = here->on[at] & ~here->left[at];
            }
            uint32_t start = (uint32_t)(64 * at + 63 - (unsigned)__builtin_clzll(starts));

            runs[count++] = (struct blobs_run){ .start = start, .end = (uint32_t)(64 * word + bit + 1),
                                                .mask = mask_at(here, planes, start), .label = RUNS_NONE };
        }
    }
    return count;
}

/* The row below is needed, too. */
static size_t by_bits(struct runs_rows *rows, const struct blobs_picture *picture, uint32_t row, uint32_t min_area,
                      struct blobs_run *runs)
{
    struct masks_row *here = rows->in_turn + row % 3, *below = rows->in_turn + (row + 1) % 3;
    size_t words = (picture->width + 63) / 64;

    if (row == 0)
        masks_find(&rows->tables, picture, 0, rows->in_turn + 2, here);
    if (row + 1 < picture->height)
        masks_find(&rows->tables, picture, row + 1, here, below);
    else
        memset(below->above, 0, words * sizeof *below->above);
    return find_by_bits(here, below->above, rows->tables.planes, words, min_area, runs);
}

size_t runs_find(struct runs_rows *rows, const struct blobs_picture *picture, uint32_t row, uint32_t min_area,
                 struct blobs_run *runs)
{
    return rows->tables.way == MASKS_PORTABLE ? portable(rows, picture, row, runs)
                                              : by_bits(rows, picture, row, min_area, runs);
}
