// sources: ../c_src/y4m.c
/* Right, wrong and random header lines, and the planes of 4:2:2 as yuyv, under sanitizers. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "y4m.h"

static void check(int right, const char *what)
{
    if (!right) {
        fprintf(stderr, "y4m_test: %s\n", what);
        exit(1);
    }
}

/* In a block of its own, without a zero at its end. */
static int read_line(const char *line, size_t length, struct y4m *header)
{
    char *copy = malloc(length ? length : 1);

    memcpy(copy, line, length);
    int result = y4m_header(copy, length, header);

    free(copy);
    return result;
}

static void headers(void)
{
    struct y4m h;
    const char *right = "YUV4MPEG2 W412 H356 F25:1 Ip A0:0 C422 XYSCSS=422 XCOLORRANGE=FULL";
    const char *wrong[] = {
        "", "YUV4MPEG2 ", "YUV4MPEG W2 H2", "YUV4MPEG2 W2", "YUV4MPEG2 W3 H2", "YUV4MPEG2 W2 H3 C420",
        "YUV4MPEG2 W2 H2 C444", "YUV4MPEG2 W99999999999 H2", "YUV4MPEG2 W40000 H2", "YUV4MPEG2 W32768 H32768", "YUV4MPEG2 Wx H2",
        "YUV4MPEG2 W2 H2 F25", "YUV4MPEG2 W2 H2 F", "YUV4MPEG2 W-2 H2", "YUV4MPEG2 W", "YUV4MPEG2 W2 H2 F1:",
    };

    check(read_line(right, strlen(right), &h) == 0, "a right header was refused");
    check(h.width == 412 && h.height == 356 && h.rate == 25 && h.per == 1, "numbers misread");
    check(h.chroma == Y4M_422 && y4m_size(&h) == 2 * 412 * 356, "4:2:2 misread");
    check(read_line("YUV4MPEG2 W2 H2", 15, &h) == 0 && y4m_size(&h) == 6, "4:2:0 is the default");
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        check(read_line(wrong[k], strlen(wrong[k]), &h) != 0, wrong[k]);

    char line[80];

    srand(1);
    for (int k = 0; k < 100000; k++) {
        size_t length = strlen(right);

        memcpy(line, right, length);
        for (int change = rand() % 4; change >= 0; change--)
            line[rand() % length] = (char)rand();
        read_line(line, (size_t)rand() % (length + 1), &h);
    }
}

static void planes(void)
{
    struct y4m h = { .width = 4, .height = 1, .chroma = Y4M_422 };
    uint8_t *out = malloc(8);

    y4m_yuyv(&h, (const uint8_t[]){ 1, 2, 3, 4, 50, 51, 60, 61 }, out);
    check(memcmp(out, (uint8_t[]){ 1, 50, 2, 60, 3, 51, 4, 61 }, 8) == 0, "yuyv is wrong");
    free(out);
}

int main(void)
{
    headers();
    planes();
    return 0;
}
