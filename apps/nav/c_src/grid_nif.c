/* Checks the terms of Nav.Grid.Native and calls grid.c. */
#include <erl_nif.h>
#include <string.h>

#include "grid.h"

#define MOST_CELLS ((ErlNifSInt64)1 << 26)
#define MOST_DISCS 10000u
#define MOST_WAY 100000u

static int get_size(ErlNifEnv *env, ERL_NIF_TERM width_term, ERL_NIF_TERM height_term, size_t bytes, int64_t *width,
                    int64_t *height)
{
    ErlNifSInt64 w, h;
    if (!enif_get_int64(env, width_term, &w) || !enif_get_int64(env, height_term, &h) || w < 1 || h < 1 ||
        w > 1 << 14 || h > 1 << 14 || w * h > MOST_CELLS || (size_t)(w * h) != bytes)
        return 0;
    *width = w;
    *height = h;
    return 1;
}

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* clearance(cells, width, height, cell, closed) */
static ERL_NIF_TERM clearance(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary cells;
    int64_t width, height;
    double cell;
    ERL_NIF_TERM result;

    if (argc != 5 || !enif_inspect_binary(env, argv[0], &cells) ||
        !get_size(env, argv[1], argv[2], cells.size, &width, &height) || !enif_get_double(env, argv[3], &cell) ||
        !(cell >= 1.0e-3 && cell <= 10.0))
        return enif_make_badarg(env);
    void *scratch = enif_alloc(grid_clearance_scratch(width, height));
    if (scratch == NULL)
        return enif_make_badarg(env);
    grid_clearance(cells.data, width, height, cell, enif_is_identical(argv[4], enif_make_atom(env, "true")), scratch,
                   enif_make_new_binary(env, cells.size, &result));
    enif_free(scratch);
    return result;
}

/* overlay(clear, width, height, over, over_width, over_height, left, low) */
static ERL_NIF_TERM overlay(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary clear, over;
    int64_t width, height, over_width, over_height;
    int left, low;
    ERL_NIF_TERM result;

    if (argc != 8 || !enif_inspect_binary(env, argv[0], &clear) ||
        !get_size(env, argv[1], argv[2], clear.size, &width, &height) || !enif_inspect_binary(env, argv[3], &over) ||
        !get_size(env, argv[4], argv[5], over.size, &over_width, &over_height) || !enif_get_int(env, argv[6], &left) ||
        !enif_get_int(env, argv[7], &low))
        return enif_make_badarg(env);
    uint8_t *lowered = enif_make_new_binary(env, clear.size, &result);
    memcpy(lowered, clear.data, clear.size);
    grid_overlay(lowered, width, height, over.data, over_width, over_height, left, low);
    return result;
}

static int sane(const grid_disc *discs, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (!(discs[k].x >= -1.0e6 && discs[k].x <= 1.0e6 && discs[k].y >= -1.0e6 && discs[k].y <= 1.0e6 &&
              discs[k].radius >= 0.0 && discs[k].radius <= 1.0e5))
            return 0;
    return 1;
}

/* way(clear, width, height, need, discs, start, goal): the cells from the start on, [] without a way */
static ERL_NIF_TERM way(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary clear, packed;
    int64_t width, height;
    int need;
    unsigned start, goal;

    if (argc != 7 || !enif_inspect_binary(env, argv[0], &clear) ||
        !get_size(env, argv[1], argv[2], clear.size, &width, &height) || !enif_get_int(env, argv[3], &need) ||
        need < 1 || need > GRID_MOST || !enif_inspect_binary(env, argv[4], &packed) ||
        packed.size % sizeof(grid_disc) != 0 || packed.size / sizeof(grid_disc) > MOST_DISCS ||
        !enif_get_uint(env, argv[5], &start) || !enif_get_uint(env, argv[6], &goal) || start >= clear.size ||
        goal >= clear.size)
        return enif_make_badarg(env);

    size_t count = packed.size / sizeof(grid_disc);
    grid_disc *discs = enif_alloc(packed.size + sizeof(grid_disc));
    uint8_t *blocked = enif_alloc(clear.size);
    void *scratch = enif_alloc(grid_way_scratch(width, height));
    uint32_t *cells = enif_alloc(MOST_WAY * sizeof(uint32_t));
    ERL_NIF_TERM result = 0;

    if (discs != NULL && blocked != NULL && scratch != NULL && cells != NULL) {
        grid_map map = {clear.data, width, height};
        memcpy(discs, packed.data, packed.size);
        if (sane(discs, count)) {
            grid_block(width, height, discs, count, blocked);
            size_t found = grid_way(&map, blocked, need, start, goal, scratch, cells, MOST_WAY);
            result = enif_make_list(env, 0);
            /* The goal comes first in the array, so it is the first to be put on the list. */
            for (size_t k = 0; k < found; k++)
                result = enif_make_list_cell(env, enif_make_uint(env, cells[k]), result);
        }
    }
    enif_free(discs);
    enif_free(blocked);
    enif_free(scratch);
    enif_free(cells);
    return result == 0 ? enif_make_badarg(env) : result;
}

/* spread(times, width, height, start): four bytes for each cell */
static ERL_NIF_TERM spread(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary times;
    int64_t width, height;
    unsigned start;
    ERL_NIF_TERM result;

    if (argc != 4 || !enif_inspect_binary(env, argv[0], &times) ||
        !get_size(env, argv[1], argv[2], times.size, &width, &height) || !enif_get_uint(env, argv[3], &start) ||
        start >= times.size)
        return enif_make_badarg(env);
    for (size_t k = 0; k < times.size; k++)
        if (times.data[k] > GRID_TIMES)
            return enif_make_badarg(env);
    void *scratch = enif_alloc(grid_spread_scratch(width, height));
    if (scratch == NULL)
        return enif_make_badarg(env);
    unsigned char *costs = enif_make_new_binary(env, times.size * sizeof(int32_t), &result);
    grid_spread(times.data, width, height, start, scratch, (int32_t *)costs);
    enif_free(scratch);
    return result;
}

static ErlNifFunc functions[] = {
    {"loaded?", 0, loaded, 0},
    {"clearance", 5, clearance, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"overlay", 8, overlay, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"way", 7, way, ERL_NIF_DIRTY_JOB_CPU_BOUND},
    {"spread", 4, spread, ERL_NIF_DIRTY_JOB_CPU_BOUND},
};

ERL_NIF_INIT(Elixir.Nav.Grid.Native, functions, NULL, NULL, NULL, NULL)
