#include "joseph_rows.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

#ifndef SCAN_IMAGE

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

/* The blocks that a detector column crosses in planes k to k + PLANES - 1: two columns of them, or one twice.
 */
typedef struct {
  global const float* mu[2]; /* of the lowest, and of those above it */
} BlockColumns;

static inline BlockColumns block_columns(global const float* block_mu, const XrcScan* scan, const Rays* rays,
                                         const int k) {
  const int is_by_x = rays->plane_step == XRC_BRICK_SLICES;
  const long per_x = scan->bricks, per_y = (long)blocks_of(scan->size_x) * scan->bricks;
  global const float* plane = block_mu + k / XRC_BLOCK * (is_by_x ? per_x : per_y);
  BlockColumns blocks;
  for (int end = 0; end < 2; ++end) {
    const float u = fma((float)(k + end * (PLANES - 1)), rays->du.s0, rays->u0.s0);
    blocks.mu[end] = plane + index_at(u, rays->last_u) / XRC_BLOCK * (is_by_x ? per_y : per_x);
  }
  return blocks;
}

/* mu of all samples of 16 rays in planes k to k + PLANES - 1, if the blocks around them have one; else NaN.
 * Rays are in the order of their slices. */
static inline float mu_in_blocks(const BlockColumns blocks, const Rays* rays, const int k) {
  const float a = fma((float)k, rays->dv.s0, rays->v0.s0), b = fma((float)k, rays->dv.sf, rays->v0.sf),
              behind = (float)(PLANES - 1), c = fma(behind, rays->dv.s0, a), d = fma(behind, rays->dv.sf, b);
  const int lowest = index_at(fmin(fmin(a, b), fmin(c, d)), rays->last_z) / XRC_BRICK_SLICES,
            highest = index_at(fmax(fmax(a, b), fmax(c, d)) + 1.0f, rays->last_z) / XRC_BRICK_SLICES;
  const float mu = blocks.mu[0][lowest];
  int is_one = 1;
  for (int brick = lowest; brick <= highest; ++brick)
    is_one &= blocks.mu[0][brick] == mu && blocks.mu[1][brick] == mu;
  return is_one ? mu : NAN;
}

/* Adds planes k to k + PLANES - 1, of which the first is a multiple of PLANES, for the groups that are in
 * blocks of one mu. Says which ones are left, a bit for each. */
static inline uint add_blocks(DetectorColumn* column, const BlockColumns blocks, const int k) {
  uint left = 0;
  for (int g = 0; g < column->groups; ++g) {
    const Rays* rays = &column->rays[g];
    const int is_core = k >= rays->first_core && k + PLANES - 1 <= rays->last_core;
    const float mu = is_core ? mu_in_blocks(blocks, rays, k) : NAN;
    if (mu == mu)
      column->sum[g] += PLANES * mu;
    else
      left |= 1u << g;
  }
  return left;
}

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
#pragma unroll
      for (int p = 0; p < PLANES; ++p)
        sum += mu_of16(sample_column(&columns[p], rays, k + p), opacity, table);
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

#endif

/* One work-item takes 128 rows of some neighbouring columns. These go through the planes side by side, so
 * that what they share of them stays in a first-level cache. */
kernel void project_untilted(SCAN voxels, const XrcScan scan, const XrcDetector detector,
                             constant const XrcOpacity* opacity, global const float2* table,
                             global float* tau, global const float* block_mu, const int has_blocks) {
  const int first_column = XRC_UNTILTED_COLUMNS * (int)get_global_id(0),
            first_row = XRC_UNTILTED_ROWS * (int)get_global_id(1);
  if (first_column >= detector.width || first_row >= detector.height) return;
  const int count = min(XRC_UNTILTED_COLUMNS, detector.width - first_column);
  const int groups = min(GROUPS, (detector.height - first_row + ROWS - 1) / ROWS);
#ifdef HAS_PERMUTE
  DetectorColumn detector_columns[XRC_UNTILTED_COLUMNS];
  int alike = 1;
  for (int c = 0; c < count; ++c)
    alike &= prepare_column(&detector_columns[c], &scan, &detector, first_column + c, first_row, groups);
  if (alike) {
    int first = detector_columns[0].first, last = detector_columns[0].last;
    for (int c = 1; c < count; ++c) {
      first = min(first, detector_columns[c].first);
      last = max(last, detector_columns[c].last);
    }
    const uint all_groups = (1u << groups) - 1;
    /* Slices that no column reached count with weight 0, and so must be numbers. */
    Column columns[PLANES];
    for (int p = 0; p < PLANES; ++p)
      for (int b = 0; b < COLUMN_BRICKS + 2; ++b) columns[p].hu[b] = 0.0f;
    for (int k = first / PLANES * PLANES; k <= last; k += PLANES)
      for (int c = 0; c < count; ++c) {
        DetectorColumn* column = &detector_columns[c];
        const uint left =
            has_blocks ? add_blocks(column, block_columns(block_mu, &scan, column->rays, k), k) : all_groups;
        add_planes(voxels, column, left, k, columns, opacity, table);
      }
    for (int c = 0; c < count; ++c)
      for (int g = 0; g < groups; ++g)
        store_rows(detector_columns[c].sum[g] * detector_columns[c].rays[g].plane_mm, first_column + c,
                   first_row + ROWS * g, &detector, tau);
    return;
  }
#endif
  for (int c = 0; c < count; ++c)
    for (int g = 0; g < groups; ++g)
      project_16(voxels, &scan, &detector, first_column + c, first_row + ROWS * g, opacity, table, tau);
}

#endif
