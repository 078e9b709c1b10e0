// sources: ../c_src/particles.c
/* Random particles under the sanitizers, also outside of the map; the best of them is where the readings were taken. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "particles.h"

#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) {                                                                    \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                    \
            exit(1);                                                                           \
        }                                                                                      \
    } while (0)

#define WIDE 50
#define HIGH 30
#define COUNT 200

static uint32_t state = 1;

static double draw(double low, double high)
{
    state = state * 1664525u + 1013904223u;
    return low + (state >> 8) / 16777216.0 * (high - low);
}

int main(void)
{
    uint8_t *clear = malloc(WIDE * HIGH);
    CHECK(clear != NULL);
    for (int y = 0; y < HIGH; y++)
        for (int x = 0; x < WIDE; x++) {
            int side = x < WIDE - 1 - x ? x : WIDE - 1 - x, top = y < HIGH - 1 - y ? y : HIGH - 1 - y;
            int cells = side < top ? side : top;
            clear[y * WIDE + x] = (uint8_t)(cells == 0 ? 0 : (int)((cells - 0.71) * 5));
        }
    particles_map map = {clear, WIDE, HIGH, 0.1, -1.0, 2.0};
    int16_t tables[2 * PARTICLES_TABLE];
    for (int k = 0; k < 2 * PARTICLES_TABLE; k++)
        tables[k] = (int16_t)-abs(k % PARTICLES_TABLE - PARTICLES_TABLE / 2);

    for (int run = 0; run < 200; run++) {
        particles_pose poses[COUNT];
        double far = run % 7 == 0 ? 1.0e6 : 3.0;
        particles_scatter(poses, COUNT, &map, 10, 0.05, (uint32_t)run);
        for (int k = 0; k < COUNT; k++)
            CHECK(poses[k].x > -1.0 && poses[k].x < 4.0 && poses[k].y > 2.0 && poses[k].y < 5.0 && fabs(poses[k].slip) < 0.2);
        particles_step step = {draw(-far, far), draw(-far, far), draw(-9, 9), draw(0, 9), 0.02, 0.01, 0.01};
        particles_move(poses, COUNT, &step, (uint32_t)run);
        particles_reading readings[3];
        for (int n = 0; n < 3; n++) {
            particles_reading reading = {draw(-0.2, 0.2), draw(-0.2, 0.2), {{0}}, draw(0, 5), draw(0, 100), n > 0};
            for (int r = 0; r < PARTICLES_RAYS; r++) {
                double angle = draw(-3, 3);
                reading.rays[r][0] = cos(angle);
                reading.rays[r][1] = sin(angle);
            }
            readings[n] = reading;
        }
        int32_t weighed[2 * COUNT];
        particles_weigh(poses, COUNT, &map, readings, 3, tables, weighed);
        for (int k = 0; k < COUNT; k++)
            CHECK(weighed[2 * k] <= 0 && weighed[2 * k] >= -65536 && weighed[2 * k + 1] >= 0 && weighed[2 * k + 1] <= 2);
    }

    /* Inside, and inside of a wall. */
    particles_pose two[2] = {{1.0, 3.5, 0.0, 0.0}, {-0.98, 3.5, 0.0, 0.0}};
    particles_reading ahead = {0.0, 0.0, {{1, 0}, {1, 0}, {1, 0}, {1, 0}, {1, 0}}, 2.9, 5.0, 1.0};
    int32_t weighed[4];
    particles_weigh(two, 2, &map, &ahead, 1, tables, weighed);
    CHECK(weighed[0] > -6 && weighed[1] == 1 && weighed[2] == -65536 && weighed[3] == 0);
    free(clear);
    return 0;
}
