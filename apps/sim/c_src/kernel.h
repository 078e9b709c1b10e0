/* The heavy work of a simulated world: rays among walls and discs, and camera pictures.
 *
 * Lengths are metres, doubles throughout, and every operation is done in the order of
 * Sim.Compute.Reference, so that both give the same bits. Sizes are checked by the caller.
 */
#ifndef SIM_KERNEL_H
#define SIM_KERNEL_H

#include <stddef.h>
#include <stdint.h>

/* A floor plan; field[j * width + i] is the king's distance to the nearest wall, 0 is wall. */
typedef struct {
    const uint8_t *field;
    int64_t width, height;
    double cell;
} sim_map;

typedef struct {
    double x, y, radius;
} sim_disc;

/* One robot's sonars: SIM_SENSOR doubles each, the place and the five directions of its cone. */
enum { SIM_RAYS = 5, SIM_SENSOR = 2 + 2 * SIM_RAYS };

typedef struct {
    size_t self;
    double x, y, cosine, sine, least, most;
    const double *geometry;
    size_t sensors;
} sim_ring;

/* One robot's lidar: its place, then the direction of each ray, two doubles each. */
typedef struct {
    size_t self;
    double x, y, cosine, sine, least, most;
    const double *geometry;
    size_t rays;
} sim_lidar;

enum { SIM_MOST_RAYS = 4096 };

typedef struct {
    int on;
    uint32_t seed, step, robot;
} sim_noise;

typedef struct {
    double x, y, cosine, sine, eye, focal, horizon;
    int64_t width, height;
} sim_sight;

/* Something upright that stands on the floor: round, or a box, whose half_x is not 0; then the radius is that of the
 * circle round its corners, and its x axis points along the cosine and the sine. */
typedef struct {
    double x, y, radius, height, half_x, half_y, cosine, sine;
    uint8_t kind, paint[3];
} sim_pole;

enum { SIM_MOST_CELLS = 32 };

/* A flat picture that stands upright: its place, where it faces, how high the middle of its rows is; `rows` of the same
 * height, `columns` from edge to edge (from the place, to the right as it is looked at); not 0 is white, row by row from
 * the top. */
typedef struct {
    double x, y, cosine, sine, middle, row;
    int64_t rows, columns;
    double edges[SIM_MOST_CELLS + 1];
    const uint8_t *white;
} sim_mark;

/* What one column shows of one pole: rows top to bottom, and how bright. */
typedef struct {
    uint16_t column, top, bottom;
    uint8_t kind, luma;
} sim_piece;

typedef struct {
    double depth;
    uint32_t pole;
} sim_hit;

typedef struct {
    int64_t first, last;
} sim_span;

/* Room to work in: `hits` and `spans` for as many as there are poles, `pieces` as sim_look
 * says, the others for one row of the picture. sim_look needs the first three. */
typedef struct {
    sim_hit *hits;
    sim_span *spans;
    sim_piece *pieces;
    int16_t *tops, *bottoms;
    uint8_t *lumas;
} sim_scratch;

enum { SIM_TABLE = 4096, SIM_WIDEST = 4096 };

uint32_t sim_hash(uint32_t seed, uint32_t a, uint32_t b, uint32_t c);
double sim_gauss(uint32_t hash);

/* The field of a plan with one byte a cell, not 0 is wall. */
void sim_field(const uint8_t *walls, int64_t width, int64_t height, uint8_t *field);

/* How far a ray goes before it meets a wall, in multiples of its direction, at most `most`.
 * *axis: 0 or 1 for a side that looks along x or y, 2 for none. */
double sim_wall(const sim_map *map, double x, double y, double rx, double ry, double most,
                int *axis);

/* At most SIM_CHUNK rays, each from a place in a direction. */
enum { SIM_CHUNK = 64 };

typedef struct {
    size_t count;
    double x[SIM_CHUNK], y[SIM_CHUNK], rx[SIM_CHUNK], ry[SIM_CHUNK];
} sim_rays;

/* sim_wall for each of them. */
void sim_walls(const sim_map *map, const sim_rays *rays, double most, double *goes, uint8_t *axes);

/* The ranges of a robot's sonars. `near` is scratch for twice `count` discs. */
void sim_sonar(const sim_map *map, const sim_disc *discs, size_t count, const sim_ring *ring,
               const sim_noise *noise, sim_disc *near, double *ranges);

/* The ranges of a robot's lidar, two bytes each, the higher first: millimetres, 65535 for nothing. `near` is scratch for `count` discs. */
void sim_scan(const sim_map *map, const sim_disc *discs, size_t count, const sim_lidar *lidar,
              const sim_noise *noise, sim_disc *near, uint8_t *ranges);

/* The pieces of poles in a picture, at most width * min(count, height) of them; returns how many. */
size_t sim_look(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
                const sim_scratch *scratch);

/* The rows of a region in its newest column, linked; and a region: the sums of its pixels' columns, and twice that of
 * their rows. */
typedef struct {
    int32_t top, bottom, next;
} sim_row;

typedef struct {
    uint8_t kind;
    int32_t rows, left, right, top, bottom;
    int64_t area, columns, height;
} sim_region;

/* Room for as many of each as there are pieces. */
typedef struct {
    sim_region *regions;
    sim_row *rows;
    int32_t *next, *open;
} sim_regions;

/* Joins pieces to regions. Pieces darker than `least` of their kind count for nothing. Returns how many
 * regions there are; `order`, with room for as many as there are pieces, has their numbers. */
size_t sim_join(const sim_piece *pieces, size_t count, const uint8_t *least, const sim_regions *all,
                int32_t *order);

/* An I420 picture of even width, at most SIM_WIDEST, and even height. Of marks that overlap the last one is seen. `tables` are twice SIM_TABLE + SIM_WIDEST
 * bytes of noise, for luma and for chroma. */
void sim_paint(const sim_map *map, const sim_sight *sight, const sim_pole *poles, size_t count,
               const sim_mark *marks, size_t mark_count, const sim_noise *noise, const int8_t *tables, const sim_scratch *scratch,
               uint8_t *picture);

#endif
