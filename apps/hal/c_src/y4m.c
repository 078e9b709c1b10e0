#include "y4m.h"

#include <string.h>

#define LARGEST 32768u
#define MOST_PIXELS (64u << 20)
#define MAGIC "YUV4MPEG2 "

/* Reads a number of at most nine digits, and moves *at behind it. -1 if there is none. */
static int number(const char **at, const char *end, uint32_t *value)
{
    const char *start = *at;

    *value = 0;
    for (; *at < end && **at >= '0' && **at <= '9'; (*at)++) {
        if (*at - start == 9)
            return -1;
        *value = 10 * *value + (uint32_t)(**at - '0');
    }
    return *at == start ? -1 : 0;
}

static int starts(const char *at, const char *end, const char *text)
{
    size_t length = strlen(text);

    return (size_t)(end - at) >= length && memcmp(at, text, length) == 0;
}

int y4m_header(const char *line, size_t length, struct y4m *header)
{
    const char *at = line, *end = line + length;

    if (!starts(at, end, MAGIC))
        return -1;
    *header = (struct y4m){ .per = 1, .chroma = Y4M_420 };
    at += strlen(MAGIC);
    while (at < end) {
        char tag = *at++;

        if (tag == 'W' && number(&at, end, &header->width) != 0)
            return -1;
        if (tag == 'H' && number(&at, end, &header->height) != 0)
            return -1;
        if (tag == 'F' && (number(&at, end, &header->rate) != 0 || at == end || *at++ != ':' ||
                           number(&at, end, &header->per) != 0))
            return -1;
        if (tag == 'C') {
            if (starts(at, end, "422"))
                header->chroma = Y4M_422;
            else if (!starts(at, end, "420"))
                return -1;
        }
        while (at < end && *at != ' ')
            at++;
        while (at < end && *at == ' ')
            at++;
    }
    if (header->per == 0)
        header->per = 1;
    if (header->width == 0 || header->height == 0 || header->width > LARGEST ||
        header->height > LARGEST || header->width % 2 ||
        (uint64_t)header->width * header->height > MOST_PIXELS)
        return -1;
    return header->chroma == Y4M_420 && header->height % 2 ? -1 : 0;
}

size_t y4m_size(const struct y4m *header)
{
    size_t pixels = (size_t)header->width * header->height;

    return header->chroma == Y4M_422 ? 2 * pixels : pixels + pixels / 2;
}

void y4m_yuyv(const struct y4m *header, const uint8_t *restrict planes, uint8_t *restrict yuyv)
{
    size_t pixels = (size_t)header->width * header->height;
    const uint8_t *y = planes, *u = planes + pixels, *v = u + pixels / 2;

    for (size_t k = 0; k < pixels / 2; k++) {
        yuyv[4 * k] = y[2 * k];
        yuyv[4 * k + 1] = u[k];
        yuyv[4 * k + 2] = y[2 * k + 1];
        yuyv[4 * k + 3] = v[k];
    }
}
