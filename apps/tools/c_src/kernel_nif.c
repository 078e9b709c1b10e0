/* Times the blob finder of the vision app without the call from Elixir, and a copy of the same frames.
   For Bench.Vision.Kernel; in no release. */
#include <erl_nif.h>
#include <stdlib.h>
#include <string.h>

#include "../../vision/c_src/blobs.h"

static ErlNifTime now(void)
{
    return enif_monotonic_time(ERL_NIF_NSEC);
}

static ERL_NIF_TERM loaded(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    (void)argc;
    (void)argv;
    return enif_make_atom(env, "true");
}

/* find(frames, width, height, tables, min_area): {nanoseconds, regions} of each yuyv frame. The first
   is searched once before, untimed, so that the scratch has its size. */
static ERL_NIF_TERM find(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    unsigned width, height, min_area;
    ErlNifBinary bytes, tables;
    uint32_t aligned[768];
    struct blobs_scratch scratch = { 0 };
    struct blobs_picture picture;
    ERL_NIF_TERM frames = argv[0], frame, answers = enif_make_list(env, 0);
    int well = 1, first = 1;

    if (argc != 5 || !enif_get_uint(env, argv[1], &width) || !enif_get_uint(env, argv[2], &height) ||
        !enif_inspect_binary(env, argv[3], &tables) || tables.size != sizeof aligned ||
        !enif_get_uint(env, argv[4], &min_area))
        return enif_make_badarg(env);
    memcpy(aligned, tables.data, sizeof aligned);
    while (well && enif_get_list_cell(env, frames, &frame, &frames)) {
        well = enif_inspect_binary(env, frame, &bytes) &&
               blobs_lay(BLOBS_YUYV, width, height, bytes.data, bytes.size, &picture) == 0 &&
               (!first || blobs_find(&picture, aligned, min_area, 0, &scratch, NULL, NULL) == BLOBS_DONE);
        first = 0;
        ErlNifTime begun = now();

        well = well && blobs_find(&picture, aligned, min_area, 0, &scratch, NULL, NULL) == BLOBS_DONE;
        ERL_NIF_TERM took = enif_make_int64(env, now() - begun);
        ERL_NIF_TERM answer = enif_make_tuple2(env, took, enif_make_uint64(env, scratch.count));

        answers = enif_make_list_cell(env, answer, answers);
    }
    blobs_release(&scratch);
    return well ? answers : enif_make_badarg(env);
}

/* copy(frames): the nanoseconds of a memcpy of each frame, to a place that was written before. */
static ERL_NIF_TERM copy(ErlNifEnv *env, int argc, const ERL_NIF_TERM argv[])
{
    ErlNifBinary bytes;
    size_t room = 0;
    unsigned char *to = NULL;
    ERL_NIF_TERM frames = argv[0], frame, times = enif_make_list(env, 0);
    int well = 1;

    (void)argc;
    while (well && enif_get_list_cell(env, frames, &frame, &frames)) {
        well = enif_inspect_binary(env, frame, &bytes) != 0;
        if (well && bytes.size > room) {
            free(to);
            room = bytes.size;
            to = malloc(room);
            well = to != NULL;
            if (well)
                memset(to, 1, room);
        }
        if (!well)
            break;
        ErlNifTime begun = now();

        memcpy(to, bytes.data, bytes.size);
        __asm__ volatile("" : : "r"(to) : "memory");
        times = enif_make_list_cell(env, enif_make_int64(env, now() - begun), times);
    }
    free(to);
    return well ? times : enif_make_badarg(env);
}

/* On the caller's scheduler, as the call that they are compared with; a robot must not do that. */
static ErlNifFunc functions[] = {
    { "loaded?", 0, loaded, 0 },
    { "find", 5, find, 0 },
    { "copy", 1, copy, 0 },
};

ERL_NIF_INIT(Elixir.Bench.Vision.Kernel, functions, NULL, NULL, NULL, NULL)
