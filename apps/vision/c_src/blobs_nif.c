/* Checks the arguments of Vision.Backend.Native, and makes a list of the regions of blobs.c. */
#include <erl_nif.h>
#include <stdlib.h>

#include "blobs.h"

static ERL_NIF_TERM error(ErlNifEnv *env, const char *reason)
{
    return enif_make_tuple2(env, enif_make_atom(env, "error"), enif_make_atom(env, reason));
}

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

static ERL_NIF_TERM region_term(ErlNifEnv *env, const struct blobs_region *region)
{
    return enif_make_tuple8(env, enif_make_uint(env, (unsigned)__builtin_ctz(region->mask)),
                            enif_make_uint(env, region->area), enif_make_uint64(env, region->sum_x),
                            enif_make_uint64(env, region->sum_y), enif_make_uint(env, region->left),
                            enif_make_uint(env, region->top), enif_make_uint(env, region->right),
                            enif_make_uint(env, region->bottom));
}

/* find(format, width, height, bytes, tables, min_area, max_area) */
static ERL_NIF_TERM find(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    int format;
    unsigned width, height, min_area, max_area;
    ErlNifBinary bytes, tables;
    struct blobs_picture picture;
    struct blobs_regions found;
    uint32_t aligned[768];

    if (argc != 7 || !enif_get_int(env, argv[0], &format) || !enif_get_uint(env, argv[1], &width) ||
        !enif_get_uint(env, argv[2], &height) || !enif_inspect_binary(env, argv[3], &bytes) ||
        !enif_inspect_binary(env, argv[4], &tables) || tables.size != sizeof aligned ||
        !enif_get_uint(env, argv[5], &min_area) || !enif_get_uint(env, argv[6], &max_area) ||
        blobs_lay(format, width, height, bytes.data, bytes.size, &picture) != 0)
        return enif_make_badarg(env);

    /* A binary may start at any address. */
    __builtin_memcpy(aligned, tables.data, sizeof aligned);
    ERL_NIF_TERM result;

    if (blobs_find(&picture, aligned, min_area, max_area, &found) == 0) {
        ERL_NIF_TERM list = enif_make_list(env, 0);

        for (size_t k = found.count; k > 0; k--)
            list = enif_make_list_cell(env, region_term(env, found.at + k - 1), list);
        result = enif_make_tuple2(env, enif_make_atom(env, "ok"), list);
    } else {
        result = error(env, "memory");
    }
    free(found.at);
    return result;
}

/* The module may be loaded again; there is no state to carry over. */
static int upgrade(ErlNifEnv *env, void **data, void **old_data, ERL_NIF_TERM info)
{
    (void)env;
    (void)data;
    (void)old_data;
    (void)info;
    return 0;
}

static ErlNifFunc functions[] = {
    { "loaded?", 0, loaded, 0 },
    { "find", 7, find, ERL_NIF_DIRTY_JOB_CPU_BOUND },
};

ERL_NIF_INIT(Elixir.Vision.Backend.Native, functions, NULL, NULL, upgrade, NULL)
