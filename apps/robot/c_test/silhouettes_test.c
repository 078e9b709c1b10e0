// sources: ../c_src/silhouettes.c
/* Random fleets under the sanitizers: sets stay within the picture, and a robot right ahead fills its middle. */
#include <stdio.h>
#include <stdlib.h>

#include "silhouettes.h"

#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) {                                                                    \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                    \
            exit(1);                                                                           \
        }                                                                                      \
    } while (0)

static uint64_t state = 88172645463325252u;

static double draw(double low, double high)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return low + (double)(state >> 40) / (double)(1 << 24) * (high - low);
}

int main(void)
{
    for (int run = 0; run < 20000; run++) {
        size_t count = (size_t)draw(0, 9);
        silhouettes_body *bodies = malloc(count > 0 ? count * sizeof *bodies : 1);
        double far = run % 7 == 0 ? 1.0e9 : 3.0;
        CHECK(bodies != NULL);
        for (size_t k = 0; k < count; k++) {
            silhouettes_body body = {draw(-far, far), draw(-far, far), draw(-0.1, 0.5), draw(-0.1, far)};
            bodies[k] = body;
        }
        silhouettes_search search = {{draw(-far, far), draw(-1, 1), draw(-9, 9)}, {draw(-1, 1), draw(-1, 1), draw(-9, 9)},
                                     draw(-1, 1), draw(-1, 1), draw(-3, 3), draw(-2, 2), draw(-far, far)};
        uint64_t seen = (uint64_t)draw(0, 1e9) << 20;
        int wrong, clear;
        silhouettes_try(&search, seen, bodies, count, draw(-3, 3), &wrong, &clear);
        CHECK(wrong >= 0 && wrong <= SILHOUETTES_COLUMNS);
        CHECK(clear >= 0 && clear <= __builtin_popcountll(seen));
        free(bodies);
    }

    silhouettes_body ahead = {2.0, 0.0, 0.2, 0.1};
    silhouettes_search search = {{0, 0, 0}, {0, 0, 0}, 1.0, 0.0, 0.0, 0.0, 51.0};
    int wrong, clear;
    silhouettes_try(&search, UINT64_C(1) << 29, &ahead, 1, 0.0, &wrong, &clear);
    CHECK(wrong == 10 && clear == 1);
    silhouettes_try(&search, UINT64_C(1) << 29, &ahead, 1, 3.0, &wrong, &clear);
    CHECK(wrong == 1 && clear == 1);
    return 0;
}
