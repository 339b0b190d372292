#include "joseph_rows.h"
#include "params.h"
#include "scan_access.h"

#ifndef SCAN_IMAGE

/* Joseph's method for views without tilt, in bricks. The rays of a detector column share their way through x
 * and y, so that in every plane one column of voxels, interpolated across, serves all of them. Along z they
 * lie in the order of their rows, so that the first and the last of a column enclose the others. */

#define GROUPS (XRC_LEVEL_ROWS / ROWS) /* to a work-item */

#ifdef HAS_PERMUTE

/* Rays of neighbouring rows are at most two slices apart in the core of a plane. */
#define COLUMN_BRICKS (2 * GROUPS * ROWS / XRC_BRICK_SLICES + 2)

/* Interpolated slices, with room for reading 32 from any of them on. */
typedef struct {
  float hu[(COLUMN_BRICKS + 2) * XRC_BRICK_SLICES];
  int first_slice;
} Column;

/* Fills in what all groups need of plane k. */
static inline void interpolate_column(SCAN voxels, const Rays* rays, const int groups, const int k,
                                      Column* column) {
  const float u = clamp(fma((float)k, rays->du.s0, rays->u0.s0), 0.0f, (float)rays->last_u);
  const int cell = index_at(u, rays->last_u);
  const float16 along_u = u - (float)cell;
  const Rays* end = rays + groups - 1;
  const float a = fma((float)k, rays->dv.s0, rays->v0.s0), b = fma((float)k, end->dv.sf, end->v0.sf);
  const int first = index_at(min(a, b), rays->last_z) / XRC_BRICK_SLICES,
            last =
                min(index_at(max(a, b) + 1.0f, rays->last_z) / XRC_BRICK_SLICES, first + COLUMN_BRICKS - 1);
  SCAN pixel = voxels + k * rays->plane_step + first * rays->brick_step + cell * rays->column_step;
  for (int brick = first; brick <= last; ++brick, pixel += rays->brick_step) {
    prefetch_line(pixel + rays->ahead);
    const float16 here = convert_float16(vload16(0, pixel)),
                  beside = convert_float16(vload16(0, pixel + rays->column_step));
    vstore16(fma(along_u, beside - here, here), brick - first, column->hu);
  }
  column->first_slice = first * XRC_BRICK_SLICES;
}

/* HU of 16 rays in a core plane k. */
static inline float16 sample_column(const Column* column, const Rays* rays, const int k) {
  const float16 v = fma((float16)(float)k, rays->dv, rays->v0);
  const int16 slice = convert_int16(v);
  const int lowest = index_at(fma((float)k, rays->low_dv, rays->low_v0), rays->last_z);
  const float* from =
      column->hu + clamp(lowest - column->first_slice, 0, COLUMN_BRICKS * XRC_BRICK_SLICES - 1);
  const int16 picks = slice - lowest;
  float16 here = __builtin_shufflevector(vload16(0, from), picks),
          above = __builtin_shufflevector(vload16(0, from + 1), picks);
  if (rays->is_wide) {
    const int16 is_beyond = picks > ROWS - 1, shifted = picks - (ROWS - 1);
    here = select(here, __builtin_shufflevector(vload16(0, from + ROWS - 1), shifted), is_beyond);
    above = select(above, __builtin_shufflevector(vload16(0, from + ROWS), shifted), is_beyond);
  }
  return fma(v - convert_float16(slice), above - here, here);
}

#endif

/* One work-item takes 128 rows of a column; columns come in tiles as in `project_rows`. */
kernel void project_level(SCAN voxels, const XrcScan scan, const XrcDetector detector,
                          constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const int i = (int)(get_global_id(2) * get_global_size(0) + get_global_id(0)),
            first_row = GROUPS * ROWS * (int)get_global_id(1);
  if (i >= detector.width || first_row >= detector.height) return;
  const int groups = min(GROUPS, (detector.height - first_row + ROWS - 1) / ROWS);
#ifdef HAS_PERMUTE
  Rays rays[GROUPS];
  int alike = 1;
  for (int g = 0; g < groups; ++g) alike &= prepare_rows(&rays[g], &scan, &detector, i, first_row + ROWS * g);
  for (int g = 1; g < groups; ++g) alike &= rays[g].plane_step == rays[0].plane_step;
  if (alike) {
    int first = rays[0].first, last = rays[0].last, first_core = rays[0].first_core,
        last_core = rays[0].last_core;
    for (int g = 1; g < groups; ++g) {
      first = min(first, rays[g].first);
      last = max(last, rays[g].last);
      first_core = min(first_core, rays[g].first_core);
      last_core = max(last_core, rays[g].last_core);
    }
    float16 sum[GROUPS];
    for (int g = 0; g < groups; ++g) sum[g] = 0.0f;
    /* A plane is sampled once the next one's column is under way, so that no load waits for a store. Slices
     * that no column reached count with weight 0, and so have to be numbers. */
    Column columns[2];
    for (int b = 0; b < COLUMN_BRICKS + 2; ++b) {
      vstore16((float16)0.0f, b, columns[0].hu);
      vstore16((float16)0.0f, b, columns[1].hu);
    }
    for (int k = first; k <= last + 1; ++k) {
      if (k <= last && k >= first_core && k <= last_core)
        interpolate_column(voxels, rays, groups, k, &columns[k & 1]);
      const int now = k - 1;
      if (now < first) continue;
      for (int g = 0; g < groups; ++g) {
        if (now >= rays[g].first_core && now <= rays[g].last_core)
          sum[g] += mu_of16(sample_column(&columns[now & 1], &rays[g], now), opacity, table);
        else if (now >= rays[g].first && now <= rays[g].last)
          sum[g] = fma(share_of(&rays[g], now), mu_of16(sample_any(voxels, &rays[g], now), opacity, table),
                       sum[g]);
      }
    }
    for (int g = 0; g < groups; ++g)
      store_rows(sum[g] * rays[g].plane_mm, i, first_row + ROWS * g, &detector, tau);
    return;
  }
#endif
  for (int g = 0; g < groups; ++g)
    project_16(voxels, &scan, &detector, i, first_row + ROWS * g, opacity, table, tau);
}

#endif
