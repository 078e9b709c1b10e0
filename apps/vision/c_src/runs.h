/* The runs of equal masks of a row. */
#ifndef RUNS_H
#define RUNS_H

#include "blobs.h"

#define RUNS_NONE UINT32_MAX

struct blobs_run {
    uint32_t start, end, mask;  /* end is exclusive */
    uint32_t label;             /* RUNS_NONE in a new one */
};

/* What is kept of the rows of a picture. */
struct runs_rows;

/* Room for rows of `width` pixels, in place of what there was (NULL: nothing); NULL without memory, and what there was stays. `free`
   frees it. */
struct runs_rows *runs_room(struct runs_rows *rows, size_t width);
size_t runs_bytes(size_t width);

/* Begins a picture; tables are 256 masks each for Y, U and V. */
void runs_begin(struct runs_rows *rows, const uint32_t tables[768]);

/* Finds the runs of a row, from left to right, of the rows from the first to the last in turn. There are at most `width` of them.
   Runs that cannot be part of a region of `min_area` pixels may be left out. */
size_t runs_find(struct runs_rows *rows, const struct blobs_picture *picture, uint32_t row, uint32_t min_area,
                 struct blobs_run *runs);

#endif
