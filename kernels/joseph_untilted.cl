#include "constant_blocks.h"
#include "joseph_rows.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* Joseph's method for views without tilt, in bricks. The rays of a detector column share their way through x
 * and y, so that in every plane one column of voxels, interpolated across, serves all of them. Along z they
 * lie in the order of their rows, so that the first and the last of a column enclose the others. */

#define GROUPS (XRC_UNTILTED_ROWS / ROWS) /* to a detector column */

#ifdef HAS_PERMUTE

/* Rays of neighbouring rows are at most two slices apart in the core of a plane. */
#define COLUMN_BRICKS (2 * GROUPS * ROWS / XRC_BRICK_SLICES + 2)

/* Planes that are sampled at once, so that what a group of rays needs for them stays in registers. */
#define PLANES 4

/* Compilers do not inline functions as long as these; the calls would double their time. */
#define INLINE static inline __attribute__((always_inline))

/* 16 slices from any of a column on; `vload16` takes them in pieces. */
typedef float16 Slices __attribute__((aligned(4)));

/* Interpolated slices of a plane, with room for reading 32 from any of them on. */
typedef struct {
  float16 hu[COLUMN_BRICKS + 2];
  int first_slice;
} Column;

/* The rays of a detector column, and their integrals so far, in planes. */
typedef struct {
  Rays rays[GROUPS];
  float16 sum[GROUPS];
  int groups;
  int first, last, first_core, last_core; /* as in Rays, of any of them */
} DetectorColumn;

/* 0 when the rays are of different kinds. */
static inline int prepare_column(DetectorColumn* column, const XrcScan* scan, const XrcDetector* detector,
                                 const int i, const int first_row, const int groups) {
  Rays* rays = column->rays;
  for (int g = 0; g < groups; ++g) {
    if (!prepare_rows(&rays[g], scan, detector, i, first_row + ROWS * g)) return 0;
    if (rays[g].plane_step != rays[0].plane_step) return 0;
    column->sum[g] = 0.0f;
  }
  column->groups = groups;
  column->first = rays[0].first;
  column->last = rays[0].last;
  column->first_core = rays[0].first_core;
  column->last_core = rays[0].last_core;
  for (int g = 1; g < groups; ++g) {
    column->first = min(column->first, rays[g].first);
    column->last = max(column->last, rays[g].last);
    column->first_core = min(column->first_core, rays[g].first_core);
    column->last_core = max(column->last_core, rays[g].last_core);
  }
  return 1;
}

/* Fills in what all groups need of plane k. */
INLINE void interpolate_column(SCAN voxels, const Rays* rays, const int groups, const int k, Column* column) {
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
    column->hu[brick - first] = fma(along_u, beside - here, here);
  }
  column->first_slice = first * XRC_BRICK_SLICES;
}

#ifdef HALVES

typedef float8 HalfSlices __attribute__((aligned(4)));

/* HU of 8 rays in a core plane k. */
INLINE float8 sample_half(const Column* column, const float8 v0, const float8 dv, const int k) {
  const float8 v = fma((float8)(float)k, dv, v0);
  const int8 slice = convert_int8(v);
  const int lowest = min(slice.s0, slice.s7), span = min(max(slice.s0, slice.s7) - lowest, 2 * ROWS - 1);
  const float* from =
      (const float*)column->hu + clamp(lowest - column->first_slice, 0, COLUMN_BRICKS * XRC_BRICK_SLICES - 1);
  const int8 picks = slice - lowest;
  float8 here = __builtin_shufflevector(*(const HalfSlices*)from, picks),
         above = __builtin_shufflevector(*(const HalfSlices*)(from + 1), picks);
  for (int past = 8; past <= span; past += 8) {
    const int8 is_beyond = picks >= past, shifted = picks - past;
    here = select(here, __builtin_shufflevector(*(const HalfSlices*)(from + past), shifted), is_beyond);
    above = select(above, __builtin_shufflevector(*(const HalfSlices*)(from + past + 1), shifted), is_beyond);
  }
  return fma(v - convert_float8(slice), above - here, here);
}

/* HU of 16 rays in a core plane k. */
INLINE float16 sample_column(const Column* column, const Rays* rays, const int k) {
  return (float16)(sample_half(column, rays->v0.lo, rays->dv.lo, k),
                   sample_half(column, rays->v0.hi, rays->dv.hi, k));
}

/* The sums of 16 rays over the core planes k to k + PLANES - 1: half by half, so that all stays in
 * registers. */
INLINE float16 add_core_planes(float16 sum, const Column* columns, const Rays* rays, const int k,
                               constant const XrcOpacity* opacity, global const float2* table) {
  float8 low = sum.lo, high = sum.hi;
  const float8 v0 = rays->v0.lo, dv = rays->dv.lo, high_v0 = rays->v0.hi, high_dv = rays->dv.hi;
#pragma unroll
  for (int p = 0; p < PLANES; ++p) low += mu_of8(sample_half(&columns[p], v0, dv, k + p), opacity, table);
#pragma unroll
  for (int p = 0; p < PLANES; ++p)
    high += mu_of8(sample_half(&columns[p], high_v0, high_dv, k + p), opacity, table);
  return (float16)(low, high);
}

#else

/* HU of 16 rays in a core plane k. */
INLINE float16 sample_column(const Column* column, const Rays* rays, const int k) {
  const float16 v = fma((float16)(float)k, rays->dv, rays->v0);
  const int16 slice = convert_int16(v);
  const int lowest = convert_int(fma((float)k, rays->low_dv, rays->low_v0));
  const float* from =
      (const float*)column->hu + clamp(lowest - column->first_slice, 0, COLUMN_BRICKS * XRC_BRICK_SLICES - 1);
  const int16 picks = slice - lowest;
  float16 here = __builtin_shufflevector(*(const Slices*)from, picks),
          above = __builtin_shufflevector(*(const Slices*)(from + 1), picks);
  if (rays->is_wide) {
    const int16 is_beyond = picks > ROWS - 1, shifted = picks - (ROWS - 1);
    here = select(here, __builtin_shufflevector(*(const Slices*)(from + ROWS - 1), shifted), is_beyond);
    above = select(above, __builtin_shufflevector(*(const Slices*)(from + ROWS), shifted), is_beyond);
  }
  return fma(v - convert_float16(slice), above - here, here);
}

/* The sums of 16 rays over the core planes k to k + PLANES - 1. */
INLINE float16 add_core_planes(float16 sum, const Column* columns, const Rays* rays, const int k,
                               constant const XrcOpacity* opacity, global const float2* table) {
#pragma unroll
  for (int p = 0; p < PLANES; ++p) sum += mu_of16(sample_column(&columns[p], rays, k + p), opacity, table);
  return sum;
}

#endif

/* Adds planes k to k + PLANES - 1 for the groups that are `left`. `columns` are room for those planes. */
static inline void add_planes(SCAN voxels, DetectorColumn* column, const uint left, const int k,
                              Column* columns, constant const XrcOpacity* opacity,
                              global const float2* table) {
  if (left == 0) return;
  const int first = convert_int(popcount(left ^ (left - 1))) - 1, end = 32 - convert_int(clz(left));
  for (int p = 0; p < PLANES; ++p)
    if (k + p >= column->first_core && k + p <= column->last_core)
      interpolate_column(voxels, column->rays + first, end - first, k + p, &columns[p]);
  for (int g = first; g < end; ++g) {
    if (!(left >> g & 1u)) continue;
    const Rays* rays = &column->rays[g];
    float16 sum = column->sum[g];
    if (k >= rays->first_core && k + PLANES - 1 <= rays->last_core) {
      sum = add_core_planes(sum, columns, rays, k, opacity, table);
    } else {
      for (int p = 0; p < PLANES; ++p) {
        const int now = k + p;
        if (now >= rays->first_core && now <= rays->last_core)
          sum += mu_of16(sample_column(&columns[p], rays, now), opacity, table);
        else if (now >= rays->first && now <= rays->last)
          sum = fma(share_of(rays, now), mu_of16(sample_any(voxels, rays, now), opacity, table), sum);
      }
    }
    column->sum[g] = sum;
  }
}

/* Neighbouring detector columns. */
typedef struct {
  DetectorColumn columns[XRC_UNTILTED_COLUMNS];
  int count, groups;
  int first, last; /* planes that any of their rays crosses */
} Tile;

/* 0 when the rays of a column are of different kinds. */
static inline int prepare_tile(Tile* tile, const XrcScan* scan, const XrcDetector* detector,
                               const int first_column, const int first_row) {
  tile->count = min(XRC_UNTILTED_COLUMNS, detector->width - first_column);
  tile->groups = min(GROUPS, (detector->height - first_row + ROWS - 1) / ROWS);
  for (int c = 0; c < tile->count; ++c)
    if (!prepare_column(&tile->columns[c], scan, detector, first_column + c, first_row, tile->groups))
      return 0;
  tile->first = tile->columns[0].first;
  tile->last = tile->columns[0].last;
  for (int c = 1; c < tile->count; ++c) {
    tile->first = min(tile->first, tile->columns[c].first);
    tile->last = max(tile->last, tile->columns[c].last);
  }
  return 1;
}

/* Whether all rays are dominated by the same axis. */
static inline int has_one_axis(const Tile* tile) {
  for (int c = 1; c < tile->count; ++c)
    if (tile->columns[c].rays[0].plane_step != tile->columns[0].rays[0].plane_step) return 0;
  return 1;
}

/* What encloses the rays of a tile, all of them and those of the same group, and what these have in common
 * of their integrals so far, in planes: mu of the blocks that they were in together. */
typedef struct {
  Bundle all, by_group[GROUPS];
  float sum_of_all, sum_by_group[GROUPS];
} TileBundles;

static inline void enclose_tile(TileBundles* bundles, const Tile* tile) {
  const Rays *first = tile->columns[0].rays, *last = tile->columns[tile->count - 1].rays;
  const int end = tile->groups - 1;
  bundles->all = bundle_of(&first[0], &last[0], &first[end], &last[end]);
  bundles->sum_of_all = 0.0f;
  for (int g = 0; g <= end; ++g) {
    Bundle* group = &bundles->by_group[g];
    *group = bundle_of(&first[g], &last[g], &first[g], &last[g]);
    bundles->sum_by_group[g] = 0.0f;
    for (int c = 0; c < tile->count; ++c)
      keep_to_planes(group, tile->columns[c].rays[g].first_core, tile->columns[c].rays[g].last_core);
    keep_to_planes(&bundles->all, group->first_core, group->last_core);
  }
}

/* Adds planes k to k + XRC_BLOCK - 1 (see mu_within) for the groups that are in blocks of one mu in all
 * columns. Says which ones are left, a bit for each. */
static inline uint add_blocks(TileBundles* bundles, const Blocks* blocks, const Tile* tile, const int k) {
  const float mu = mu_within(blocks, &bundles->all, k);
  if (mu == mu) {
    bundles->sum_of_all += XRC_BLOCK * mu;
    return 0;
  }
  uint left = 0;
  for (int g = 0; g < tile->groups; ++g) {
    const float mu_of_group = mu_within(blocks, &bundles->by_group[g], k);
    if (mu_of_group == mu_of_group)
      bundles->sum_by_group[g] += XRC_BLOCK * mu_of_group;
    else
      left |= 1u << g;
  }
  return left;
}

/* Stores the integrals of a tile, with those that are in `bundles` if there are any. */
static inline void store_tile(const Tile* tile, const TileBundles* bundles, const int first_column,
                              const int first_row, const XrcDetector* detector, global float* tau) {
  for (int c = 0; c < tile->count; ++c)
    for (int g = 0; g < tile->groups; ++g) {
      const float skipped = bundles ? bundles->sum_of_all + bundles->sum_by_group[g] : 0.0f;
      store_rows((tile->columns[c].sum[g] + skipped) * tile->columns[c].rays[g].plane_mm, first_column + c,
                 first_row + ROWS * g, detector, tau);
    }
}

#endif

/* One work-item takes 128 rows of some neighbouring columns. These go through the planes side by side, so
 * that what they share of them stays in a first-level cache. */
kernel void project_untilted(SCAN voxels, const XrcScan scan, const XrcDetector detector,
                             constant const XrcOpacity* opacity, global const float2* table,
                             global float* tau, global const XrcBlock* first_block, const int has_blocks) {
  const int first_column = XRC_UNTILTED_COLUMNS * (int)get_global_id(0),
            first_row = XRC_UNTILTED_ROWS * (int)get_global_id(1);
  if (first_column >= detector.width || first_row >= detector.height) return;
#ifdef HAS_PERMUTE
  Tile tile;
  if (prepare_tile(&tile, &scan, &detector, first_column, first_row)) {
    const int skips = has_blocks && has_one_axis(&tile);
    const Blocks blocks = blocks_along(first_block, &scan, tile.columns[0].rays);
    TileBundles bundles;
    if (skips) enclose_tile(&bundles, &tile);
    /* Slices that no column reached count with weight 0, and so must be numbers. */
    Column columns[PLANES];
    for (int p = 0; p < PLANES; ++p)
      for (int b = 0; b < COLUMN_BRICKS + 2; ++b) columns[p].hu[b] = 0.0f;
    for (int step = tile.first / XRC_BLOCK * XRC_BLOCK; step <= tile.last; step += XRC_BLOCK) {
      const uint left = skips ? add_blocks(&bundles, &blocks, &tile, step) : (1u << tile.groups) - 1;
      if (left == 0) continue;
      for (int k = step; k < step + XRC_BLOCK; k += PLANES)
        for (int c = 0; c < tile.count; ++c)
          add_planes(voxels, &tile.columns[c], left, k, columns, opacity, table);
    }
    store_tile(&tile, skips ? &bundles : 0, first_column, first_row, &detector, tau);
    return;
  }
#endif
  for (int c = 0; c < min(XRC_UNTILTED_COLUMNS, detector.width - first_column); ++c)
    for (int j = first_row; j < min(first_row + XRC_UNTILTED_ROWS, detector.height); j += ROWS)
      project_16(voxels, &scan, &detector, first_column + c, j, opacity, table, tau);
}
