#ifndef Y4M_H
#define Y4M_H

#include <stddef.h>
#include <stdint.h>

/* A stream of raw pictures as `ffmpeg -f yuv4mpegpipe` writes it: one header line with the size,
   then, for each picture, a line FRAME and its planes Y, U, V. */

enum y4m_chroma { Y4M_420, Y4M_422 };

struct y4m {
    uint32_t width, height;
    uint32_t rate, per;         /* rate / per pictures a second; 0 / 1 if unknown */
    enum y4m_chroma chroma;
};

/* Reads the header line, without its line end; 0, or -1 if it is wrong or of another kind. */
int y4m_header(const char *line, size_t length, struct y4m *header);

/* Bytes of a picture: for 4:2:2 the same number as planes and as yuyv. */
size_t y4m_size(const struct y4m *header);

/* Converts planes of 4:2:2 to yuyv. Both have y4m_size bytes. */
void y4m_yuyv(const struct y4m *header, const uint8_t *restrict planes, uint8_t *restrict yuyv);

#endif
