// sources: ../c_src/similar.c ../c_src/similar_fit.c ../c_src/similar_read.c
/* Self-similar marks of all sizes, whole and cut, turned, under noise, and pictures of chance through the search under
   sanitizers. The pixels are in blocks of exactly their size, so that a read beyond them is seen. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "similar.h"

static uint32_t seed = 1;

static uint32_t random_below(uint32_t n)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % n;
}

static void fail(const char *what)
{
    fprintf(stderr, "similar_test: %s (seed %u)\n", what, seed);
    exit(1);
}

struct seen {
    int count, right;
};

/* The id of all marks here, and its word. */
enum { ID = 5 };
static const int word[8] = { 0, 1, 0, 0, 1, 0, 0, 0 };

static int black(double x, double y)
{
    if (y < 0.0 || y >= 1.0 || x < similar_edges[SIMILAR_EDGES - 1] || x >= 2.0)
        return 0;
    if (x >= 1.2)
        return word[(int)((x - 1.2) * 10.0)];
    int k = 0;

    while (x < similar_edges[k + 1])
        k++;
    return k % 2 == 0;
}

/* A mark that is so many pixels wide, with its upper left corner there, on white; each row is pushed aside by `aside`. */
static void draw(uint8_t *pixels, uint32_t width, uint32_t height, double size, double left, double top, double aside)
{
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            int sum = 0;

            for (int k = 0; k < 16; k++) {
                double px = x + (k % 4) / 4.0 - 0.375, py = y + (k / 4) / 4.0 - 0.375;

                sum += black((px - left - aside * (py - top)) / size, (py - top) / size);
            }
            pixels[y * width + x] = (uint8_t)(230 - 12 * sum);
        }
}

static void count(const struct marks_found *found, void *context)
{
    struct seen *seen = context;

    seen->count++;
    seen->right += found->id == ID;
}

static struct seen find(const uint8_t *pixels, uint32_t width, uint32_t height)
{
    struct seen seen = { 0, 0 };
    struct marks_luma luma = { pixels, 1, width, width, height };

    if (similar_find(&luma, count, &seen) != 0)
        fail("no memory");
    return seen;
}

static void whole(void)
{
    const uint32_t width = 240, height = 140;
    uint8_t *pixels = malloc(width * height);

    for (int n = 0; n < 60; n++) {
        double size = 28.0 + random_below(600) / 10.0, aside = random_below(200) / 1000.0 - 0.1;

        draw(pixels, width, height, size, 20.0 + random_below(100) / 10.0, 14.0 + random_below(100) / 10.0, aside);
        struct seen seen = find(pixels, width, height);

        if (seen.count != 1 || seen.right != 1)
            fail("a mark was not read");
    }
    free(pixels);
}

/* Of any size, anywhere, also beyond the edges, with noise: nothing wrong is read. */
static void cut(void)
{
    for (int n = 0; n < 300; n++) {
        uint32_t width = 16 + random_below(200), height = 16 + random_below(120), noise = 1 + random_below(80);
        uint8_t *pixels = malloc((size_t)width * height);

        draw(pixels, width, height, 10.0 + random_below(100), random_below(width) - 40.0, random_below(height) - 40.0,
             random_below(1000) / 1000.0 - 0.5);
        for (uint32_t k = 0; k < width * height; k++)
            pixels[k] = (uint8_t)(pixels[k] / 2 + random_below(noise));
        struct seen seen = find(pixels, width, height);

        if (seen.count != seen.right)
            fail("a wrong id was read");
        free(pixels);
    }
}

/* Nothing but steps, stripes and noise. */
static void chance(void)
{
    for (int n = 0; n < 300; n++) {
        uint32_t width = 16 + random_below(200), height = 16 + random_below(120), kind = random_below(3), wide = 1;
        uint8_t *pixels = malloc((size_t)width * height), value = 0;

        for (uint32_t k = 0; k < width * height; k++) {
            if (kind == 1 && k >= width) {
                pixels[k] = pixels[k - width];
                continue;
            }
            if (kind == 0 || --wide == 0) {
                value = kind == 2 ? (uint8_t)random_below(256) : random_below(2) ? 230 : 20;
                wide = 1 + random_below(12);
            }
            pixels[k] = value;
        }
        if (find(pixels, width, height).count != 0)
            fail("a mark was read where there is none");
        free(pixels);
    }
}

int main(void)
{
    whole();
    cut();
    chance();
    return 0;
}
