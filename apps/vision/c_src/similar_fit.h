/* A self-similar pattern in a picture, fitted to the edges that are seen. Vision.Marks.Similar.Fit does the same. */
#ifndef SIMILAR_FIT_H
#define SIMILAR_FIT_H

#include "similar.h"

enum { SIMILAR_TERMS = 5, SIMILAR_CELLS = 8 };

/* Edges that are nearer to each other, in pixels, are not looked for. */
#define SIMILAR_NEAREST 1.8

/* x (to the right) and y (down) of the picture are u and v here: pattern widths from a point of the line of origins.
   The place in the pattern is t = (a u + b v + c) / (d u + e v + 1), as a plane seen in perspective has it. */
struct similar_pattern {
    const struct marks_luma *luma;
    const struct similar_chain *chain;
    double x, y, m[SIMILAR_TERMS];
    double threshold, contrast;
    double ends[2][2];          /* v = ends[.][0] + ends[.][1] u: where the stripes end above, and below: by the reading */
};

/* The pattern whose origins these are; 0 if there is none. */
int similar_fit(const struct marks_luma *luma, const struct similar_chain *chain, struct similar_pattern *pattern);

/* Where in a row of the picture the pattern is at t. */
double similar_column(const struct similar_pattern *pattern, double t, double y);

/* The luma there; -1 outside of the picture. */
double similar_look(const struct similar_pattern *pattern, double t, int64_t y);

#endif
