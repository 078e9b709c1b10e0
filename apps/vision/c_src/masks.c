#include "masks.h"

#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#define VECTORS 1
#else
#define VECTORS 0
#endif

#define ALWAYS static inline __attribute__((always_inline))

static enum masks_way limit = MASKS_AVX512;

enum masks_way masks_limit(enum masks_way most)
{
#if VECTORS
    enum masks_way best = __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512bw") ? MASKS_AVX512
                          : __builtin_cpu_supports("avx2")                                           ? MASKS_AVX2
                                                                                                     : MASKS_PORTABLE;
#else
    enum masks_way best = MASKS_PORTABLE;
#endif
    limit = most;
    return best < most ? best : most;
}

/* Takes one table apart, if each class of a plane is a range of it. */
static int halve(const uint8_t table[256], uint8_t halves[5][16])
{
    memset(halves, 0, 5 * 16);
    for (int bit = 0; bit < 8; bit++) {
        uint8_t mask = (uint8_t)(1u << bit);
        int first = 0, last = 255;

        while (first < 256 && !(table[first] & mask))
            first++;
        if (first == 256)
            continue;
        while (!(table[last] & mask))
            last--;
        for (int k = first; k <= last; k++)
            if (!(table[k] & mask))
                return 0;
        int single = first / 16 == last / 16;

        for (int k = first / 16 + 1; k < last / 16; k++)
            halves[0][k] |= mask;
        halves[1][first / 16] |= mask;
        for (int k = first % 16; k <= (single ? last % 16 : 15); k++)
            halves[2][k] |= mask;
        if (single)
            continue;
        halves[3][last / 16] |= mask;
        for (int k = 0; k <= last % 16; k++)
            halves[4][k] |= mask;
    }
    return 1;
}

struct box {
    int first[2], last[2];      /* of U and of V */
};

static struct box around(struct box a, const struct box *b)
{
    for (int k = 0; k < 2; k++) {
        a.first[k] = a.first[k] < b->first[k] ? a.first[k] : b->first[k];
        a.last[k] = a.last[k] > b->last[k] ? a.last[k] : b->last[k];
    }
    return a;
}

static int area(const struct box *box)
{
    return (box->last[0] - box->first[0] + 1) * (box->last[1] - box->first[1] + 1);
}

/* The chroma of each class that has any. */
static int boxes_of(const struct masks_tables *tables, struct box boxes[32])
{
    int count = 0;

    for (int class = 0; class < 8 * tables->planes; class++) {
        struct box box = { { 256, 256 }, { -1, -1 } };

        for (int k = 0; k < 512; k++)
            if (tables->source[256 + k] >> class & 1) {
                int *first = box.first + k / 256, *last = box.last + k / 256;

                *first = k % 256 < *first ? k % 256 : *first;
                *last = k % 256;
            }
        if (box.last[0] >= 0 && box.last[1] >= 0)
            boxes[count++] = box;
    }
    return count;
}

/* Joins boxes until eight are left, always the two whose box grows least: what is in none of them is of no class. */
static void group(struct masks_tables *tables)
{
    struct box boxes[32];
    int count = boxes_of(tables, boxes);
    uint8_t *bytes = tables->bytes[MASKS_PLANES];

    while (count > 8) {
        int one = 0, other = 1, least = 1 << 30;

        for (int a = 0; a < count; a++)
            for (int b = a + 1; b < count; b++) {
                struct box both = around(boxes[a], boxes + b);
                int more = area(&both) - area(boxes + a) - area(boxes + b);

                if (more < least) {
                    least = more;
                    one = a;
                    other = b;
                }
            }
        boxes[one] = around(boxes[one], boxes + other);
        boxes[other] = boxes[--count];
    }
    memset(bytes, 0, sizeof tables->bytes[0]);
    for (int group = 0; group < count; group++)
        for (int k = 0; k < 2; k++)
            for (int value = boxes[group].first[k]; value <= boxes[group].last[k]; value++)
                bytes[256 * (k + 1) + value] |= (uint8_t)(1u << group);
    for (int k = 1; k < 3; k++)
        halve(bytes + 256 * k, tables->halves[MASKS_PLANES][k]);
}

void masks_make(struct masks_tables *tables, const uint32_t source[768])
{
    enum masks_way way = masks_limit(limit);
    uint32_t of[3] = { 0 };
    int ranges = 1;

    if (tables->planes && way >= tables->way && memcmp(tables->source, source, sizeof tables->source) == 0)
        return;
    memcpy(tables->source, source, sizeof tables->source);
    for (int k = 0; k < 768; k++)
        of[k / 256] |= source[k];
    uint32_t all = of[0] & of[1] & of[2];

    tables->planes = all >> 24 ? 4 : all >> 16 ? 3 : all >> 8 ? 2 : 1;
    for (int plane = 0; plane < tables->planes; plane++) {
        for (int k = 0; k < 768; k++)
            tables->bytes[plane][k] = (uint8_t)(source[k] >> 8 * plane);
        for (int k = 0; k < 3; k++)
            ranges &= halve(tables->bytes[plane] + 256 * k, tables->halves[plane][k]);
    }
    if (tables->planes > 1)
        group(tables);
    tables->way = way == MASKS_AVX2 && !ranges ? MASKS_PORTABLE : way;
}

#if VECTORS
/* --- AVX2: ranges, by the halves of a value ---------------------------------------------------------------------------- */

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

/* The Y, U and V of 32 pixels, each with its own. */
AVX2 ALWAYS void take_avx2(const uint8_t *y, const uint8_t *u, const uint8_t *v, size_t y_step, size_t step, __m256i out[3])
{
    const __m256i twice = _mm256_setr_epi8(0, 0, 2, 2, 4, 4, 6, 6, 8, 8, 10, 10, 12, 12, 14, 14, 0, 0, 2, 2, 4, 4, 6, 6, 8, 8,
                                           10, 10, 12, 12, 14, 14);
    const __m256i planar = _mm256_setr_epi8(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8, 9, 9, 10, 10, 11, 11, 12, 12,
                                           13, 13, 14, 14, 15, 15);
    const __m256i low = _mm256_set1_epi16(0xFF);
    __m256i both;

    if (y_step == 2) {
        __m256i a = _mm256_loadu_si256((const __m256i *)y), b = _mm256_loadu_si256((const __m256i *)(y + 32));

        out[0] = _mm256_permute4x64_epi64(_mm256_packus_epi16(_mm256_and_si256(a, low), _mm256_and_si256(b, low)), 0xD8);
        both = _mm256_permute4x64_epi64(_mm256_packus_epi16(_mm256_srli_epi16(a, 8), _mm256_srli_epi16(b, 8)), 0xD8);
    } else {
        out[0] = _mm256_loadu_si256((const __m256i *)y);
        if (step == 1) {
            __m256i us = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)u));
            __m256i vs = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)v));

            out[1] = _mm256_shuffle_epi8(us, planar);
            out[2] = _mm256_shuffle_epi8(vs, planar);
            return;
        }
        both = _mm256_loadu_si256((const __m256i *)u);
    }
    out[1] = _mm256_shuffle_epi8(both, twice);
    out[2] = _mm256_shuffle_epi8(both, _mm256_add_epi8(twice, _mm256_set1_epi8(1)));
}

AVX2 ALWAYS uint64_t thirty_two(const struct masks_tables *tables, int planes, const __m256i in[3], struct masks_row *here,
                                size_t x)
{
    __m256i any = _mm256_setzero_si256();

    if (planes > 1) {
        __m256i near = _mm256_and_si256(ranges(tables->halves[MASKS_PLANES][1], in[1]),
                                        ranges(tables->halves[MASKS_PLANES][2], in[2]));

        if (_mm256_testz_si256(near, near)) {
            for (int plane = 0; plane < planes; plane++)
                _mm256_storeu_si256((__m256i *)(here->planes[plane] + x), any);
            return 0;
        }
    }
    for (int plane = 0; plane < planes; plane++) {
        __m256i mask = _mm256_and_si256(ranges(tables->halves[plane][1], in[1]), ranges(tables->halves[plane][2], in[2]));

        if (!_mm256_testz_si256(mask, mask))
            mask = _mm256_and_si256(mask, ranges(tables->halves[plane][0], in[0]));
        _mm256_storeu_si256((__m256i *)(here->planes[plane] + x), mask);
        any = _mm256_or_si256(any, mask);
    }
    return (uint32_t)~_mm256_movemask_epi8(_mm256_cmpeq_epi8(any, _mm256_setzero_si256()));
}

/* The last pixels are read from a copy, since nothing behind them may be. */
AVX2 ALWAYS void find_avx2_by(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                              struct masks_row *here, int planes, size_t y_step, size_t step)
{
    size_t width = picture->width, at = row / picture->chroma_rows * picture->chroma_row;
    const uint8_t *y = picture->y + row * picture->y_row, *u = picture->u + at, *v = picture->v + at;

    for (size_t x = 0; x < width; x += 64) {
        uint64_t on = 0;

        for (size_t k = x; k < x + 64; k += 32) {
            __m256i in[3];
            size_t left = width > k ? width - k : 0;

            if (left >= 32) {
                take_avx2(y + k * y_step, u + k / 2 * step, v + k / 2 * step, y_step, step, in);
                on |= thirty_two(tables, planes, in, here, k) << (k - x);
            } else {
                uint8_t ys[64] = { 0 }, us[32] = { 0 }, vs[32] = { 0 };

                memcpy(ys, y + k * y_step, left * y_step);
                if (y_step == 1) {
                    memcpy(us, u + k / 2 * step, left / 2 * step);
                    if (step == 1)
                        memcpy(vs, v + k / 2, left / 2);
                }
                take_avx2(ys, us, vs, y_step, step, in);
                uint64_t seen = thirty_two(tables, planes, in, here, k);

                for (int plane = 0; plane < planes; plane++)
                    memset(here->planes[plane] + k + left, 0, 32 - left);
                on |= (seen & ((UINT64_C(1) << left) - 1)) << (k - x);
            }
        }
        here->on[x / 64] = on;
    }
}

AVX2 static void find_avx2(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                           struct masks_row *here)
{
    if (tables->planes == 1 && picture->y_step == 2)
        find_avx2_by(tables, picture, row, here, 1, 2, 4);
    else if (tables->planes == 1 && picture->chroma_step == 1)
        find_avx2_by(tables, picture, row, here, 1, 1, 1);
    else
        find_avx2_by(tables, picture, row, here, tables->planes, picture->y_step, picture->chroma_step);
}

AVX2 static void link_avx2(int planes, size_t words, const struct masks_row *above, struct masks_row *here)
{
    for (size_t word = 0; word < words; word++) {
        uint64_t left = 0, over = 0;

        if (here->on[word]) {
            left = over = UINT64_MAX;
            for (int plane = 0; plane < planes; plane++) {
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
        }
        here->left[word] = left & here->on[word];
        here->above[word] = over & here->on[word];
    }
}

/* --- AVX-512 with VBMI: whole tables in registers ---------------------------------------------------------------------- */

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

static const uint8_t packed_y[64] = EVERY(0, 2, 1), packed_u[64] = EVERY(1, 4, 2), packed_v[64] = EVERY(3, 4, 2);
static const uint8_t apart[64] = EVERY(0, 1, 2), even[64] = EVERY(0, 2, 2), odd[64] = EVERY(1, 2, 2);

/* The Y, U and V of 64 pixels, each with its own; of fewer, if so many are left. */
AVX512 ALWAYS void take_avx512(const uint8_t *y, const uint8_t *u, const uint8_t *v, size_t y_step, size_t step, size_t left,
                               __m512i out[3])
{
    __mmask64 all = ~UINT64_C(0);

    if (y_step == 2) {
        __mmask64 first = left >= 32 ? all : all >> (64 - 2 * left);
        __mmask64 second = left >= 64 ? all : left > 32 ? all >> (128 - 2 * left) : 0;
        __m512i a = left >= 64 ? _mm512_loadu_si512(y) : _mm512_maskz_loadu_epi8(first, y);
        __m512i b = left >= 64 ? _mm512_loadu_si512(y + 64) : _mm512_maskz_loadu_epi8(second, y + 64);

        out[0] = _mm512_permutex2var_epi8(a, _mm512_loadu_si512(packed_y), b);
        out[1] = _mm512_permutex2var_epi8(a, _mm512_loadu_si512(packed_u), b);
        out[2] = _mm512_permutex2var_epi8(a, _mm512_loadu_si512(packed_v), b);
        return;
    }
    __mmask64 lanes = left >= 64 ? all : all >> (64 - left), half = lanes & 0xFFFFFFFF;

    out[0] = _mm512_maskz_loadu_epi8(lanes, y);
    if (step == 1) {
        half = left >= 64 ? 0xFFFFFFFF : UINT64_C(0xFFFFFFFF) >> (32 - left / 2);
        out[1] = _mm512_permutexvar_epi8(_mm512_loadu_si512(apart), _mm512_maskz_loadu_epi8(half, u));
        out[2] = _mm512_permutexvar_epi8(_mm512_loadu_si512(apart), _mm512_maskz_loadu_epi8(half, v));
    } else {
        __m512i both = _mm512_maskz_loadu_epi8(lanes, u);

        out[1] = _mm512_permutexvar_epi8(_mm512_loadu_si512(even), both);
        out[2] = _mm512_permutexvar_epi8(_mm512_loadu_si512(odd), both);
    }
}

AVX512 ALWAYS void find_avx512_by(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                                  struct masks_row *here, int planes, size_t y_step, size_t step)
{
    size_t width = picture->width, at = row / picture->chroma_rows * picture->chroma_row;
    const uint8_t *y = picture->y + row * picture->y_row, *u = picture->u + at, *v = picture->v + at;
    __m512i parts[3][4], near[3][4];

    for (int k = 0; k < 3; k++)
        load_table(tables->bytes[0] + 256 * k, parts[k]);
    for (int k = 1; k < 3 && planes > 1; k++)
        load_table(tables->bytes[MASKS_PLANES] + 256 * k, near[k]);
    for (size_t x = 0; x < width; x += 64) {
        size_t left = width - x;
        __m512i in[3], seen = _mm512_setzero_si512();
        __mmask64 lanes = left >= 64 ? ~UINT64_C(0) : ~UINT64_C(0) >> (64 - left);

        take_avx512(y + x * y_step, u + x / 2 * step, v + x / 2 * step, y_step, step, left, in);
        if (planes > 1) {
            __m512i some = _mm512_and_si512(look_up(near[1], in[1]), look_up(near[2], in[2]));

            if (!_mm512_test_epi8_mask(some, some)) {
                for (int plane = 0; plane < planes; plane++)
                    _mm512_storeu_si512(here->planes[plane] + x, seen);
                here->on[x / 64] = 0;
                continue;
            }
        }
        for (int plane = 0; plane < planes; plane++) {
            for (int k = 0; k < 3 && planes > 1; k++)
                load_table(tables->bytes[plane] + 256 * k, parts[k]);
            __m512i mask = _mm512_and_si512(look_up(parts[1], in[1]), look_up(parts[2], in[2]));

            if (_mm512_test_epi8_mask(mask, mask))
                mask = _mm512_maskz_mov_epi8(lanes, _mm512_and_si512(mask, look_up(parts[0], in[0])));
            _mm512_storeu_si512(here->planes[plane] + x, mask);
            seen = _mm512_or_si512(seen, mask);
        }
        here->on[x / 64] = _mm512_test_epi8_mask(seen, seen);
    }
}

AVX512 static void find_avx512(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                               struct masks_row *here)
{
    if (tables->planes == 1 && picture->y_step == 2)
        find_avx512_by(tables, picture, row, here, 1, 2, 4);
    else if (tables->planes == 1 && picture->chroma_step == 1)
        find_avx512_by(tables, picture, row, here, 1, 1, 1);
    else
        find_avx512_by(tables, picture, row, here, tables->planes, picture->y_step, picture->chroma_step);
}

AVX512 static void link_avx512(int planes, size_t words, const struct masks_row *above, struct masks_row *here)
{
    for (size_t word = 0; word < words; word++) {
        __mmask64 left = here->on[word], over = left;

        if (left)
            for (int plane = 0; plane < planes; plane++) {
                const uint8_t *at = here->planes[plane] + 64 * word;
                __m512i one = _mm512_loadu_si512(at);

                left = _mm512_mask_cmpeq_epi8_mask(left, one, _mm512_loadu_si512(at - 1));
                over = _mm512_mask_cmpeq_epi8_mask(over, one, _mm512_loadu_si512(above->planes[plane] + 64 * word));
            }
        here->left[word] = left;
        here->above[word] = over;
    }
}
void masks_find(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                const struct masks_row *above, struct masks_row *here)
{
    size_t words = (picture->width + 63) / 64;

    if (tables->way == MASKS_AVX512) {
        find_avx512(tables, picture, row, here);
        link_avx512(tables->planes, words, above, here);
    } else {
        find_avx2(tables, picture, row, here);
        link_avx2(tables->planes, words, above, here);
    }
}
#else
void masks_find(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                const struct masks_row *above, struct masks_row *here)
{
    (void)tables;
    (void)picture;
    (void)row;
    (void)above;
    (void)here;
}
#endif
