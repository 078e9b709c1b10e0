/* Checks the terms of Robot.Localiser.Silhouettes.Native and calls silhouettes.c. */
#include <erl_nif.h>
#include <string.h>

#include "silhouettes.h"

#define MOST_BODIES 1024u
#define MOST_WAYS 256u
#define FAR 1.0e9

static int sane(const double *numbers, size_t count)
{
    for (size_t k = 0; k < count; k++)
        if (!(numbers[k] >= -FAR && numbers[k] <= FAR))
            return 0;
    return 1;
}

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* fits(search, seen, bodies, ways): [{wrong, clear}] */
static ERL_NIF_TERM fits(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary search_term, body_term, way_term;
    ErlNifUInt64 seen;
    silhouettes_search search;
    silhouettes_body bodies[MOST_BODIES];
    double ways[MOST_WAYS];
    ERL_NIF_TERM tried[MOST_WAYS];

    if (argc != 4 || !enif_inspect_binary(env, argv[0], &search_term) || search_term.size != sizeof search ||
        !enif_get_uint64(env, argv[1], &seen) || seen >> SILHOUETTES_COLUMNS ||
        !enif_inspect_binary(env, argv[2], &body_term) || body_term.size % sizeof bodies[0] ||
        body_term.size > sizeof bodies || !enif_inspect_binary(env, argv[3], &way_term) ||
        way_term.size % sizeof ways[0] || way_term.size > sizeof ways)
        return enif_make_badarg(env);

    /* Binaries need not lie where numbers may. */
    memcpy(&search, search_term.data, sizeof search);
    memcpy(bodies, body_term.data, body_term.size);
    memcpy(ways, way_term.data, way_term.size);
    size_t count = body_term.size / sizeof bodies[0], steps = way_term.size / sizeof ways[0];
    if (!sane((const double *)&search, sizeof search / sizeof(double)) ||
        !sane((const double *)bodies, 4 * count) || !sane(ways, steps))
        return enif_make_badarg(env);

    for (size_t k = 0; k < steps; k++) {
        int wrong, clear;
        silhouettes_try(&search, seen, bodies, count, ways[k], &wrong, &clear);
        tried[k] = enif_make_tuple2(env, enif_make_int(env, wrong), enif_make_int(env, clear));
    }
    return enif_make_list_from_array(env, tried, (unsigned)steps);
}

static ErlNifFunc functions[] = {{"loaded?", 0, loaded, 0}, {"fits", 4, fits, 0}};

ERL_NIF_INIT(Elixir.Robot.Localiser.Silhouettes.Native, functions, NULL, NULL, NULL, NULL)
