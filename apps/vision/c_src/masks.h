/* Which pixels of a row are of which classes, as bytes and as bits: by AVX2 or by AVX-512, which give the same. */
#ifndef MASKS_H
#define MASKS_H

#include <stddef.h>
#include <stdint.h>

#include "blobs.h"

/* A mask of 32 classes is kept as up to four bytes, each in a plane of its own. */
#define MASKS_PLANES 4
/* The pixels of a step of the widest way. Planes have so many zeros before them, and room up to a multiple of it. */
#define MASKS_LANES 128

enum masks_way { MASKS_PORTABLE, MASKS_AVX2, MASKS_AVX512, MASKS_WAYS };

/* The tables of a search in the forms that the ways need. */
struct masks_tables {
    uint32_t source[768];       /* masks for Y, U, V */
    int planes;                 /* 0: not made yet */
    enum masks_way way;
    uint8_t bytes[MASKS_PLANES][768];
    /* By the upper and lower half of a value: inside the range; on its first sixteen, and from its beginning on; on its last sixteen,
       and up to its end. */
    uint8_t halves[MASKS_PLANES][3][5][16];
    /* Which planes may have a class in a cell of 16 values of U by 16 of V: a bit each, of U from 128 on in the upper half. */
    uint8_t cells[128];
    /* The same of each plane, and of any, by the upper half of U: a bit for each upper half of V, below 8 and from there on. */
    uint8_t columns[MASKS_PLANES + 1][2][16];
};

/* One row; bit x % 64 of word x / 64 is pixel x, and those behind the last pixel are 0. */
struct masks_row {
    uint8_t *planes[MASKS_PLANES];
    uint64_t *on;               /* of any class */
    uint64_t *left;             /* of the same classes as the pixel to the left, and of any */
    uint64_t *above;            /* as the pixel above */
    uint8_t *planes_on;         /* of each word a bit for each plane that is not all 0 there; needed only of several */
};

/* Allows no better way than this, for tests; the best one that this processor then has. The portable one is that of runs.c. */
enum masks_way masks_limit(enum masks_way most);

/* Makes the tables ready for these masks; costs nothing if they are already. */
void masks_make(struct masks_tables *tables, const uint32_t source[768]);

/* Finds the masks of a row of a picture, if the tables' way is not the portable one. `above` is the row above, or one of zeros. */
void masks_find(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                const struct masks_row *above, struct masks_row *here);

#endif
