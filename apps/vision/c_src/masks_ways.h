/* The ways of `masks_find`, and what they share: each looks at the chroma of pairs of pixels first, and at the luma of pixels
   only where the chroma allows a class. */
#ifndef MASKS_WAYS_H
#define MASKS_WAYS_H

#include <string.h>

#include "masks.h"

void masks_avx2(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row, const struct masks_row *above,
                struct masks_row *here);
void masks_avx512(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                  const struct masks_row *above, struct masks_row *here);

/* The planes in which pixels of a word may differ from those to the left or above, a bit each: none without a class in the word. */
static inline unsigned masks_to_compare(int planes, size_t word, const struct masks_row *above, const struct masks_row *here)
{
    if (planes == 1 || here->on[word] == 0)
        return here->on[word] != 0;
    return (unsigned)(here->planes_on[word] | above->planes_on[word] | (word ? here->planes_on[word - 1] : 0));
}

/* Where the bytes of pixels of a row are, from one of them on. */
struct masks_pixels {
    const uint8_t *y, *u, *v;
};

static inline struct masks_pixels masks_pixels(const struct blobs_picture *picture, uint32_t row)
{
    size_t chroma = row / picture->chroma_rows * picture->chroma_row;

    return (struct masks_pixels){ picture->y + row * picture->y_row, picture->u + chroma, picture->v + chroma };
}

/* Copies the last pixels, with zeros behind them: nothing behind a picture may be read. */
static inline struct masks_pixels masks_last(struct masks_pixels from, size_t left, size_t y_step, size_t step,
                                             uint8_t copy[3][2 * MASKS_LANES])
{
    memset(copy, 0, 3 * 2 * MASKS_LANES);
    memcpy(copy[0], from.y, left * y_step);
    if (y_step == 2)
        return (struct masks_pixels){ copy[0], copy[0] + 1, copy[0] + 3 };
    memcpy(copy[1], from.u, left / 2 * step);
    if (step == 2)
        return (struct masks_pixels){ copy[0], copy[1], copy[1] + 1 };
    memcpy(copy[2], from.v, left / 2);
    return (struct masks_pixels){ copy[0], copy[1], copy[2] };
}

/* Makes a word of a row's planes all 0, if it is not. */
static inline void masks_clear(struct masks_row *here, int planes, size_t word)
{
    if (here->on[word])
        for (int plane = 0; plane < planes; plane++)
            memset(here->planes[plane] + 64 * word, 0, 64);
}

#endif
