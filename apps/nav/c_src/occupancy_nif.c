/* Checks the terms of Nav.OccupancyGrid.Native and calls occupancy.c. */
#include <erl_nif.h>
#include <string.h>

#include "occupancy.h"

#define MOST_SIZE 1000
#define MOST_CONES 64u
#define MOST_DISCS 256u
#define FAR 1.0e6

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

static int get_cells(ErlNifEnv *env, ERL_NIF_TERM term, ERL_NIF_TERM size_term, ErlNifBinary *cells, int *size)
{
    return enif_inspect_binary(env, term, cells) && enif_get_int(env, size_term, size) && *size >= 1 &&
           *size <= MOST_SIZE && cells->size == (size_t)*size * (size_t)*size;
}

/* Numbers of which nothing overflows. */
static int sane(const double *numbers, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (!(numbers[k] >= -FAR && numbers[k] <= FAR))
            return 0;
    return 1;
}

/* The doubles of a binary, which may lie anywhere in memory. */
static int get_doubles(ErlNifEnv *env, ERL_NIF_TERM term, size_t each, size_t most, double *numbers, size_t *count)
{
    ErlNifBinary packed;
    if (!enif_inspect_binary(env, term, &packed) || packed.size % (each * sizeof(double)) != 0 ||
        packed.size / (each * sizeof(double)) > most)
        return 0;
    *count = packed.size / (each * sizeof(double));
    memcpy(numbers, packed.data, packed.size);
    return sane(numbers, *count * each);
}

/* add(cells, size, right, up, decay, cones, tangent, thick, discs, sure): {cells, changes} */
static ERL_NIF_TERM add(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary cells;
    int size, right, up, decay, sure;
    double tangent, thick;
    occupancy_cone cones[MOST_CONES];
    occupancy_disc discs[MOST_DISCS];
    size_t cone_count, disc_count;
    ERL_NIF_TERM result;

    if (argc != 10 || !get_cells(env, argv[0], argv[1], &cells, &size) || !enif_get_int(env, argv[2], &right) ||
        !enif_get_int(env, argv[3], &up) || right < -MOST_SIZE || right > MOST_SIZE || up < -MOST_SIZE ||
        up > MOST_SIZE || !enif_get_int(env, argv[4], &decay) || decay < 0 || decay > 127 ||
        !get_doubles(env, argv[5], 7, MOST_CONES, (double *)cones, &cone_count) ||
        !enif_get_double(env, argv[6], &tangent) || !enif_get_double(env, argv[7], &thick) ||
        !(tangent > 0.0 && tangent <= 10.0 && thick > 0.0 && thick <= 100.0) ||
        !get_doubles(env, argv[8], 3, MOST_DISCS, (double *)discs, &disc_count) ||
        !enif_get_int(env, argv[9], &sure) || sure < 1 || sure > OCCUPANCY_MOST)
        return enif_make_badarg(env);

    int8_t *moved = (int8_t *)enif_make_new_binary(env, cells.size, &result);
    occupancy_move((const int8_t *)cells.data, size, right, up, decay, moved);
    int64_t changes = occupancy_add(moved, size, cones, cone_count, tangent, thick, sure);
    changes += occupancy_clear(moved, size, discs, disc_count, sure);
    return enif_make_tuple2(env, result, enif_make_int64(env, changes));
}

/* walls(cells, size, {x, y, cosine, sine}, sure): {walls, count} */
static ERL_NIF_TERM walls(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary cells;
    int size, arity, sure;
    const ERL_NIF_TERM *terms;
    double at[4];
    ERL_NIF_TERM result;

    if (argc != 4 || !get_cells(env, argv[0], argv[1], &cells, &size) ||
        !enif_get_tuple(env, argv[2], &arity, &terms) || arity != 4 || !enif_get_int(env, argv[3], &sure))
        return enif_make_badarg(env);
    for (int k = 0; k < 4; k++)
        if (!enif_get_double(env, terms[k], &at[k]))
            return enif_make_badarg(env);
    if (!sane(at, 4))
        return enif_make_badarg(env);

    int64_t count = occupancy_walls((const int8_t *)cells.data, size, at[0], at[1], at[2], at[3], sure,
                                    enif_make_new_binary(env, cells.size, &result));
    return enif_make_tuple2(env, result, enif_make_int64(env, count));
}

/* Tens of microseconds each. */
static ErlNifFunc functions[] = {
    {"loaded?", 0, loaded, 0},
    {"add", 10, add, 0},
    {"walls", 4, walls, 0},
};

ERL_NIF_INIT(Elixir.Nav.OccupancyGrid.Native, functions, NULL, NULL, NULL, NULL)
