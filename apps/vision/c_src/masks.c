/* The tables of a search, and which way it goes. */
#include "masks_ways.h"

static enum masks_way limit = MASKS_AVX512;

enum masks_way masks_limit(enum masks_way most)
{
#if defined(__x86_64__)
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

/* Which groups of eight classes may be in each cell of 16 values of U by 16 of V. */
static void make_cells(struct masks_tables *tables)
{
    uint32_t of[3][16] = { { 0 } };

    for (int k = 0; k < 768; k++)
        of[k / 256][k % 256 / 16] |= tables->source[k];
    memset(tables->cells, 0, sizeof tables->cells);
    memset(tables->columns, 0, sizeof tables->columns);
    for (int cell = 0; cell < 256; cell++) {
        int u = cell / 16, v = cell % 16;
        uint32_t classes = of[1][u] & of[2][v];

        for (int plane = 0; plane < tables->planes; plane++)
            if (classes >> 8 * plane & 0xFF) {
                uint8_t bit = (uint8_t)(1u << v % 8);

                tables->cells[cell % 128] |= (uint8_t)(1u << plane << cell / 128 * 4);
                tables->columns[plane][v / 8][u] |= bit;
                tables->columns[MASKS_PLANES][v / 8][u] |= bit;
            }
    }
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
    make_cells(tables);
    tables->way = way == MASKS_AVX2 && !ranges ? MASKS_PORTABLE : way;
}

void masks_find(const struct masks_tables *tables, const struct blobs_picture *picture, uint32_t row,
                const struct masks_row *above, struct masks_row *here)
{
#if defined(__x86_64__)
    if (tables->way == MASKS_AVX512)
        masks_avx512(tables, picture, row, above, here);
    else
        masks_avx2(tables, picture, row, above, here);
#else
    (void)tables;
    (void)picture;
    (void)row;
    (void)above;
    (void)here;
#endif
}
