/* What a robot's sonars have seen of walls: evidence for each cell of a square window. Knows no Erlang. */
#ifndef OCCUPANCY_H
#define OCCUPANCY_H

#include <stddef.h>
#include <stdint.h>

/* Evidence is in whole numbers, so that all implementations have the same: log odds in steps of about 0.1. */
enum {
    OCCUPANCY_HIT = 10,   /* on the axis of an echo; less towards the edge of the cone */
    OCCUPANCY_MISS = -4,  /* before an echo */
    OCCUPANCY_MOST = 60,
    OCCUPANCY_LEAST = -40,
    OCCUPANCY_BODY = -20  /* where a body is known to be; only what is above is lowered to it */
};

/* One reading, in cells. Cells up to `clear` before the sonar are seen through; an echo, if there is one, came from
   `range` away. */
typedef struct {
    double x, y, cosine, sine, clear, range, echo; /* echo: 1 or 0 */
} occupancy_cone;

typedef struct {
    double x, y, radius;
} occupancy_disc;

/* Copies `cells` (size x size), moved by whole cells, so that what was at (x + right, y + up) is at (x, y); new cells are
   unknown, and all others come nearer to that by `decay`. */
void occupancy_move(const int8_t *cells, int64_t size, int64_t right, int64_t up, int decay, int8_t *moved);

/* Adds the readings. `tangent` is that of half the cone, `thick` half the depth of an arc in cells. Returns the number of
   cells that became surely wall, or ceased to be. */
int64_t occupancy_add(int8_t *cells, int64_t size, const occupancy_cone *cones, size_t count, double tangent,
                      double thick, int sure);

/* Where bodies are is no wall. */
int64_t occupancy_clear(int8_t *cells, int64_t size, const occupancy_disc *discs, size_t count, int sure);

/* The cells that are surely wall, as another frame has them: the centre of cell (i, j) of the result is at
   (x + cosine * i - sine * j, y + sine * i + cosine * j) of `cells`. */
int64_t occupancy_walls(const int8_t *cells, int64_t size, double x, double y, double cosine, double sine, int sure,
                        uint8_t *walls);

#endif
