#ifndef BLOBS_H
#define BLOBS_H

#include <stddef.h>
#include <stdint.h>

enum blobs_format { BLOBS_YUYV, BLOBS_I420, BLOBS_NV12 };

/* Where the bytes of a picture are. Two neighbours in a row share their chroma. */
struct blobs_picture {
    uint32_t width, height;
    const uint8_t *y, *u, *v;
    size_t y_step, y_row;       /* bytes from pixel to pixel, from row to row */
    size_t chroma_step, chroma_row;
    uint32_t chroma_rows;       /* picture rows that share one row of chroma */
};

struct blobs_region {
    uint32_t mask, area;
    uint32_t left, top, right, bottom; /* right and bottom: the last ones inside */
    uint64_t sum_x, sum_y;
    size_t parent;              /* a root has itself; in the result: the order of discovery */
};

struct blobs_regions {
    struct blobs_region *at;
    size_t count, room;
};

/* Lays a picture over bytes; 0, or -1 if format, sizes and byte count do not fit together. */
int blobs_lay(int format, uint32_t width, uint32_t height, const uint8_t *bytes, size_t size,
              struct blobs_picture *picture);

/* Finds the regions, in the order of the backends; tables are 256 masks each for Y, U and V.
   max_area 0 means no limit. Returns 0, or -1 if memory ran out; the caller frees found->at in
   both cases. */
int blobs_find(const struct blobs_picture *picture, const uint32_t tables[768], uint32_t min_area,
               uint32_t max_area, struct blobs_regions *found);

#endif
