/* Masks by AVX-512 with VBMI: whole tables in registers. */
#include "masks_ways.h"

#if defined(__x86_64__)
#include <immintrin.h>

#define ALWAYS static inline __attribute__((always_inline))
#define AVX512 __attribute__((target("avx512f,avx512bw,avx512vbmi")))

AVX512 ALWAYS void load_table(const uint8_t table[256], __m512i parts[4])
{
    for (int k = 0; k < 4; k++)
        parts[k] = _mm512_loadu_si512(table + 64 * k);
}

AVX512 ALWAYS __m512i look_up(const __m512i parts[4], __m512i value)
{
    __m512i low = _mm512_permutex2var_epi8(parts[0], value, parts[1]);
    __m512i high = _mm512_permutex2var_epi8(parts[2], value, parts[3]);

    return _mm512_mask_blend_epi8(_mm512_movepi8_mask(value), low, high);
}

/* Permutations that take every `by`-th byte from `first` on, each `over` times. */
#define AT(k, first, by, over) first + (k) / over * by
#define FOUR(k, ...) AT(k, __VA_ARGS__), AT(k + 1, __VA_ARGS__), AT(k + 2, __VA_ARGS__), AT(k + 3, __VA_ARGS__)
#define SIXTEEN(k, ...) FOUR(k, __VA_ARGS__), FOUR(k + 4, __VA_ARGS__), FOUR(k + 8, __VA_ARGS__), FOUR(k + 12, __VA_ARGS__)
#define EVERY(...) \
    { SIXTEEN(0, __VA_ARGS__), SIXTEEN(16, __VA_ARGS__), SIXTEEN(32, __VA_ARGS__), SIXTEEN(48, __VA_ARGS__) }

static const uint8_t even[64] = EVERY(0, 2, 1), odd[64] = EVERY(1, 2, 1), twice[2][64] = { EVERY(0, 1, 2), EVERY(32, 1, 2) };
static const uint8_t packed[64] = { SIXTEEN(0, 1, 4, 1), SIXTEEN(16, 1, 4, 1), SIXTEEN(0, 3, 4, 1), SIXTEEN(16, 3, 4, 1) };

/* Bytes of 128. */
AVX512 ALWAYS __m512i bytes_at(const uint8_t *from, const uint8_t at[64])
{
    return _mm512_permutex2var_epi8(_mm512_loadu_si512(from), _mm512_loadu_si512(at), _mm512_loadu_si512(from + 64));
}

/* The U and V of 64 pairs of pixels. */
AVX512 ALWAYS void take_chroma(struct masks_pixels at, size_t y_step, size_t step, __m512i out[2])
{
    if (y_step == 2) {
        __m512i one = bytes_at(at.y, packed), two = bytes_at(at.y + 128, packed);

        out[0] = _mm512_shuffle_i64x2(one, two, 0x44);
        out[1] = _mm512_shuffle_i64x2(one, two, 0xEE);
    } else if (step == 2) {
        out[0] = bytes_at(at.u, even);
        out[1] = bytes_at(at.u, odd);
    } else {
        out[0] = _mm512_loadu_si512(at.u);
        out[1] = _mm512_loadu_si512(at.v);
    }
}

/* The planes that may have a class in 64 pairs, a bit each. */
AVX512 ALWAYS unsigned may_have(const __m512i cells[2], __m512i u, __m512i v)
{
    const __m512i upper = _mm512_set1_epi8((char)0xF0);
    __m512i cell = _mm512_ternarylogic_epi64(upper, u, _mm512_srli_epi16(v, 4), 0xCA);
    __m512i half = _mm512_mask_blend_epi8(_mm512_movepi8_mask(u), _mm512_set1_epi8(15), upper);
    __m512i near = _mm512_and_si512(_mm512_permutex2var_epi8(cells[0], cell, cells[1]), half);
    unsigned may = 0;

    if (_mm512_test_epi8_mask(near, near))
        for (int plane = 0; plane < MASKS_PLANES; plane++)
            may |= (unsigned)(_mm512_test_epi8_mask(near, _mm512_set1_epi8((char)(0x11 << plane))) != 0) << plane;
    return may;
}

/* Of 64 pixels from `from` on those before `end`. */
static inline uint64_t before(size_t end, size_t from)
{
    return end <= from ? 0 : end - from >= 64 ? UINT64_MAX : (UINT64_C(1) << (end - from)) - 1;
}

AVX512 ALWAYS void find_avx512_by(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                                  struct masks_row *here, int planes, size_t y_step, size_t step)
{
    size_t width = picture->width;
    struct masks_pixels begin = masks_pixels(picture, row);
    __m512i parts[3][4], cells[2];

    for (int k = 0; k < 3; k++)
        load_table(tables->bytes[0] + 256 * k, parts[k]);
    for (int k = 0; k < 2; k++)
        cells[k] = _mm512_loadu_si512(tables->cells + 64 * k);
    for (size_t x = 0; x < width; x += 128) {
        size_t left = width - x, word = x / 64;
        struct masks_pixels at = { begin.y + x * y_step, begin.u + x / 2 * step, begin.v + x / 2 * step };
        uint8_t copy[3][2 * MASKS_LANES];
        __m512i chroma[2];
        uint64_t on[2] = { 0 };
        unsigned found[2] = { 0 };

        if (left < 128)
            at = masks_last(at, left, y_step, step, copy);
        take_chroma(at, y_step, step, chroma);
        if (planes > 1) {
            masks_clear(here, planes, word);
            masks_clear(here, planes, word + 1);
        }
        for (unsigned may = planes > 1 ? may_have(cells, chroma[0], chroma[1]) : 1; may; may &= may - 1) {
            int plane = planes == 1 ? 0 : __builtin_ctz(may);

            for (int k = 1; k < 3 && planes > 1; k++)
                load_table(tables->bytes[plane] + 256 * k, parts[k]);
            __m512i pairs = _mm512_and_si512(look_up(parts[1], chroma[0]), look_up(parts[2], chroma[1]));

            if (_mm512_test_epi8_mask(pairs, pairs) == 0) {
                if (planes == 1) {
                    masks_clear(here, 1, word);
                    masks_clear(here, 1, word + 1);
                }
                continue;
            }
            if (planes > 1)
                load_table(tables->bytes[plane], parts[0]);
#pragma GCC unroll 2
            for (int k = 0; k < 2; k++) {
                const uint8_t *y = at.y + 64 * k * y_step;
                __m512i value = y_step == 2 ? bytes_at(y, even) : _mm512_loadu_si512(y);
                __m512i mask = _mm512_permutexvar_epi8(_mm512_loadu_si512(twice[k]), pairs);

                mask = _mm512_and_si512(mask, look_up(parts[0], value));
                _mm512_store_si512(here->planes[plane] + x + 64 * k, mask);
                uint64_t set = _mm512_test_epi8_mask(mask, mask);

                on[k] |= set;
                found[k] |= (unsigned)(set != 0) << plane;
            }
        }
#pragma GCC unroll 2
        for (int k = 0; k < 2; k++) {
            here->on[word + k] = left < 128 ? on[k] & before(left, 64 * k) : on[k];
            if (planes > 1)
                here->planes_on[word + k] = (uint8_t)found[k];
        }
    }
}

AVX512 static void find_avx512(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                               struct masks_row *here)
{
    if (tables->planes == 1 && picture->y_step == 2)
        find_avx512_by(tables, picture, row, here, 1, 2, 4);
    else if (picture->y_step == 2)
        find_avx512_by(tables, picture, row, here, MASKS_PLANES, 2, 4);
    else if (tables->planes == 1 && picture->chroma_step == 1)
        find_avx512_by(tables, picture, row, here, 1, 1, 1);
    else
        find_avx512_by(tables, picture, row, here, MASKS_PLANES, picture->y_step, picture->chroma_step);
}

AVX512 static void link_avx512(int planes, size_t words, const struct masks_row *above, struct masks_row *here)
{
    for (size_t word = 0; word < words; word++) {
        __mmask64 left = here->on[word], over = left;

        for (unsigned some = masks_to_compare(planes, word, above, here); some; some &= some - 1) {
            int plane = __builtin_ctz(some);
            const uint8_t *at = here->planes[plane] + 64 * word;
            __m512i one = _mm512_loadu_si512(at);

            left = _mm512_mask_cmpeq_epi8_mask(left, one, _mm512_loadu_si512(at - 1));
            over = _mm512_mask_cmpeq_epi8_mask(over, one, _mm512_loadu_si512(above->planes[plane] + 64 * word));
        }
        here->left[word] = left;
        here->above[word] = over;
    }
}

void masks_avx512(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                  const struct masks_row *above, struct masks_row *here)
{
    find_avx512(tables, picture, row, here);
    link_avx512(tables->planes, (picture->width + 63) / 64, above, here);
}
#endif
