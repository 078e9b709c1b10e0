/* Many rays among walls at once: eight by AVX-512 where the processor has it, else one after the other, to the same bits. */
#include "kernel.h"

static void one_by_one(const sim_map *map, const sim_rays *rays, double most, double *goes, uint8_t *axes)
{
    for (size_t k = 0; k < rays->count; k++) {
        int axis;
        goes[k] = sim_wall(map, rays->x[k], rays->y[k], rays->rx[k], rays->ry[k], most, &axis);
        axes[k] = (uint8_t)axis;
    }
}

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#define WIDE __attribute__((target("avx512f,avx512dq,avx512vl")))

typedef struct {
    __m512d p, r, inverse, cell;
} line;

WIDE static inline line along(__m512d at, __m512d r, double half, double cell)
{
    const __m512d one = _mm512_set1_pd(1.0);
    __mmask8 steep = _mm512_cmp_pd_mask(_mm512_abs_pd(r), _mm512_set1_pd(1.0e-12), _CMP_GE_OQ);
    return (line){_mm512_add_pd(at, _mm512_set1_pd(half)), r, _mm512_maskz_div_pd(steep, one, r), _mm512_set1_pd(cell)};
}

WIDE static inline __m512d cell_of(const line *l, __m512d t)
{
    return _mm512_floor_pd(_mm512_div_pd(_mm512_add_pd(l->p, _mm512_mul_pd(l->r, t)), l->cell));
}

/* As in sim_wall: when the rays leave the free square of `d` cells about cell `i`. */
WIDE static inline __m512d leaves(const line *l, __m512d i, __m512d d)
{
    const __m512d zero = _mm512_setzero_pd(), one = _mm512_set1_pd(1.0);
    __mmask8 ahead = _mm512_cmp_pd_mask(l->inverse, zero, _CMP_GT_OQ);
    __mmask8 never = _mm512_cmp_pd_mask(l->inverse, zero, _CMP_EQ_OQ);
    __m512d side = _mm512_mask_add_pd(_mm512_add_pd(_mm512_sub_pd(i, d), one), ahead, i, d);
    __m512d t = _mm512_mul_pd(_mm512_sub_pd(_mm512_mul_pd(side, l->cell), l->p), l->inverse);
    return _mm512_mask_mov_pd(t, never, _mm512_set1_pd(1.0e30));
}

/* The next cell: beyond the square. */
WIDE static inline __m512d beyond(const line *l, __m512d i, __m512d d)
{
    __mmask8 ahead = _mm512_cmp_pd_mask(l->inverse, _mm512_setzero_pd(), _CMP_GT_OQ);
    return _mm512_mask_add_pd(_mm512_sub_pd(i, d), ahead, i, d);
}

/* The next cell: inside the square, and never backwards. */
WIDE static inline __m512d beside(const line *l, __m512d i, __m512d d, __m512d t)
{
    const __m512d zero = _mm512_setzero_pd(), one = _mm512_set1_pd(1.0);
    __mmask8 ahead = _mm512_cmp_pd_mask(l->inverse, zero, _CMP_GT_OQ);
    __mmask8 still = _mm512_cmp_pd_mask(l->inverse, zero, _CMP_EQ_OQ);
    __m512d reach = _mm512_sub_pd(d, one);
    __m512d least = _mm512_mask_mov_pd(_mm512_sub_pd(i, reach), ahead, i);
    __m512d last = _mm512_mask_add_pd(i, ahead, i, reach);
    __m512d to = _mm512_min_pd(_mm512_max_pd(cell_of(l, t), least), last);
    return _mm512_mask_mov_pd(to, still, i);
}

/* The free squares about these cells, 0 beyond the border: four bytes are read that end with the one. */
WIDE static inline __m512d squares(const sim_map *map, __mmask8 rays, __m512d i, __m512d j)
{
    const __m512d zero = _mm512_setzero_pd();
    const __m512d width = _mm512_set1_pd((double)map->width), height = _mm512_set1_pd((double)map->height);
    rays = _mm512_mask_cmp_pd_mask(rays, i, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_pd_mask(rays, j, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_pd_mask(rays, i, width, _CMP_LT_OQ);
    rays = _mm512_mask_cmp_pd_mask(rays, j, height, _CMP_LT_OQ);
    __m256i at = _mm512_maskz_cvttpd_epi32(rays, _mm512_add_pd(_mm512_mul_pd(j, width), i));
    __m256i back = _mm256_min_epi32(at, _mm256_set1_epi32(3));
    __m256i four = _mm256_mmask_i32gather_epi32(_mm256_setzero_si256(), rays, _mm256_sub_epi32(at, back), map->field, 1);
    four = _mm256_srlv_epi32(four, _mm256_slli_epi32(back, 3));
    return _mm512_cvtepi32_pd(_mm256_and_si256(four, _mm256_set1_epi32(255)));
}

WIDE static void eight(const sim_map *map, const sim_rays *rays, size_t from, double most, double *goes, uint8_t *axes)
{
    const size_t left = rays->count - from;
    const __mmask8 all = left < 8 ? (__mmask8)((1u << left) - 1) : 0xFF;
    const double half_x = (double)map->width * map->cell / 2, half_y = (double)map->height * map->cell / 2;
    const line x = along(_mm512_maskz_loadu_pd(all, rays->x + from), _mm512_maskz_loadu_pd(all, rays->rx + from), half_x, map->cell);
    const line y = along(_mm512_maskz_loadu_pd(all, rays->y + from), _mm512_maskz_loadu_pd(all, rays->ry + from), half_y, map->cell);
    const __m512d end = _mm512_set1_pd(most);
    __m512d i = _mm512_floor_pd(_mm512_div_pd(x.p, x.cell)), j = _mm512_floor_pd(_mm512_div_pd(y.p, y.cell));
    __m512d t = _mm512_setzero_pd(), go = end;
    __mmask8 active = all, met = 0, along_x = 0, along_y = 0;

    for (int64_t cap = map->width + map->height + 2; cap > 0; cap--) {
        __m512d d = squares(map, active, i, j);
        __mmask8 wall = _mm512_mask_cmp_pd_mask(active, d, _mm512_setzero_pd(), _CMP_EQ_OQ);
        go = _mm512_mask_mov_pd(go, wall, t);
        met |= wall;
        active &= (__mmask8)~wall;

        __m512d tx = leaves(&x, i, d), ty = leaves(&y, j, d);
        active = _mm512_mask_cmp_pd_mask(active, _mm512_min_pd(tx, ty), end, _CMP_LT_OQ);
        if (active == 0)
            break;
        __mmask8 by_x = _mm512_mask_cmp_pd_mask(active, tx, ty, _CMP_LE_OQ), by_y = active & (__mmask8)~by_x;
        t = _mm512_mask_max_pd(t, by_x, tx, t);
        t = _mm512_mask_max_pd(t, by_y, ty, t);
        __m512d next_i = _mm512_mask_mov_pd(beside(&x, i, d, t), by_x, beyond(&x, i, d));
        __m512d next_j = _mm512_mask_mov_pd(beside(&y, j, d, t), by_y, beyond(&y, j, d));
        i = _mm512_mask_mov_pd(i, active, next_i);
        j = _mm512_mask_mov_pd(j, active, next_j);
        along_x = (along_x & (__mmask8)~by_y) | by_x;
        along_y = (along_y & (__mmask8)~by_x) | by_y;
    }
    _mm512_mask_storeu_pd(goes + from, all, go);
    for (size_t k = 0; k < 8 && k < left; k++)
        axes[from + k] = !(met >> k & 1) ? 2 : along_x >> k & 1 ? 0 : along_y >> k & 1 ? 1 : 2;
}

void sim_walls(const sim_map *map, const sim_rays *rays, double most, double *goes, uint8_t *axes)
{
    const int64_t cells = map->width * map->height;

    if (!(cells >= 4 && cells <= INT32_MAX && __builtin_cpu_supports("avx512f") &&
          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))) {
        one_by_one(map, rays, most, goes, axes);
        return;
    }
    for (size_t k = 0; k < rays->count; k += 8)
        eight(map, rays, k, most, goes, axes);
}

#else

void sim_walls(const sim_map *map, const sim_rays *rays, double most, double *goes, uint8_t *axes)
{
    one_by_one(map, rays, most, goes, axes);
}
#endif
