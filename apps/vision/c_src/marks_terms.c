/* What the searches for marks take from Elixir, and give back. */
#include "marks_terms.h"

#include "blobs.h"

int marks_get_luma(ErlNifEnv *env, const ERL_NIF_TERM argv[], struct marks_luma *luma)
{
    int format, arity;
    unsigned width, height, box[4];
    ErlNifBinary bytes;
    const ERL_NIF_TERM *sides;
    struct blobs_picture picture;

    if (!enif_get_int(env, argv[0], &format) || !enif_get_uint(env, argv[1], &width) ||
        !enif_get_uint(env, argv[2], &height) || !enif_inspect_binary(env, argv[3], &bytes) ||
        !enif_get_tuple(env, argv[4], &arity, &sides) || arity != 4 ||
        blobs_lay(format, width, height, bytes.data, bytes.size, &picture) != 0)
        return 0;
    for (int k = 0; k < 4; k++)
        if (!enif_get_uint(env, sides[k], box + k))
            return 0;
    if (box[2] > width || box[3] > height || box[0] >= box[2] || box[1] >= box[3])
        return 0;
    *luma = (struct marks_luma){ .first = picture.y + box[1] * picture.y_row + box[0] * picture.y_step,
                                 .step = picture.y_step, .row = picture.y_row,
                                 .width = box[2] - box[0], .height = box[3] - box[1] };
    return luma->width >= MARKS_LEAST && luma->width <= MARKS_MOST && luma->height >= MARKS_LEAST &&
           luma->height <= MARKS_MOST;
}

void marks_put(const struct marks_found *found, void *context)
{
    struct marks_list *list = context;
    ErlNifEnv *env = list->env;
    ERL_NIF_TERM corners[4];

    for (int k = 0; k < 4; k++)
        corners[k] = enif_make_tuple2(env, enif_make_double(env, found->corners[k][0]),
                                      enif_make_double(env, found->corners[k][1]));
    ERL_NIF_TERM mark = enif_make_tuple5(env, enif_make_int(env, found->id), enif_make_int(env, found->hamming),
                                         enif_make_double(env, found->margin),
                                         enif_make_tuple2(env, enif_make_double(env, found->x),
                                                          enif_make_double(env, found->y)),
                                         enif_make_list_from_array(env, corners, 4));

    list->term = enif_make_list_cell(env, mark, list->term);
}
