/* What the searches for marks take from Elixir, and give back. */
#ifndef MARKS_TERMS_H
#define MARKS_TERMS_H

#include <erl_nif.h>

#include "marks.h"

/* format, width, height, bytes, {left, top, right, bottom}: the first column and row of the box, and those behind the last. */
int marks_get_luma(ErlNifEnv *env, const ERL_NIF_TERM argv[], struct marks_luma *luma);

/* A list of {id, wrong bits, margin, {x, y}, corners}, the last mark first. `marks_put` is a `marks_report` for it. */
struct marks_list {
    ErlNifEnv *env;
    ERL_NIF_TERM term;
};

void marks_put(const struct marks_found *found, void *list);

#endif
