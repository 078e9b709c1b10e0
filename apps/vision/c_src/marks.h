/* AprilTags in the luma of a picture, by Debian's libapriltag. */
#ifndef MARKS_H
#define MARKS_H

#include <stddef.h>
#include <stdint.h>

enum marks_family { MARKS_36H11, MARKS_STANDARD_41H12, MARKS_FAMILIES };

/* The library reads tiles of 4 x 4 pixels, and counts columns and rows in 15 bits. */
#define MARKS_LEAST 16
#define MARKS_MOST 32767
/* The widest picture of a mark of these families, in cells. */
#define MARKS_CELLS 16

/* One byte of luma for each pixel of a box of a picture. */
struct marks_luma {
    const uint8_t *first;       /* of the box's upper left pixel */
    size_t step, row;           /* bytes from pixel to pixel, from row to row */
    uint32_t width, height;     /* of the box: MARKS_LEAST to MARKS_MOST */
};

/* In pixels of the box, whose upper left pixel has its centre at 0, 0. The corners: upper left, upper right, lower right
   and lower left of the mark as it is printed. */
struct marks_found {
    int id, hamming;
    double margin, x, y, corners[4][2];
};

struct marks_detector;

/* NULL without memory. */
struct marks_detector *marks_new(enum marks_family family);
void marks_free(struct marks_detector *detector);

/* Calls `report` for each mark; returns -1 without memory. Not for two threads at a time. */
typedef void marks_report(const struct marks_found *found, void *context);
int marks_find(struct marks_detector *detector, const struct marks_luma *luma, marks_report *report, void *context);

/* The picture of a mark: `*cells` x `*cells` bytes, row by row from the top, 1 is white. `*border` is how many cells wide the square
   between its four corners is. -1: the family has no such id. */
int marks_cells(enum marks_family family, uint32_t id, uint8_t picture[MARKS_CELLS * MARKS_CELLS], int *cells, int *border);

#endif
