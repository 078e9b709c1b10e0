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
    uint32_t first;             /* where its first pixel is in its top row */
    uint32_t parent;            /* a root has itself */
    uint64_t sum_x, sum_y;
};

/* Memory that is used again for each picture. All zero is an empty one; `blobs_release` frees it.
   The regions lie in it until the next picture. */
struct blobs_scratch {
    struct blobs_region *regions;
    size_t count, room;         /* how many there are, and how many fit */
    size_t most;                /* the most since the room was last looked at */
    uint32_t pictures;          /* how many pictures that was */
    struct blobs_run *runs;     /* of two rows: the one above, and the one that is searched */
    struct runs_rows *rows;     /* what finds them */
    size_t width;               /* the widest row that fits into runs and rows */
    /* How far the search is, if it was paused. */
    enum { BLOBS_IDLE, BLOBS_ROWS, BLOBS_KEPT } stage;
    uint32_t row;
    size_t above_count;
};

/* Lays a picture over bytes; 0, or -1 if format, sizes and byte count do not fit together. */
int blobs_lay(int format, uint32_t width, uint32_t height, const uint8_t *bytes, size_t size,
              struct blobs_picture *picture);

/* Whether to pause; asked about each BLOBS_STEP pixels. */
typedef int blobs_pause(void *context);

#define BLOBS_STEP 16384u
#define BLOBS_MANY 512u

enum blobs_result { BLOBS_DONE, BLOBS_PAUSED, BLOBS_MEMORY };

/* Finds the regions, in the order of the backends; tables are 256 masks each for Y, U and V.
   max_area 0 means no limit. If memory ran out, the scratch can be used for the next picture all
   the same.

   With `pause` it may be paused, and is before it sorts more than BLOBS_MANY regions; the next call
   with the same arguments then goes on, and `pause` may be another. NULL never pauses.

   The scratch grows with the pictures. Of each BLOBS_LOOK pictures in a row that needed less than a
   quarter of its room for regions, it keeps twice what they needed; rows are kept for the widest
   picture, which is a megabyte at most. */
#define BLOBS_LOOK 64
enum blobs_result blobs_find(const struct blobs_picture *picture, const uint32_t tables[768],
                             uint32_t min_area, uint32_t max_area, struct blobs_scratch *scratch,
                             blobs_pause *pause, void *context);

/* Frees what the scratch holds, and leaves it empty. */
void blobs_release(struct blobs_scratch *scratch);

/* The bytes that it holds. */
size_t blobs_held(const struct blobs_scratch *scratch);

#endif
