/* How well a picture fits the silhouettes of robots, from places along a line: the kernel of
   Robot.Localiser.Silhouettes, which Robot.Localiser.Silhouettes.Reference defines. */
#ifndef CONVOY_SILHOUETTES_H
#define CONVOY_SILHOUETTES_H

#include <stddef.h>
#include <stdint.h>

/* Columns of a picture: one bit each, bit 0 the leftmost. */
#define SILHOUETTES_COLUMNS 59

/* A robot: metres, the standard deviation of its place among them. */
typedef struct {
    double x, y, radius, sd;
} silhouettes_body;

typedef struct {
    double x, y, heading;
} silhouettes_pose;

/* The pose believed, the pose at exposure relative to it, the line's direction, how far the heading turns on a metre of it, the
   camera's direction and its focal length in columns. */
typedef struct {
    silhouettes_pose believed, back;
    double axis_x, axis_y, turn, pan, focal;
} silhouettes_search;

/* From `way` metres along the line: how many columns are wrong, and how many of those seen may be judged. */
void silhouettes_try(const silhouettes_search *search, uint64_t seen, const silhouettes_body *bodies, size_t count, double way,
                     int *wrong, int *clear);

#endif
