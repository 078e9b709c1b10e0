/* Checks the terms of Sim.Compute.Native and calls rays.c, paint.c and regions.c. */
#include <erl_nif.h>
#include <string.h>

#include "kernel.h"

/* Nothing is further away than this, so that no cell number or row overflows. */
#define WORLD 1.0e6
#define MOST_BODIES 100000u
#define MOST_MARKS 1000u

enum { POLE_BYTES = 8 * sizeof(double) + 4 };

static int number(ErlNifEnv *env, ERL_NIF_TERM term, double least, double most, double *value)
{
    return enif_get_double(env, term, value) && *value >= least && *value <= most;
}

static int tuple(ErlNifEnv *env, ERL_NIF_TERM term, int size, const ERL_NIF_TERM **elements)
{
    int got;
    return enif_get_tuple(env, term, &got, elements) && got == size;
}

/* {field, width, height, cell} */
static int get_map(ErlNifEnv *env, ERL_NIF_TERM term, sim_map *map)
{
    const ERL_NIF_TERM *e;
    ErlNifBinary field;
    ErlNifSInt64 width, height;

    if (!tuple(env, term, 4, &e) || !enif_inspect_binary(env, e[0], &field) ||
        !enif_get_int64(env, e[1], &width) || !enif_get_int64(env, e[2], &height) || width < 1 ||
        height < 1 || width > 1 << 28 || height > 1 << 28 ||
        (uint64_t)(width * height) != field.size || !number(env, e[3], 1.0e-4, 100.0, &map->cell))
        return 0;
    map->field = field.data;
    map->width = width;
    map->height = height;
    return 1;
}

/* nil, or {seed, step, robot} */
static int get_noise(ErlNifEnv *env, ERL_NIF_TERM term, sim_noise *noise)
{
    const ERL_NIF_TERM *e;

    memset(noise, 0, sizeof *noise);
    if (enif_is_identical(term, enif_make_atom(env, "nil")))
        return 1;
    noise->on = 1;
    return tuple(env, term, 3, &e) && enif_get_uint(env, e[0], &noise->seed) &&
           enif_get_uint(env, e[1], &noise->step) && enif_get_uint(env, e[2], &noise->robot);
}

/* {x, y, cosine, sine, eye, focal, horizon, width, height} */
static int get_sight(ErlNifEnv *env, ERL_NIF_TERM term, sim_sight *sight)
{
    const ERL_NIF_TERM *e;
    ErlNifSInt64 width, height;

    if (!tuple(env, term, 9, &e) || !number(env, e[0], -WORLD, WORLD, &sight->x) ||
        !number(env, e[1], -WORLD, WORLD, &sight->y) || !number(env, e[2], -1.1, 1.1, &sight->cosine) ||
        !number(env, e[3], -1.1, 1.1, &sight->sine) || !number(env, e[4], 0.0, 1000.0, &sight->eye) ||
        !number(env, e[5], 0.1, WORLD, &sight->focal) ||
        !number(env, e[6], -WORLD, WORLD, &sight->horizon) || !enif_get_int64(env, e[7], &width) ||
        !enif_get_int64(env, e[8], &height) || width < 2 || height < 2 || width > SIM_WIDEST ||
        height > SIM_WIDEST || width % 2 != 0 || height % 2 != 0)
        return 0;
    sight->width = width;
    sight->height = height;
    return 1;
}

static int within(double value, double least, double most)
{
    return value >= least && value <= most;
}

static void release(void *memory)
{
    if (memory != NULL)
        enif_free(memory);
}

/* No term was made: the arguments were wrong. An exception must not be made before that is known. */
static ERL_NIF_TERM answer(ErlNifEnv *env, ERL_NIF_TERM result)
{
    return result == 0 ? enif_make_badarg(env) : result;
}

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* field(walls, width, height) */
static ERL_NIF_TERM field(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary walls;
    ErlNifSInt64 width, height;
    ERL_NIF_TERM result;

    if (argc != 3 || !enif_inspect_binary(env, argv[0], &walls) ||
        !enif_get_int64(env, argv[1], &width) || !enif_get_int64(env, argv[2], &height) ||
        width < 1 || height < 1 || width > 1 << 28 || height > 1 << 28 ||
        (uint64_t)(width * height) != walls.size)
        return enif_make_badarg(env);
    sim_field(walls.data, width, height, enif_make_new_binary(env, walls.size, &result));
    return result;
}

/* The doubles of a binary, which may start at any address, in memory of their own. */
static double *doubles(const ErlNifBinary *binary)
{
    double *copy = enif_alloc(binary->size + sizeof(double));
    if (copy != NULL)
        memcpy(copy, binary->data, binary->size);
    return copy;
}

/* {index, x, y, cosine, sine, least, most, geometry} */
static int get_ring(ErlNifEnv *env, ERL_NIF_TERM term, sim_ring *ring, ErlNifBinary *geometry)
{
    const ERL_NIF_TERM *e;
    unsigned self;

    if (!tuple(env, term, 8, &e) || !enif_get_uint(env, e[0], &self) ||
        !number(env, e[1], -WORLD, WORLD, &ring->x) || !number(env, e[2], -WORLD, WORLD, &ring->y) ||
        !number(env, e[3], -1.1, 1.1, &ring->cosine) || !number(env, e[4], -1.1, 1.1, &ring->sine) ||
        !number(env, e[5], 0.0, 1000.0, &ring->least) ||
        !number(env, e[6], 0.0, 1000.0, &ring->most) ||
        !enif_inspect_binary(env, e[7], geometry) ||
        geometry->size % (SIM_SENSOR * sizeof(double)) != 0 ||
        geometry->size > 64 * SIM_SENSOR * sizeof(double))
        return 0;
    ring->self = self;
    ring->sensors = geometry->size / (SIM_SENSOR * sizeof(double));
    return 1;
}

static int sane(const double *values, size_t count, double most)
{
    for (size_t k = 0; k < count; k++)
        if (!within(values[k], -most, most))
            return 0;
    return 1;
}

/* The discs of a binary, to be freed, with room for as many behind them. */
static sim_disc *get_discs(ErlNifEnv *env, ERL_NIF_TERM term, size_t *count)
{
    ErlNifBinary packed;

    *count = 0;
    if (!enif_inspect_binary(env, term, &packed) || packed.size % sizeof(sim_disc) != 0 ||
        packed.size / sizeof(sim_disc) > MOST_BODIES)
        return NULL;
    sim_disc *discs = enif_alloc(3 * packed.size + sizeof(sim_disc));
    if (discs == NULL)
        return NULL;
    memcpy(discs, packed.data, packed.size);
    *count = packed.size / sizeof(sim_disc);
    if (sane((double *)discs, 3 * *count, WORLD))
        return discs;
    release(discs);
    return NULL;
}

/* sonar(map, discs, rings, noise) */
static ERL_NIF_TERM sonar(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    sim_map map;
    sim_noise noise;
    ErlNifBinary geometry;
    ERL_NIF_TERM head, tail, rows, result = 0;
    int fine = 1;
    double directions[64 * SIM_SENSOR], ranges[64];
    ERL_NIF_TERM terms[64];

    if (argc != 4 || !get_map(env, argv[0], &map) || !get_noise(env, argv[3], &noise))
        return enif_make_badarg(env);

    size_t count;
    sim_disc *discs = get_discs(env, argv[1], &count);

    if (discs != NULL) {
        sim_disc *near = discs + count;

        rows = enif_make_list(env, 0);
        for (tail = argv[2]; fine && enif_get_list_cell(env, tail, &head, &tail);) {
            sim_ring ring;
            fine = get_ring(env, head, &ring, &geometry);
            if (fine)
                memcpy(directions, geometry.data, geometry.size);
            if (!fine || !sane(directions, geometry.size / sizeof(double), 1000.0)) {
                fine = 0;
                break;
            }
            ring.geometry = directions;
            sim_sonar(&map, discs, count, &ring, &noise, near, ranges);
            for (size_t k = 0; k < ring.sensors; k++)
                terms[k] = enif_make_double(env, ranges[k]);
            rows = enif_make_list_cell(
                env, enif_make_list_from_array(env, terms, (unsigned)ring.sensors), rows);
        }
        if (fine && enif_is_empty_list(env, tail))
            enif_make_reverse_list(env, rows, &result);
    }
    release(discs);
    return answer(env, result);
}

/* {index, x, y, cosine, sine, least, most, geometry}, with a copy of the geometry, which is to be freed. */
static int get_lidar(ErlNifEnv *env, ERL_NIF_TERM term, sim_lidar *lidar)
{
    const ERL_NIF_TERM *e;
    unsigned self;
    ErlNifBinary geometry;

    lidar->geometry = NULL;
    if (!tuple(env, term, 8, &e) || !enif_get_uint(env, e[0], &self) ||
        !number(env, e[1], -WORLD, WORLD, &lidar->x) || !number(env, e[2], -WORLD, WORLD, &lidar->y) ||
        !number(env, e[3], -1.1, 1.1, &lidar->cosine) || !number(env, e[4], -1.1, 1.1, &lidar->sine) ||
        !number(env, e[5], 0.0, 1000.0, &lidar->least) ||
        !number(env, e[6], 0.0, 65.0, &lidar->most) || !enif_inspect_binary(env, e[7], &geometry) ||
        geometry.size % (2 * sizeof(double)) != 0 || geometry.size < 2 * sizeof(double) ||
        geometry.size > 2 * (SIM_MOST_RAYS + 1) * sizeof(double))
        return 0;
    lidar->self = self;
    lidar->rays = geometry.size / (2 * sizeof(double)) - 1;
    lidar->geometry = doubles(&geometry);
    return lidar->geometry != NULL && sane(lidar->geometry, 2 * (lidar->rays + 1), 1000.0);
}

/* scan(map, discs, lidars, noise) */
static ERL_NIF_TERM scan(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    sim_map map;
    sim_noise noise;
    ERL_NIF_TERM head, tail, row, rows, result = 0;
    int fine = 1;

    if (argc != 4 || !get_map(env, argv[0], &map) || !get_noise(env, argv[3], &noise))
        return enif_make_badarg(env);

    size_t count;
    sim_disc *discs = get_discs(env, argv[1], &count);

    if (discs != NULL) {
        sim_disc *near = discs + count;

        rows = enif_make_list(env, 0);
        for (tail = argv[2]; fine && enif_get_list_cell(env, tail, &head, &tail);) {
            sim_lidar lidar;
            fine = get_lidar(env, head, &lidar);
            if (fine) {
                sim_scan(&map, discs, count, &lidar, &noise, near,
                         enif_make_new_binary(env, 2 * lidar.rays, &row));
                rows = enif_make_list_cell(env, row, rows);
            }
            release((void *)lidar.geometry);
        }
        if (fine && enif_is_empty_list(env, tail))
            enif_make_reverse_list(env, rows, &result);
    }
    release(discs);
    return answer(env, result);
}

/* The poles of a binary: place, radius, height, halves and direction in doubles, then kind and paint in bytes. */
static sim_pole *get_poles(ErlNifEnv *env, ERL_NIF_TERM term, size_t *count)
{
    ErlNifBinary packed;

    if (!enif_inspect_binary(env, term, &packed) || packed.size % POLE_BYTES != 0 ||
        packed.size / POLE_BYTES > MOST_BODIES)
        return NULL;
    *count = packed.size / POLE_BYTES;
    sim_pole *poles = enif_alloc((*count + 1) * sizeof(sim_pole));
    for (size_t k = 0; poles != NULL && k < *count; k++) {
        const unsigned char *bytes = packed.data + k * POLE_BYTES;
        double values[8];
        memcpy(values, bytes, sizeof values);
        poles[k] = (sim_pole){values[0], values[1], values[2], values[3], values[4], values[5],
                              values[6], values[7], bytes[64], {bytes[65], bytes[66], bytes[67]}};
        if (!sane(values, 2, WORLD) || !within(values[2], 1.0e-3, 100.0) ||
            !within(values[3], 0.0, 1000.0) || !sane(values + 6, 2, 1.0) ||
            !(values[4] == 0.0 || (within(values[4], 1.0e-3, 100.0) && within(values[5], 1.0e-3, 100.0)))) {
            enif_free(poles);
            return NULL;
        }
    }
    return poles;
}

/* One piece of memory for all scratch, the most strictly aligned first. */
static void *get_scratch(const sim_sight *sight, size_t count, sim_scratch *scratch)
{
    size_t width = (size_t)sight->width;
    size_t each = count < (size_t)sight->height ? count : (size_t)sight->height;
    size_t sizes[] = {(count + 1) * sizeof(sim_hit), (count + 1) * sizeof(sim_span),
                      (width * each + 1) * sizeof(sim_piece), width * sizeof(int16_t),
                      width * sizeof(int16_t), width};
    char *at[6], *memory, *next;
    size_t total = 0;

    for (int k = 0; k < 6; k++)
        total += (sizes[k] + 15) & ~(size_t)15;
    memory = next = enif_alloc(total);
    if (memory == NULL)
        return NULL;
    for (int k = 0; k < 6; k++) {
        at[k] = next;
        next += (sizes[k] + 15) & ~(size_t)15;
    }
    *scratch = (sim_scratch){(sim_hit *)at[0], (sim_span *)at[1], (sim_piece *)at[2],
                             (int16_t *)at[3], (int16_t *)at[4], (uint8_t *)at[5]};
    return memory;
}

/* look(map, sight, poles): pieces of 8 bytes */
static ERL_NIF_TERM look(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    sim_map map;
    sim_sight sight;
    sim_scratch scratch;
    size_t count = 0;
    sim_pole *poles = NULL;
    void *memory = NULL;
    ERL_NIF_TERM result = 0;

    if (argc == 3 && get_map(env, argv[0], &map) && get_sight(env, argv[1], &sight) &&
        (poles = get_poles(env, argv[2], &count)) != NULL &&
        (memory = get_scratch(&sight, count, &scratch)) != NULL) {
        size_t size = sim_look(&map, &sight, poles, count, &scratch) * sizeof(sim_piece);
        memcpy(enif_make_new_binary(env, size, &result), scratch.pieces, size);
    }
    release(memory);
    release(poles);
    return answer(env, result);
}

static ERL_NIF_TERM region_term(ErlNifEnv *env, const sim_region *region)
{
    return enif_make_tuple8(env, enif_make_int(env, region->kind), enif_make_int64(env, region->area),
                            enif_make_int(env, region->left), enif_make_int(env, region->right),
                            enif_make_int(env, region->top), enif_make_int(env, region->bottom),
                            enif_make_int64(env, region->columns),
                            enif_make_int64(env, region->height));
}

/* join(pieces, least): the regions of what look returns; `least` has the lowest brightness of each kind. */
static ERL_NIF_TERM join(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary packed, least;
    ERL_NIF_TERM rest, result = 0;

    if (argc != 2 || !enif_inspect_binary(env, argv[0], &packed) ||
        packed.size % sizeof(sim_piece) != 0 || packed.size > SIM_WIDEST * SIM_WIDEST ||
        !enif_inspect_binary(env, argv[1], &least) || least.size < 1)
        return enif_make_badarg(env);

    const size_t count = packed.size / sizeof(sim_piece);
    const size_t each = sizeof(sim_piece) + sizeof(sim_region) + sizeof(sim_row) + 3 * sizeof(int32_t);
    char *memory = enif_alloc((count + 1) * each);
    int fine = memory != NULL;

    if (fine) {
        /* The most strictly aligned first. */
        sim_regions all = {(sim_region *)memory, NULL, NULL, NULL};
        sim_piece *pieces = (sim_piece *)(all.regions + count + 1);
        all.rows = (sim_row *)(pieces + count + 1);
        all.next = (int32_t *)(all.rows + count + 1);
        all.open = all.next + count + 1;
        int32_t *order = all.open + count + 1;

        memcpy(pieces, packed.data, packed.size);
        for (size_t k = 0; k < count; k++)
            fine = fine && pieces[k].kind < least.size && pieces[k].top <= pieces[k].bottom;
        if (fine) {
            rest = enif_make_list(env, 0);
            for (size_t k = sim_join(pieces, count, least.data, &all, order); k > 0; k--)
                rest = enif_make_list_cell(env, region_term(env, all.regions + order[k - 1]), rest);
            result = rest;
        }
    }
    release(memory);
    return answer(env, result);
}

/* [{x, y, cosine, sine, middle, row, rows, edges, white}], marks. */
static int get_marks(ErlNifEnv *env, ERL_NIF_TERM list, sim_mark **marks, size_t *count)
{
    unsigned length;
    ERL_NIF_TERM head;
    const ERL_NIF_TERM *e;
    ErlNifBinary edges, white;

    if (!enif_get_list_length(env, list, &length) || length > MOST_MARKS)
        return 0;
    *marks = enif_alloc((length + 1) * sizeof(sim_mark));
    if (*marks == NULL)
        return 0;
    *count = length;
    for (sim_mark *mark = *marks; enif_get_list_cell(env, list, &head, &list); mark++) {
        ErlNifSInt64 rows;
        if (!tuple(env, head, 9, &e) || !number(env, e[0], -WORLD, WORLD, &mark->x) ||
            !number(env, e[1], -WORLD, WORLD, &mark->y) || !number(env, e[2], -1.1, 1.1, &mark->cosine) ||
            !number(env, e[3], -1.1, 1.1, &mark->sine) || !number(env, e[4], -1000.0, 1000.0, &mark->middle) ||
            !number(env, e[5], 1.0e-5, 100.0, &mark->row) || !enif_get_int64(env, e[6], &rows) || rows < 1 ||
            rows > SIM_MOST_CELLS || !enif_inspect_binary(env, e[7], &edges) || edges.size < 2 * sizeof(double) ||
            edges.size > sizeof mark->edges || edges.size % sizeof(double) != 0 ||
            !enif_inspect_binary(env, e[8], &white) ||
            white.size != (size_t)rows * (edges.size / sizeof(double) - 1))
            return 0;
        mark->rows = rows;
        mark->columns = (int64_t)(edges.size / sizeof(double)) - 1;
        memcpy(mark->edges, edges.data, edges.size);
        for (int64_t k = 0; k <= mark->columns; k++)
            if (!(mark->edges[k] >= -WORLD && mark->edges[k] <= WORLD) ||
                (k > 0 && mark->edges[k] < mark->edges[k - 1]))
                return 0;
        mark->white = white.data;
    }
    return 1;
}

/* paint(map, sight, poles, marks, noise, tables) */
static ERL_NIF_TERM paint(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    sim_map map;
    sim_sight sight;
    sim_noise noise;
    sim_scratch scratch;
    ErlNifBinary tables;
    size_t count = 0, mark_count = 0;
    sim_pole *poles = NULL;
    sim_mark *marks = NULL;
    void *memory = NULL;
    ERL_NIF_TERM result = 0;

    if (argc == 6 && get_map(env, argv[0], &map) && get_sight(env, argv[1], &sight) &&
        get_noise(env, argv[4], &noise) && enif_inspect_binary(env, argv[5], &tables) &&
        tables.size == 2 * (SIM_TABLE + SIM_WIDEST) && get_marks(env, argv[3], &marks, &mark_count) &&
        (poles = get_poles(env, argv[2], &count)) != NULL &&
        (memory = get_scratch(&sight, count, &scratch)) != NULL) {
        size_t size = (size_t)(sight.width * sight.height / 2 * 3);
        sim_paint(&map, &sight, poles, count, marks, mark_count, &noise, (const int8_t *)tables.data, &scratch,
                  enif_make_new_binary(env, size, &result));
    }
    release(memory);
    release(marks);
    release(poles);
    return answer(env, result);
}

static ErlNifFunc functions[] = {
    {"loaded?", 0, loaded, 0},
    {"field", 3, field, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"sonar_few", 4, sonar, 0},
    {"sonar_many", 4, sonar, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"scan_few", 4, scan, 0},
    {"scan_many", 4, scan, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"look", 3, look, 0},
    {"join", 2, join, 0},
    {"paint", 6, paint, 0},
};

ERL_NIF_INIT(Elixir.Sim.Compute.Native, functions, NULL, NULL, NULL, NULL)
