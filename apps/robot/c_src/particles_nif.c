/* Checks the terms of Robot.Localiser.MonteCarlo.Native and calls particles.c. */
#include <erl_nif.h>
#include <string.h>

#include "particles.h"

/* No call takes longer than a millisecond. */
#define MOST_POSES 1000u
#define MOST_READINGS 64u
#define MOST_SIDE 100000
#define FAR 1.0e6

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* The doubles of a binary, which may lie anywhere in memory, and of which nothing overflows. */
static int get_doubles(ErlNifEnv *env, ERL_NIF_TERM term, size_t each, size_t most, double *numbers, size_t *count)
{
    ErlNifBinary packed;
    if (!enif_inspect_binary(env, term, &packed) || packed.size % (each * sizeof(double)) != 0 ||
        packed.size / (each * sizeof(double)) > most)
        return 0;
    *count = packed.size / (each * sizeof(double));
    memcpy(numbers, packed.data, packed.size);
    for (size_t k = 0; k < *count * each; k++)
        if (!(numbers[k] >= -FAR && numbers[k] <= FAR))
            return 0;
    return 1;
}

/* {clear, width, height, cell, left, low} */
static int get_map(ErlNifEnv *env, ERL_NIF_TERM term, particles_map *map)
{
    int arity;
    const ERL_NIF_TERM *terms;
    ErlNifBinary clear;
    if (!enif_get_tuple(env, term, &arity, &terms) || arity != 6 || !enif_inspect_binary(env, terms[0], &clear) ||
        !enif_get_int(env, terms[1], &map->width) || !enif_get_int(env, terms[2], &map->height) || map->width < 1 ||
        map->height < 1 || map->width > MOST_SIDE || map->height > MOST_SIDE ||
        clear.size != (size_t)map->width * (size_t)map->height || !enif_get_double(env, terms[3], &map->cell) ||
        !(map->cell >= 0.01 && map->cell <= 1000.0) || !enif_get_double(env, terms[4], &map->left) ||
        !(map->left >= -FAR && map->left <= FAR) || !enif_get_double(env, terms[5], &map->low) ||
        !(map->low >= -FAR && map->low <= FAR))
        return 0;
    map->clear = clear.data;
    return 1;
}

/* move(poses, step, draw): poses */
static ERL_NIF_TERM move(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    particles_pose poses[MOST_POSES];
    particles_step step;
    size_t count, steps;
    unsigned draw;
    ERL_NIF_TERM result;

    if (argc != 3 || !get_doubles(env, argv[0], 4, MOST_POSES, (double *)poses, &count) ||
        !get_doubles(env, argv[1], 7, 1, (double *)&step, &steps) || steps != 1 || !enif_get_uint(env, argv[2], &draw))
        return enif_make_badarg(env);

    particles_move(poses, count, &step, draw);
    memcpy(enif_make_new_binary(env, count * sizeof poses[0], &result), poses, count * sizeof poses[0]);
    return result;
}

/* scatter(count, map, need, slip_sd, draw): poses */
static ERL_NIF_TERM scatter(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    particles_pose poses[MOST_POSES];
    particles_map map;
    unsigned count, draw;
    int need;
    double slip_sd;
    ERL_NIF_TERM result;

    if (argc != 5 || !enif_get_uint(env, argv[0], &count) || count > MOST_POSES || !get_map(env, argv[1], &map) ||
        !enif_get_int(env, argv[2], &need) || need < 0 || need > 255 || !enif_get_double(env, argv[3], &slip_sd) ||
        !(slip_sd >= 0.0 && slip_sd <= 1.0) || !enif_get_uint(env, argv[4], &draw))
        return enif_make_badarg(env);

    particles_scatter(poses, count, &map, need, slip_sd, draw);
    memcpy(enif_make_new_binary(env, count * sizeof poses[0], &result), poses, count * sizeof poses[0]);
    return result;
}

/* weigh(poses, map, readings, tables): for each pose two whole numbers of 32 bits */
static ERL_NIF_TERM weigh(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    particles_pose poses[MOST_POSES];
    particles_reading readings[MOST_READINGS];
    particles_map map;
    ErlNifBinary packed;
    int16_t tables[2 * PARTICLES_TABLE];
    size_t count, reading_count;
    ERL_NIF_TERM result;

    if (argc != 4 || !get_doubles(env, argv[0], 4, MOST_POSES, (double *)poses, &count) || !get_map(env, argv[1], &map) ||
        !get_doubles(env, argv[2], sizeof readings[0] / sizeof(double), MOST_READINGS, (double *)readings, &reading_count) ||
        !enif_inspect_binary(env, argv[3], &packed) || packed.size != sizeof tables)
        return enif_make_badarg(env);

    /* A cast ends after as many steps. */
    for (size_t k = 0; k < reading_count; k++)
        if (!(readings[k].most >= 0.0 && readings[k].most <= 100.0 && readings[k].most <= 2000.0 * map.cell))
            return enif_make_badarg(env);

    memcpy(tables, packed.data, sizeof tables);
    int32_t weighed[2 * MOST_POSES];
    particles_weigh(poses, count, &map, readings, reading_count, tables, weighed);
    memcpy(enif_make_new_binary(env, 2 * count * sizeof weighed[0], &result), weighed, 2 * count * sizeof weighed[0]);
    return result;
}

static ErlNifFunc functions[] = {{"loaded?", 0, loaded, 0}, {"move", 3, move, 0}, {"scatter", 5, scatter, 0}, {"weigh", 4, weigh, ERL_NIF_DIRTY_JOB_CPU_BOUND}};

ERL_NIF_INIT(Elixir.Robot.Localiser.MonteCarlo.Native, functions, NULL, NULL, NULL, NULL)
