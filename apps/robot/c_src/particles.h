/* The particles of Robot.Localiser.MonteCarlo: how they move, where they fall at random, and how well readings of sonars fit a
   floor plan from each of them. Robot.Localiser.MonteCarlo.Reference defines the same in Elixir. */
#ifndef CONVOY_PARTICLES_H
#define CONVOY_PARTICLES_H

#include <stddef.h>
#include <stdint.h>

/* Directions across the cone of a sonar, the axis first and its borders last. */
#define PARTICLES_RAYS 5
/* Entries of a table: the logarithm of a likelihood by how much longer a range is than expected, in steps of 2 cm. */
#define PARTICLES_TABLE 601

/* Metres, radians, and by which share it turns farther left. */
typedef struct {
    double x, y, heading, slip;
} particles_pose;

/* What odometry has counted, the sum of the angles turned, and the standard deviations of what it has missed. */
typedef struct {
    double x, y, heading, turned, place_sd, heading_sd, slip_sd;
} particles_step;

/* Clearances in units of 2 cm, rows from the lowest y; 0 is wall. */
typedef struct {
    const uint8_t *clear;
    int width, height;
    double cell, left, low;
} particles_map;

/* A sonar on the body (metres), the directions of its rays, its range and how far walls are looked for (metres), and whether it
   counts among those that fit or do not: it is an echo; else there is only the axis. */
typedef struct {
    double x, y, rays[PARTICLES_RAYS][2], range, most, counts;
} particles_reading;

void particles_move(particles_pose *poses, size_t count, const particles_step *step, uint32_t draw);

/* Free poses, of at least `need` units of clearance, with slips of this standard deviation. */
void particles_scatter(particles_pose *poses, size_t count, const particles_map *map, int need, double slip_sd, uint32_t draw);

/* For each pose the sum of the logarithms (1/1024), and how many of the readings that count fit. `tables` are two: for walls that the
   sonar faces, and for those that only the border of its cone meets. */
void particles_weigh(const particles_pose *poses, size_t count, const particles_map *map, const particles_reading *readings,
                     size_t reading_count, const int16_t *tables, int32_t *weighed);

#endif
