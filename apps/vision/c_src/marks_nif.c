/* Checks the arguments of Vision.Marks.Native, and makes a list of what marks.c finds. */
#include <erl_nif.h>

#include "marks_terms.h"

/* The library's detector is for one thread at a time. */
struct kept {
    ErlNifMutex *lock;
    struct marks_detector *detector;
};

static ErlNifResourceType *kept_type;

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

static void release(ErlNifEnv *env, void *object)
{
    struct kept *kept = object;

    (void)env;
    if (kept->detector != NULL)
        marks_free(kept->detector);
    if (kept->lock != NULL)
        enif_mutex_destroy(kept->lock);
}

static int get_family(ErlNifEnv *env, ERL_NIF_TERM term, enum marks_family *family)
{
    unsigned number;

    if (!enif_get_uint(env, term, &number) || number >= MARKS_FAMILIES)
        return 0;
    *family = (enum marks_family)number;
    return 1;
}

/* new(family) */
static ERL_NIF_TERM new(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    enum marks_family family;

    if (argc != 1 || !get_family(env, argv[0], &family))
        return enif_make_badarg(env);
    struct kept *kept = enif_alloc_resource(kept_type, sizeof *kept);

    if (kept == NULL)
        return enif_raise_exception(env, enif_make_atom(env, "system_limit"));
    kept->detector = NULL;
    kept->lock = enif_mutex_create("marks");
    if (kept->lock != NULL)
        kept->detector = marks_new(family);
    ERL_NIF_TERM term = enif_make_resource(env, kept);

    enif_release_resource(kept);
    return kept->detector ? term : enif_raise_exception(env, enif_make_atom(env, "system_limit"));
}

/* find(detector, format, width, height, bytes, box) */
static ERL_NIF_TERM find(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    void *object;
    struct marks_luma luma;

    if (argc != 6 || !enif_get_resource(env, argv[0], kept_type, &object) || !marks_get_luma(env, argv + 1, &luma))
        return enif_make_badarg(env);
    struct kept *kept = object;
    struct marks_list list = { env, enif_make_list(env, 0) };

    enif_mutex_lock(kept->lock);
    int result = marks_find(kept->detector, &luma, marks_put, &list);

    enif_mutex_unlock(kept->lock);
    if (result != 0)
        return enif_make_tuple2(env, enif_make_atom(env, "error"), enif_make_atom(env, "memory"));
    return enif_make_tuple2(env, enif_make_atom(env, "ok"), list.term);
}

/* cells(family, id): {cells, border, picture}, or nil for an id that the family has not */
static ERL_NIF_TERM cells(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    enum marks_family family;
    unsigned id;
    uint8_t picture[MARKS_CELLS * MARKS_CELLS];
    int wide, border;
    ERL_NIF_TERM bytes;

    if (argc != 2 || !get_family(env, argv[0], &family) || !enif_get_uint(env, argv[1], &id))
        return enif_make_badarg(env);
    if (marks_cells(family, id, picture, &wide, &border) != 0)
        return enif_make_atom(env, "nil");
    __builtin_memcpy(enif_make_new_binary(env, (size_t)(wide * wide), &bytes), picture, (size_t)(wide * wide));
    return enif_make_tuple3(env, enif_make_int(env, wide), enif_make_int(env, border), bytes);
}

static int load(ErlNifEnv *env, void **data, ERL_NIF_TERM info)
{
    (void)data;
    (void)info;
    kept_type = enif_open_resource_type(env, NULL, "marks 1", release, ERL_NIF_RT_CREATE | ERL_NIF_RT_TAKEOVER, NULL);
    return kept_type ? 0 : -1;
}

static int upgrade(ErlNifEnv *env, void **data, void **old_data, ERL_NIF_TERM info)
{
    (void)old_data;
    return load(env, data, info);
}

static ErlNifFunc functions[] = {
    { "loaded?", 0, loaded, 0 },
    { "new", 1, new, ERL_NIF_DIRTY_JOB_CPU_BOUND },
    { "find", 6, find, ERL_NIF_DIRTY_JOB_CPU_BOUND },
    { "cells", 2, cells, ERL_NIF_DIRTY_JOB_CPU_BOUND },
};

ERL_NIF_INIT(Elixir.Vision.Marks.Native, functions, load, NULL, upgrade, NULL)
