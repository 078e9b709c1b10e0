/* Checks the arguments of Vision.Marks.Similar.Native, and makes a list of what similar.c finds. */
#include "marks_terms.h"
#include "similar.h"

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* find(format, width, height, bytes, box) */
static ERL_NIF_TERM find(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    struct marks_luma luma;
    struct marks_list list = { env, enif_make_list(env, 0) };

    if (argc != 5 || !marks_get_luma(env, argv, &luma))
        return enif_make_badarg(env);
    if (similar_find(&luma, marks_put, &list) != 0)
        return enif_make_tuple2(env, enif_make_atom(env, "error"), enif_make_atom(env, "memory"));
    return enif_make_tuple2(env, enif_make_atom(env, "ok"), list.term);
}

/* The module may be loaded again. */
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
    { "find", 5, find, ERL_NIF_DIRTY_JOB_CPU_BOUND },
};

ERL_NIF_INIT(Elixir.Vision.Marks.Similar.Native, functions, NULL, NULL, upgrade, NULL)
