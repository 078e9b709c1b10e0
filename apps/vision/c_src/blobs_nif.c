/* Checks the arguments of Vision.Backend.Native, and makes a list of the regions of blobs.c. */
#include <erl_nif.h>
#include <stdatomic.h>

#include "blobs.h"

#define PATIENCE_NS 1000000     /* for which a call may keep a scheduler busy */
#define SLICE_NS 10000          /* a hundredth of that */
#define GLANCE_NS 100000        /* how long it may go on without a look at the clock, */
#define SKIP_MOST 7             /* and for how many steps of BLOBS_STEP pixels */

/* Memory for the calls of one process. Who finds it in use takes other memory for that call. */
struct kept {
    atomic_flag in_use;
    struct blobs_scratch scratch;
};

/* The layout of `struct kept`: resources of another layout are then of another type. */
#define KEPT_TYPE "scratch 2"

static ErlNifResourceType *kept_type;

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

static void release(ErlNifEnv *env, void *object)
{
    (void)env;
    blobs_release(&((struct kept *)object)->scratch);
}

/* new() */
static ERL_NIF_TERM new(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    struct kept *kept = enif_alloc_resource(kept_type, sizeof *kept);

    if (kept == NULL)
        return enif_raise_exception(env, enif_make_atom(env, "system_limit"));
    atomic_flag_clear(&kept->in_use);
    kept->scratch = (struct blobs_scratch){ 0 };
    ERL_NIF_TERM term = enif_make_resource(env, kept);

    enif_release_resource(kept);
    return term;
}

/* held(scratch) */
static ERL_NIF_TERM held(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    void *object;

    if (argc != 1 || !enif_get_resource(env, argv[0], kept_type, &object))
        return enif_make_badarg(env);
    struct kept *kept = object;

    if (atomic_flag_test_and_set_explicit(&kept->in_use, memory_order_acquire))
        return error(env, "in_use");
    size_t bytes = blobs_held(&kept->scratch);

    atomic_flag_clear_explicit(&kept->in_use, memory_order_release);
    return enif_make_uint64(env, bytes);
}

static ERL_NIF_TERM region_term(ErlNifEnv *env, const struct blobs_region *region)
{
    return enif_make_tuple8(env, enif_make_uint(env, (unsigned)__builtin_ctz(region->mask)),
                            enif_make_uint(env, region->area), enif_make_uint64(env, region->sum_x),
                            enif_make_uint64(env, region->sum_y), enif_make_uint(env, region->left),
                            enif_make_uint(env, region->top), enif_make_uint(env, region->right),
                            enif_make_uint(env, region->bottom));
}

static ERL_NIF_TERM regions_term(ErlNifEnv *env, const struct blobs_scratch *scratch)
{
    ERL_NIF_TERM list = enif_make_list(env, 0);

    for (size_t k = scratch->count; k > 0; k--)
        list = enif_make_list_cell(env, region_term(env, scratch->regions + k - 1), list);
    return enif_make_tuple2(env, enif_make_atom(env, "ok"), list);
}

/* The arguments of find(format, width, height, bytes, tables, min_area, max_area, scratch or nil). */
struct job {
    struct blobs_picture picture;
    uint32_t tables[768];
    unsigned min_area, max_area;
    struct kept *kept;          /* NULL for nil */
};

static int read_job(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[], struct job *job)
{
    int format;
    unsigned width, height;
    ErlNifBinary bytes, tables;
    void *object = NULL;

    if (argc != 8 || !enif_get_int(env, argv[0], &format) || !enif_get_uint(env, argv[1], &width) ||
        !enif_get_uint(env, argv[2], &height) || !enif_inspect_binary(env, argv[3], &bytes) ||
        !enif_inspect_binary(env, argv[4], &tables) || tables.size != sizeof job->tables ||
        !enif_get_uint(env, argv[5], &job->min_area) || !enif_get_uint(env, argv[6], &job->max_area) ||
        !(enif_get_resource(env, argv[7], kept_type, &object) ||
          enif_is_identical(argv[7], enif_make_atom(env, "nil"))) ||
        blobs_lay(format, width, height, bytes.data, bytes.size, &job->picture) != 0)
        return -1;
    /* A binary may start at any address. */
    __builtin_memcpy(job->tables, tables.data, sizeof job->tables);
    job->kept = object;
    return 0;
}

static enum blobs_result search(const struct job *job, struct blobs_scratch *scratch, blobs_pause *pause,
                                void *context)
{
    return blobs_find(&job->picture, job->tables, job->min_area, job->max_area, scratch, pause, context);
}

static ERL_NIF_TERM answer(ErlNifEnv *env, enum blobs_result result, const struct blobs_scratch *scratch)
{
    return result == BLOBS_DONE ? regions_term(env, scratch) : error(env, "memory");
}

static ERL_NIF_TERM finish(ErlNifEnv *env, enum blobs_result result, struct kept *kept)
{
    ERL_NIF_TERM term = answer(env, result, &kept->scratch);

    atomic_flag_clear_explicit(&kept->in_use, memory_order_release);
    return term;
}

/* A search in memory of its own, on a dirty scheduler. */
static ERL_NIF_TERM find_alone(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    struct job job;
    struct blobs_scratch own = { 0 };

    if (read_job(env, argc, argv, &job) != 0)
        return enif_make_badarg(env);
    ERL_NIF_TERM term = answer(env, search(&job, &own, NULL, NULL), &own);

    blobs_release(&own);
    return term;
}

/* The rest of a search that took long, on a dirty scheduler. */
static ERL_NIF_TERM find_rest(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    struct job job;

    if (read_job(env, argc, argv, &job) != 0 || job.kept == NULL)
        return enif_make_badarg(env);
    return finish(env, search(&job, &job.kept->scratch, NULL, NULL), job.kept);
}

/* The time that a search has. A look at the clock costs up to a fifth of a microsecond, and there would be 18 in a
   VGA frame: after a step that was fast the next ones are not timed, for GLANCE_NS at its pace, and SKIP_MOST of
   them at most, because what follows may be noisier. */
struct patience {
    ErlNifTime until, looked;
    unsigned skip, steps;       /* how often not to look, and the steps since the last look */
};

static int late(void *context)
{
    struct patience *patience = context;

    patience->steps++;
    if (patience->skip > 0) {
        patience->skip--;
        return 0;
    }
    ErlNifTime now = enif_monotonic_time(ERL_NIF_NSEC);
    ErlNifTime step = (now - patience->looked) / patience->steps;

    patience->skip = step * SKIP_MOST < GLANCE_NS ? SKIP_MOST : (unsigned)(GLANCE_NS / step);
    patience->looked = now;
    patience->steps = 0;
    return now >= patience->until;
}

static ERL_NIF_TERM find(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    struct job job;
    int dirty = ERL_NIF_DIRTY_JOB_CPU_BOUND;

    if (read_job(env, argc, argv, &job) != 0)
        return enif_make_badarg(env);
    if (job.kept == NULL || atomic_flag_test_and_set_explicit(&job.kept->in_use, memory_order_acquire))
        return enif_schedule_nif(env, "find", dirty, find_alone, argc, argv);

    ErlNifTime begun = enif_monotonic_time(ERL_NIF_NSEC);
    struct patience patience = { .until = begun + PATIENCE_NS, .looked = begun };
    enum blobs_result result = search(&job, &job.kept->scratch, late, &patience);

    if (result == BLOBS_PAUSED)
        return enif_schedule_nif(env, "find", dirty, find_rest, argc, argv);
    ErlNifTime slices = (enif_monotonic_time(ERL_NIF_NSEC) - begun) / SLICE_NS;

    (void)enif_consume_timeslice(env, slices < 1 ? 1 : slices > 100 ? 100 : (int)slices);
    return finish(env, result, job.kept);
}

static int open_type(ErlNifEnv *env)
{
    int flags = ERL_NIF_RT_CREATE | ERL_NIF_RT_TAKEOVER;

    kept_type = enif_open_resource_type(env, NULL, KEPT_TYPE, release, flags, NULL);
    return kept_type ? 0 : -1;
}

static int load(ErlNifEnv *env, void **data, ERL_NIF_TERM info)
{
    (void)data;
    (void)info;
    return open_type(env);
}

/* The module may be loaded again; scratch memory of the module before it remains good. */
static int upgrade(ErlNifEnv *env, void **data, void **old_data, ERL_NIF_TERM info)
{
    (void)data;
    (void)old_data;
    (void)info;
    return open_type(env);
}

static ErlNifFunc functions[] = {
    { "loaded?", 0, loaded, 0 },
    { "new", 0, new, 0 },
    { "held", 1, held, 0 },
    { "find", 8, find, 0 },
};

ERL_NIF_INIT(Elixir.Vision.Backend.Native, functions, load, NULL, upgrade, NULL)
