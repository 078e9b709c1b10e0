// sources: ../c_src/blobs.c ../c_src/masks.c ../c_src/masks_avx2.c ../c_src/masks_avx512.c ../c_src/runs.c
/* Random pictures of all sizes through the blob finder, one after the other in the same scratch, each
   compared with a flood fill, under sanitizers. The bytes are in blocks of exactly their size, so that
   a read beyond them is seen. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blobs.h"
#include "masks.h"

static uint32_t seed = 1;

static uint32_t random_below(uint32_t n)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % n;
}

static void fail(const char *what)
{
    fprintf(stderr, "blobs_test: %s (seed %u)\n", what, seed);
    exit(1);
}

static uint32_t mask_at(const struct blobs_picture *p, const uint32_t *tables, uint32_t x, uint32_t y)
{
    size_t chroma = y / p->chroma_rows * p->chroma_row + x / 2 * p->chroma_step;

    return tables[p->y[y * p->y_row + x * p->y_step]] & tables[256 + p->u[chroma]] &
           tables[512 + p->v[chroma]];
}

/* The regions of at least min_area by flooding: their number, pixels, and sum of x + y. */
static void flood(const struct blobs_picture *p, const uint32_t *tables, uint32_t min_area,
                  uint64_t totals[3])
{
    uint32_t w = p->width, h = p->height, *masks = malloc((size_t)w * h * 4);
    uint32_t *open = malloc((size_t)w * h * 4);

    memset(totals, 0, 3 * sizeof *totals);
    for (uint32_t k = 0; k < w * h; k++)
        masks[k] = mask_at(p, tables, k % w, k / w);
    for (uint32_t k = 0; k < w * h; k++) {
        uint32_t mask = masks[k], count = 0, area = 0;
        uint64_t sum = 0;

        if (mask == 0)
            continue;
        masks[k] = 0;
        open[count++] = k;
        while (count > 0) {
            uint32_t at = open[--count], x = at % w, y = at / w;

            area++;
            sum += x + y;
            if (x > 0 && masks[at - 1] == mask)
                masks[at - 1] = 0, open[count++] = at - 1;
            if (x + 1 < w && masks[at + 1] == mask)
                masks[at + 1] = 0, open[count++] = at + 1;
            if (y > 0 && masks[at - w] == mask)
                masks[at - w] = 0, open[count++] = at - w;
            if (y + 1 < h && masks[at + w] == mask)
                masks[at + w] = 0, open[count++] = at + w;
        }
        if (area >= min_area)
            totals[0]++, totals[1] += area, totals[2] += sum;
    }
    free(masks);
    free(open);
}

/* Up to 32 classes that are ranges, as those of people are: wide ones, or narrow ones that leave most of a picture to none. Some
   take a whole axis, some are empty. */
static void make_ranges(uint32_t tables[768])
{
    uint32_t classes = random_below(2) ? 1 + random_below(8) : 9 + random_below(24);
    uint32_t widest = random_below(2) ? 256 : 1 + random_below(48);

    memset(tables, 0, 768 * sizeof *tables);
    for (uint32_t bit = 0; bit < classes; bit++)
        for (uint32_t channel = 0; channel < 3; channel++) {
            uint32_t first = random_below(256), last = first + random_below(256 - first < widest ? 256 - first : widest);

            if (random_below(16) == 0)
                continue;
            if (random_below(channel ? 32 : 4) == 0)
                first = 0, last = 255;
            for (uint32_t k = first; k <= last; k++)
                tables[256 * channel + k] |= 1u << bit;
        }
}

static struct blobs_scratch scratch;

static int sometimes(void *context)
{
    (void)context;
    return random_below(3) == 0;
}

static void one_picture(int format, uint32_t width, uint32_t height, uint32_t levels)
{
    size_t size = format == BLOBS_YUYV ? 2u * width * height : 3u * width * height / 2;
    uint8_t *bytes = malloc(size);
    uint32_t tables[768], min_area = 1 + random_below(5);
    struct blobs_picture picture;
    uint64_t totals[3], sums[3] = { 0 };

    for (size_t k = 0; k < size; k++)
        bytes[k] = (uint8_t)random_below(levels);
    for (int k = 0; k < 768; k++)
        tables[k] = random_below(4) ? 1u << random_below(32) | random_below(8) : 0xFFFFFFFF;
    if (random_below(2))
        make_ranges(tables);
    if (blobs_lay(format, width, height, bytes, size, &picture) != 0)
        fail("a right size was refused");
    if (blobs_lay(format, width, height, bytes, size - 1, &picture) == 0 ||
        blobs_lay(format, width + 1, height, bytes, size, &picture) == 0)
        fail("a wrong size was taken");
    blobs_lay(format, width, height, bytes, size, &picture);
    if (blobs_find(&picture, tables, min_area, 0, &scratch, NULL, NULL) != 0)
        fail("no memory");
    flood(&picture, tables, min_area, totals);
    for (size_t k = 0; k < scratch.count; k++) {
        struct blobs_region *r = scratch.regions + k;

        if (r->left > r->right || r->right >= width || r->top > r->bottom || r->bottom >= height)
            fail("a box lies outside");
        if (k > 0 && __builtin_ctz(r[-1].mask) > __builtin_ctz(r->mask))
            fail("out of order");
        sums[0]++;
        sums[1] += r->area;
        sums[2] += r->sum_x + r->sum_y;
    }
    if (memcmp(sums, totals, sizeof sums) != 0)
        fail("not what the flood found");
    /* In memory that nobody used before, and with pauses, it finds the same. */
    struct blobs_scratch fresh = { 0 };
    enum blobs_result result;

    do
        result = blobs_find(&picture, tables, min_area, 0, &fresh, sometimes, NULL);
    while (result == BLOBS_PAUSED);
    if (result != BLOBS_DONE || fresh.count != scratch.count)
        fail("not the same in fresh memory");
    for (size_t k = 0; k < fresh.count; k++)
        if (memcmp(fresh.regions + k, scratch.regions + k, sizeof *fresh.regions) != 0)
            fail("not the same in fresh memory");
    blobs_release(&fresh);
    free(bytes);
}

/* A frame of noise makes the scratch grow; when the noise is over, it becomes small again. */
static void memory_over_time(void)
{
    uint32_t width = 640, height = 480, size = 2 * width * height, tables[768];
    uint8_t *noise = malloc(size), *calm = calloc(size, 1);
    struct blobs_scratch own = { 0 };
    struct blobs_picture picture;

    for (uint32_t k = 0; k < 768; k++)
        tables[k] = k < 256 ? k & 3 : 0xFF;
    for (uint32_t k = 0; k < size; k++)
        noise[k] = (uint8_t)random_below(251);
    blobs_lay(BLOBS_YUYV, width, height, calm, size, &picture);
    blobs_find(&picture, tables, 20, 0, &own, NULL, NULL);
    size_t small = blobs_held(&own);

    blobs_lay(BLOBS_YUYV, width, height, noise, size, &picture);
    blobs_find(&picture, tables, 20, 0, &own, NULL, NULL);
    size_t large = blobs_held(&own);
    struct blobs_region *at = own.regions;

    for (uint32_t k = 0; k < 3 * BLOBS_LOOK; k++)
        blobs_find(&picture, tables, 20, 0, &own, NULL, NULL);
    if (large < 10 * small || large > (size_t)width * height * sizeof *at)
        fail("noise holds more or less than it needs");
    if (blobs_held(&own) != large || own.regions != at)
        fail("memory moves from picture to picture");

    blobs_lay(BLOBS_YUYV, width, height, calm, size, &picture);
    for (uint32_t k = 0; k < 2 * BLOBS_LOOK; k++)
        blobs_find(&picture, tables, 20, 0, &own, NULL, NULL);
    if (blobs_held(&own) != small + 256 * sizeof *at)
        fail("memory is not given back after the noise");
    blobs_release(&own);
    blobs_release(&own);
    if (blobs_held(&own) != 0)
        fail("an empty scratch holds memory");
    free(noise);
    free(calm);
}

int main(void)
{
    for (int way = MASKS_PORTABLE; way < MASKS_WAYS; way++) {
        if (masks_limit((enum masks_way)way) != (enum masks_way)way)
            continue;
        for (int k = 0; k < 3000; k++) {
            int format = k % 3;
            uint32_t width = 2 * (1 + random_below(k % 5 ? 40 : 160)), height = 1 + random_below(30);

            one_picture(format, width, format == BLOBS_YUYV ? height : 2 * height,
                        k % 2 ? 256 : 1 + random_below(3));
        }
        one_picture(BLOBS_YUYV, 640, 480, 2);
        one_picture(BLOBS_I420, 640, 480, 256);
        one_picture(BLOBS_NV12, 2, 2, 256);
        one_picture(BLOBS_YUYV, 32768, 4, 256);
        memory_over_time();
    }
    blobs_release(&scratch);
    return 0;
}
