// sources: ../c_src/blobs.c ../c_src/masks.c ../c_src/masks_avx2.c ../c_src/masks_avx512.c ../c_src/runs.c
// flags: -Drealloc=scarce_realloc
/* The blob finder where memory runs out: at each allocation in turn, and then the same scratch again. */
#undef realloc
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blobs.h"

static int left;                /* how many allocations succeed; below 0: all */

void *scarce_realloc(void *block, size_t size);

void *scarce_realloc(void *block, size_t size)
{
    if (left == 0)
        return NULL;
    left--;
    return realloc(block, size);
}

static void check(int right, const char *what, int k)
{
    if (right)
        return;
    fprintf(stderr, "blobs_memory_test: %s (%d)\n", what, k);
    exit(1);
}

int main(void)
{
    uint32_t width = 64, height = 64, tables[768];
    size_t size = 2 * width * height;
    uint8_t *bytes = malloc(size);
    struct blobs_scratch scratch = { 0 };
    struct blobs_picture picture;
    int needed = 0;

    memset(tables, 0xFF, sizeof tables);
    for (size_t k = 0; k < size; k++)
        bytes[k] = (uint8_t)(k / 2 % width % 2 ^ k / 2 / width % 2);
    tables[1] = 0;
    blobs_lay(BLOBS_YUYV, width, height, bytes, size, &picture);

    /* A chessboard of 2,048 regions: runs and rows, then room for 256, 512, 1,024 and 2,048. */
    for (;; needed++) {
        left = needed;
        if (blobs_find(&picture, tables, 1, 0, &scratch, NULL, NULL) == 0)
            break;
        check(scratch.count == 0, "regions of a picture that failed", needed);
        left = -1;
        check(blobs_find(&picture, tables, 1, 0, &scratch, NULL, NULL) == 0, "no more pictures", needed);
        check(scratch.count == 2048, "another answer after that", needed);
        blobs_release(&scratch);
    }
    check(needed == 6, "another number of allocations", needed);
    check(scratch.count == 2048, "another answer", needed);

    /* Memory that is to become less, and cannot, stays. */
    memset(bytes, 1, size);
    size_t held = blobs_held(&scratch);

    left = 0;
    for (int k = 0; k < 3 * BLOBS_LOOK; k++) {
        check(blobs_find(&picture, tables, 1, 0, &scratch, NULL, NULL) == 0, "memory for less", k);
        check(scratch.count == 0 && blobs_held(&scratch) == held, "memory changed", k);
    }
    left = -1;
    for (int k = 0; k < BLOBS_LOOK; k++)
        blobs_find(&picture, tables, 1, 0, &scratch, NULL, NULL);
    check(blobs_held(&scratch) < held, "nothing given back", 0);
    blobs_release(&scratch);
    free(bytes);
    return 0;
}
