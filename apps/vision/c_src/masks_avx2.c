/* Masks by AVX2: ranges, by the halves of a value. */
#include "masks_ways.h"

#if defined(__x86_64__)
#include <immintrin.h>

#define ALWAYS static inline __attribute__((always_inline))
#define AVX2 __attribute__((target("avx2")))

AVX2 ALWAYS __m256i ranges(const uint8_t halves[5][16], __m256i value)
{
    const __m256i four = _mm256_set1_epi8(15);
    __m256i low = _mm256_and_si256(value, four), high = _mm256_and_si256(_mm256_srli_epi16(value, 4), four);
    __m256i table[5];

    for (int k = 0; k < 5; k++)
        table[k] = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)halves[k]));
    __m256i first = _mm256_and_si256(_mm256_shuffle_epi8(table[1], high), _mm256_shuffle_epi8(table[2], low));
    __m256i last = _mm256_and_si256(_mm256_shuffle_epi8(table[3], high), _mm256_shuffle_epi8(table[4], low));

    return _mm256_or_si256(_mm256_shuffle_epi8(table[0], high), _mm256_or_si256(first, last));
}

/* The upper or lower bytes of 32 words, in the order of the halves of two vectors. */
AVX2 ALWAYS __m256i bytes_of(__m256i a, __m256i b, int upper)
{
    const __m256i low = _mm256_set1_epi16(0xFF);

    return upper ? _mm256_packus_epi16(_mm256_srli_epi16(a, 8), _mm256_srli_epi16(b, 8))
                 : _mm256_packus_epi16(_mm256_and_si256(a, low), _mm256_and_si256(b, low));
}

/* The U and V of 32 pairs of pixels. */
AVX2 ALWAYS void take_chroma(struct masks_pixels at, size_t y_step, size_t step, __m256i out[2])
{
    const __m256i *from = (const __m256i *)(y_step == 2 ? at.y : at.u);

    if (y_step == 2) {
        const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
        __m256i one = bytes_of(_mm256_loadu_si256(from), _mm256_loadu_si256(from + 1), 1);
        __m256i two = bytes_of(_mm256_loadu_si256(from + 2), _mm256_loadu_si256(from + 3), 1);

        for (int k = 0; k < 2; k++)
            out[k] = _mm256_permutevar8x32_epi32(bytes_of(one, two, k), order);
    } else if (step == 2) {
        for (int k = 0; k < 2; k++)
            out[k] = _mm256_permute4x64_epi64(bytes_of(_mm256_loadu_si256(from), _mm256_loadu_si256(from + 1), k), 0xD8);
    } else {
        out[0] = _mm256_loadu_si256(from);
        out[1] = _mm256_loadu_si256((const __m256i *)at.v);
    }
}

/* The Y of 32 pixels. */
AVX2 ALWAYS __m256i take_luma(const uint8_t *y, size_t y_step)
{
    const __m256i *from = (const __m256i *)y;

    if (y_step == 1)
        return _mm256_loadu_si256(from);
    return _mm256_permute4x64_epi64(bytes_of(_mm256_loadu_si256(from), _mm256_loadu_si256(from + 1), 0), 0xD8);
}

/* Whether any of 32 pairs lies in a cell of these columns; `high` is the upper half of U, `bit` the bit of that of V. */
AVX2 ALWAYS unsigned in_cells(const uint8_t columns[2][16], __m256i high, __m256i v, __m256i bit)
{
    __m256i below = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)columns[0]));
    __m256i from = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)columns[1]));
    __m256i column = _mm256_blendv_epi8(_mm256_shuffle_epi8(below, high), _mm256_shuffle_epi8(from, high), v);

    return !_mm256_testz_si256(column, bit);
}

/* The planes that may have a class in 32 pairs, a bit each. */
AVX2 ALWAYS unsigned may_have(const struct masks_tables *tables, __m256i u, __m256i v)
{
    const __m256i four = _mm256_set1_epi8(15), bits = _mm256_set1_epi64x((long long)UINT64_C(0x8040201008040201));
    __m256i high = _mm256_and_si256(_mm256_srli_epi16(u, 4), four);
    __m256i bit = _mm256_shuffle_epi8(bits, _mm256_and_si256(_mm256_srli_epi16(v, 4), four));
    unsigned may = 0;

    if (in_cells(tables->columns[MASKS_PLANES], high, v, bit))
        for (int plane = 0; plane < MASKS_PLANES; plane++)
            may |= in_cells(tables->columns[plane], high, v, bit) << plane;
    return may;
}

AVX2 ALWAYS void find_avx2_by(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                              struct masks_row *here, int planes, size_t y_step, size_t step)
{
    size_t width = picture->width;
    struct masks_pixels begin = masks_pixels(picture, row);

    for (size_t x = 0; x < width; x += 64) {
        size_t left = width - x;
        struct masks_pixels at = { begin.y + x * y_step, begin.u + x / 2 * step, begin.v + x / 2 * step };
        uint8_t copy[3][2 * MASKS_LANES];
        __m256i chroma[2];
        uint64_t on = 0;
        unsigned found = 0;

        if (left < 64)
            at = masks_last(at, left, y_step, step, copy);
        take_chroma(at, y_step, step, chroma);
        if (planes > 1)
            masks_clear(here, planes, x / 64);
        for (unsigned may = planes > 1 ? may_have(tables, chroma[0], chroma[1]) : 1; may; may &= may - 1) {
            int plane = planes == 1 ? 0 : __builtin_ctz(may);
            uint8_t *out = here->planes[plane] + x;
            __m256i pairs = _mm256_and_si256(ranges(tables->halves[plane][1], chroma[0]),
                                             ranges(tables->halves[plane][2], chroma[1]));

            if (_mm256_testz_si256(pairs, pairs)) {
                if (planes == 1)
                    masks_clear(here, 1, x / 64);
                continue;
            }
            pairs = _mm256_permute4x64_epi64(pairs, 0xD8);
            for (int k = 0; k < 64; k += 32) {
                __m256i mask = k ? _mm256_unpackhi_epi8(pairs, pairs) : _mm256_unpacklo_epi8(pairs, pairs);

                mask = _mm256_and_si256(mask, ranges(tables->halves[plane][0], take_luma(at.y + k * y_step, y_step)));
                _mm256_store_si256((__m256i *)(out + k), mask);
                mask = _mm256_cmpeq_epi8(mask, _mm256_setzero_si256());
                on |= (uint64_t)(uint32_t)~_mm256_movemask_epi8(mask) << k;
            }
            found |= 1u << plane;
        }
        here->on[x / 64] = left < 64 ? on & ((UINT64_C(1) << left) - 1) : on;
        if (planes > 1)
            here->planes_on[x / 64] = (uint8_t)found;
    }
}

AVX2 static void find_avx2(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                           struct masks_row *here)
{
    if (tables->planes == 1 && picture->y_step == 2)
        find_avx2_by(tables, picture, row, here, 1, 2, 4);
    else if (picture->y_step == 2)
        find_avx2_by(tables, picture, row, here, MASKS_PLANES, 2, 4);
    else if (tables->planes == 1 && picture->chroma_step == 1)
        find_avx2_by(tables, picture, row, here, 1, 1, 1);
    else
        find_avx2_by(tables, picture, row, here, MASKS_PLANES, picture->y_step, picture->chroma_step);
}

AVX2 static void link_avx2(int planes, size_t words, const struct masks_row *above, struct masks_row *here)
{
    for (size_t word = 0; word < words; word++) {
        uint64_t left = here->on[word], over = left;

        for (unsigned some = masks_to_compare(planes, word, above, here); some; some &= some - 1) {
            int plane = __builtin_ctz(some);
            const uint8_t *at = here->planes[plane] + 64 * word, *up = above->planes[plane] + 64 * word;
            uint64_t l = 0, o = 0;

            for (int k = 0; k < 64; k += 32) {
                __m256i one = _mm256_loadu_si256((const __m256i *)(at + k));
                __m256i before = _mm256_loadu_si256((const __m256i *)(at + k - 1));
                __m256i upper = _mm256_loadu_si256((const __m256i *)(up + k));

                l |= (uint64_t)(uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(one, before)) << k;
                o |= (uint64_t)(uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(one, upper)) << k;
            }
            left &= l;
            over &= o;
        }
        here->left[word] = left;
        here->above[word] = over;
    }
}

void masks_avx2(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row, const struct masks_row *above,
                struct masks_row *here)
{
    find_avx2(tables, picture, row, here);
    link_avx2(tables->planes, (picture->width + 63) / 64, above, here);
}
#endif
