/* Clearance of the cells of a floor plan, and the cheapest way over them. Knows no Erlang. */
#ifndef GRID_H
#define GRID_H

#include <stddef.h>
#include <stdint.h>

/* Clearances are bytes of 2 cm. A cell that is no wall has at least 1. */
#define GRID_UNIT 0.02
#define GRID_MOST 255

/* Weights of a way are whole numbers, so that all implementations take the same one. */
enum {
    GRID_STRAIGHT = 10,
    GRID_DIAGONAL = 14,
    GRID_WEIGHT = 8,  /* of a cell with room */
    GRID_NARROW = 16, /* more in a cell with none to spare */
    GRID_ROOMY = 25   /* units beyond what is needed that count as room: 0.5 m */
};

typedef struct {
    const uint8_t *clear; /* rows from the lowest y */
    int64_t width, height;
} grid_map;

/* Bytes of scratch that grid_clearance needs. */
size_t grid_clearance_scratch(int64_t width, int64_t height);

/* The clearance of each cell from the walls (1) among `cells`, for cells of `cell` metres: not more than the distance
   from its centre to the nearest point of a wall. What is outside the plan is wall if `closed`. */
void grid_clearance(const uint8_t *cells, int64_t width, int64_t height, double cell, int closed,
                    void *scratch, uint8_t *clear);

/* Lowers the clearances of `clear` to those of `over`, a window (over_width x over_height) whose lower left cell is at
   (left, low) of it, where that lies within. */
void grid_overlay(uint8_t *clear, int64_t width, int64_t height, const uint8_t *over, int64_t over_width,
                  int64_t over_height, int64_t left, int64_t low);

/* A disc in cells: the centre of the first cell is at 0.5, 0.5. */
typedef struct {
    double x, y, radius;
} grid_disc;

/* Sets `blocked` to 1 for the cells whose centres are within a disc, to 0 for the others. */
void grid_block(int64_t width, int64_t height, const grid_disc *discs, size_t count, uint8_t *blocked);

/* Bytes of scratch that grid_way needs. */
size_t grid_way_scratch(int64_t width, int64_t height);

/* The cheapest way from one cell to another over cells that have at least `need` units of clearance and are not
   `blocked`; both ends are passable whatever their clearance. 8 neighbours, no corners cut. Writes the cells of the way, the
   goal first, into `way` (room for `most`), and returns their number; 0: there is none, or it is longer. */
size_t grid_way(const grid_map *map, const uint8_t *blocked, int need, int64_t start, int64_t goal, void *scratch,
                uint32_t *way, size_t most);

/* Steps of grid_spread to one of four neighbours, and to one of the other four; the most times as long that one is, so that
   no cost exceeds its four bytes. */
enum { GRID_SIDE = 2, GRID_CORNER = 3, GRID_TIMES = 8, GRID_UNREACHED = -1 };

/* Bytes of scratch that grid_spread needs. */
size_t grid_spread_scratch(int64_t width, int64_t height);

/* The least costs of ways from `start` to all cells, GRID_UNREACHED where none leads. `times` has for each cell how many times
   as long a step to it is, GRID_TIMES at most; 0: there is none. 8 neighbours, past any corner. */
void grid_spread(const uint8_t *times, int64_t width, int64_t height, int64_t start, void *scratch, int32_t *costs);

#endif
