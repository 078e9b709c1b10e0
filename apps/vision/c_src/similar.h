/* Self-similar marks with a barcode, in the luma of a picture. Vision.Marks.Similar says what they look like, and
   Vision.Marks.Similar.Reference does the same, operation by operation. */
#ifndef SIMILAR_H
#define SIMILAR_H

#include "marks.h"

/* Calls `report` for each mark; returns -1 without memory. */
int similar_find(const struct marks_luma *luma, marks_report *report, void *context);

/* A line along which origins of patterns lie, in a picture `scale` times as coarse: at x0 + slope * y in pixels of the
   picture, from row `first` to row `last`. The pattern is about `width` pixels wide, its contrast that many grey levels. */
struct similar_chain {
    double x0, slope, width, contrast;
    int64_t first, last, scale;
};

/* The mark whose origins these are; 0 if there is none that can be read. */
int similar_read(const struct marks_luma *luma, const struct similar_chain *chain, struct marks_found *found);

/* Where stripes end, from the right: those of the start bar, and of the stripes. */
enum { SIMILAR_EDGES = 14 };
extern const double similar_edges[SIMILAR_EDGES];

#endif
