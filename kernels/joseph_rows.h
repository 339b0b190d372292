/* Joseph's method for 16 rows of a detector column at once, in bricks; see projector.hpp. Where such rays
 * cross a plane of voxels they lie in order on a line, close to each other: what they need of the plane are
 * two or three columns of two bricks, of which every ray picks its slice and the next. */
#ifndef XRAYCAST_JOSEPH_ROWS_H
#define XRAYCAST_JOSEPH_ROWS_H

#include "classify.h"
#include "joseph_ray.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

#ifndef SCAN_IMAGE

#ifdef __has_builtin
#if __has_builtin(__builtin_shufflevector) && __has_builtin(__builtin_astype)
#define HAS_PERMUTE
#endif
#endif

/* Without AVX-512 a permutation of 16 numbers is made one by one, but one of eight is an instruction of AVX2.
 * There, upright pictures pick slices in halves of eight rays. */
#if defined(HAS_PERMUTE) && defined(__AVX2__) && !defined(__AVX512F__)
#define HALVES
#endif

/* Prefetch distance: a cache miss takes as long as about four planes. */
#define PLANES_AHEAD 4

#define ROWS XRC_DETECTOR_ROWS

static inline float least(const float16 v) {
  const float8 a = fmin(v.lo, v.hi);
  const float4 b = fmin(a.lo, a.hi);
  return fmin(fmin(b.x, b.y), fmin(b.z, b.w));
}

static inline float greatest(const float16 v) { return -least(-v); }

/* The plane or voxel at a coordinate, for any float, including NaN. */
static inline int index_at(const float coordinate, const int last) {
  return (int)fmin(fmax(coordinate, 0.0f), (float)last);
}

/* 16 rays that are dominated by the same axis, x or y, and cross its planes in the same order. As in `joseph`
 * they are lines over the number of the plane: u across and v along z. */
typedef struct {
  float16 u0, du, v0, dv;
  float16 low, high, plane_mm;
  int last_u, last_z, last_k, last_brick;
  int first, last;                      /* planes that any of them crosses */
  int first_core, last_core;            /* planes in which sample_core may take them all */
  int is_wide;                          /* in some of these, more than 15 slices apart */
  float low_u0, low_du, low_v0, low_dv; /* the lowest u and v of all in these */
  long ahead; /* from the voxels of a plane to those to prefetch for them and the next column */
  long plane_step, column_step, brick_step;
} Rays;

/* One coordinate of 16 rays, in voxels: of the start, and of the way to the end. Beyond the picture's last
 * row that one repeats. */
typedef struct {
  float16 start, along;
} Coordinate;

static inline Coordinate coordinate(const XrcDetector* detector, const int axis, const int i,
                                    const int first_row) {
  const float16 row = fmin((float)first_row + (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15),
                           (float)(detector->height - 1));
  const float16 hit = detector->corner[axis] + (float)i * detector->right[axis] + row * detector->down[axis];
  Coordinate c;
  c.start = detector->is_cone ? (float16)detector->source[axis] : hit - detector->beam[axis];
  c.along = detector->is_cone ? hit - detector->source[axis] : (float16)(2.0f * detector->beam[axis]);
  return c;
}

/* `clip` for 16 rays. */
static inline void clip_rows(float16* low, float16* high, const float16 start, const float16 slope,
                             const float from, const float to) {
  const int16 is_flat = fabs(slope) < 1e-7f, is_inside = start >= from && start <= to;
  const float16 a = (from - start) / slope, b = (to - start) / slope;
  *high = select(fmin(*high, fmax(a, b)), select(*low - 1.0f, *high, is_inside), is_flat);
  *low = select(fmax(*low, fmin(a, b)), *low, is_flat);
}

/* `clip_to_cylinder` for 16 rays over the number of the plane; k is the axis across the planes, 0 or 1. */
static inline void clip_rows_to_cylinder(float16* low, float16* high, const XrcDetector* detector,
                                         const int k, const float16 u0, const float16 du) {
  const float k_mm = detector->spacing_mm[k], u_mm = detector->spacing_mm[1 - k];
  const float from_k = -detector->axis[k] * k_mm;
  const float16 from_u = (u0 - detector->axis[1 - k]) * u_mm, way_u = du * u_mm;
  const float16 way_2 = fma(way_u, way_u, k_mm * k_mm),
                offset = fabs(from_k * way_u - from_u * k_mm) / sqrt(way_2);
  const float16 nearest = -fma(from_u, way_u, from_k * k_mm) / way_2;
  const float16 half_chord =
      sqrt(fmax((detector->radius_mm - offset) * (detector->radius_mm + offset), 0.0f) / way_2);
  *low = fmax(*low, nearest - half_chord);
  *high = fmin(*high, nearest + half_chord);
}

/* The planes that count as a whole for all rays, between the centres of the scan's first and last slices,
 * where the rays are in two neighbouring cells across at most, and within 30 slices. The rays lie in order,
 * so that the first and the last enclose the others. */
static inline void prepare_core(Rays* rays, float16 low, float16 high) {
  clip_rows(&low, &high, rays->v0, rays->dv, 0.0f, (float)rays->last_z);
  float first = greatest(low) + 0.5f, last = least(high) - 0.5f;
  const float u_0 = rays->u0.sf - rays->u0.s0, du = rays->du.sf - rays->du.s0;
  const float v_0 = rays->v0.sf - rays->v0.s0, dv = rays->dv.sf - rays->dv.s0;
  clip(&first, &last, u_0, du, -1.0f, 1.0f);
  clip(&first, &last, v_0, dv, 2.0f - 2 * ROWS, 2.0f * ROWS - 2);
  rays->first_core = convert_int_sat(ceil(first));
  rays->last_core = convert_int_sat(floor(last));
  rays->is_wide = max(fabs(fma(first, dv, v_0)), fabs(fma(last, dv, v_0))) > ROWS - 1.0f;
  const float middle = 0.5f * (first + last);
  const int u_falls = fma(middle, du, u_0) < 0.0f, v_falls = fma(middle, dv, v_0) < 0.0f;
  rays->low_u0 = u_falls ? rays->u0.sf : rays->u0.s0;
  rays->low_du = u_falls ? rays->du.sf : rays->du.s0;
  rays->low_v0 = v_falls ? rays->v0.sf : rays->v0.s0;
  rays->low_dv = v_falls ? rays->dv.sf : rays->dv.s0;
}

/* 0 when the rays are of different kinds, or dominated by z. */
static inline int prepare_rows(Rays* rays, const XrcScan* scan, const XrcDetector* detector, const int i,
                               const int first_row) {
  const Coordinate x = coordinate(detector, 0, i, first_row), y = coordinate(detector, 1, i, first_row),
                   z = coordinate(detector, 2, i, first_row);
  const float16 steep_x = fabs(x.along), steep_y = fabs(y.along), steep_z = fabs(z.along);
  const int by_x = all(steep_x >= steep_y && steep_x >= steep_z),
            by_y = all(steep_y > steep_x && steep_y >= steep_z);
  const Coordinate across = by_x ? x : y, side = by_x ? y : x;
  if (!(by_x || by_y) || !(all(across.along > 0.0f) || all(across.along < 0.0f))) return 0;

  rays->du = side.along / across.along;
  rays->dv = z.along / across.along;
  rays->u0 = side.start - across.start * rays->du;
  rays->v0 = z.start - across.start * rays->dv;
  rays->last_u = (by_x ? scan->size_y : scan->size_x) - 1;
  rays->last_z = scan->size_z - 1;
  rays->last_k = (by_x ? scan->size_x : scan->size_y) - 1;
  rays->last_brick = scan->bricks - 1;
  rays->plane_step = (by_x ? 1 : scan->pitch_x) * XRC_BRICK_SLICES;
  rays->column_step = (by_x ? scan->pitch_x : 1) * XRC_BRICK_SLICES;
  rays->brick_step = (long)scan->pitch_x * scan->pitch_y * XRC_BRICK_SLICES;

  float16 low = fmin(across.start, across.start + across.along),
          high = fmax(across.start, across.start + across.along);
  clip_rows(&low, &high, 0.0f, 1.0f, -0.5f, (float)rays->last_k + 0.5f);
  clip_rows(&low, &high, rays->u0, rays->du, -0.5f, (float)rays->last_u + 0.5f);
  clip_rows(&low, &high, rays->v0, rays->dv, -0.5f, (float)rays->last_z + 0.5f);
  clip_rows_to_cylinder(&low, &high, detector, by_x ? 0 : 1, rays->u0, rays->du);
  const int16 hits = low < high;
  rays->first = index_at(floor(least(select((float16)(float)rays->last_k, low, hits)) + 0.5f), rays->last_k);
  rays->last =
      any(hits) ? index_at(floor(greatest(select((float16)0.0f, high, hits)) + 0.5f), rays->last_k) : -1;
  rays->low = low;
  rays->high = high;
  prepare_core(rays, low, high);
  /* The next detector column is on one side of the columns of voxels that these rays are between. */
  const int leads_up = detector->right[by_x ? 1 : 0] > rays->du.s0 * detector->right[by_x ? 0 : 1];
  const int columns = rays->du.s0 == rays->du.sf && rays->u0.s0 == rays->u0.sf ? 2 : 3;
  const int cells = (int)floor(PLANES_AHEAD * rays->du.s0) + (leads_up ? columns : 0);
  rays->ahead = PLANES_AHEAD * rays->plane_step + cells * rays->column_step;
  const float16 x_mm = x.along * detector->spacing_mm[0], y_mm = y.along * detector->spacing_mm[1],
                z_mm = z.along * detector->spacing_mm[2];
  rays->plane_mm = sqrt(fma(x_mm, x_mm, fma(y_mm, y_mm, z_mm * z_mm))) / fabs(across.along);
  return 1;
}

/* How much of the half-spacings around plane k lies on each ray. */
static inline float16 share_of(const Rays* rays, const int k) {
  return fmax(fmin(rays->high, (float)k + 0.5f) - fmax(rays->low, (float)k - 0.5f), 0.0f);
}

static inline float16 pick_voxels(SCAN voxels, const long16 offsets) {
  long offset[ROWS];
  short hu[ROWS];
  vstore16(offsets, 0, offset);
  for (int r = 0; r < ROWS; ++r) hu[r] = voxels[offset[r]];
  return convert_float16(vload16(0, hu));
}

/* Prefetches what the rays need of a plane ahead, where they are so far apart that other rays hardly share
 * it: two columns of every brick between the first and the last. */
static inline void prefetch_plane(SCAN voxels, const Rays* rays, const int k) {
  if (k < 0 || k > rays->last_k) return;
  const float at = (float)k;
  const int cell = index_at(fma(at, rays->du.s0, rays->u0.s0), rays->last_u);
  const int a = index_at(fma(at, rays->dv.s0, rays->v0.s0), rays->last_z) / XRC_BRICK_SLICES,
            b = index_at(fma(at, rays->dv.sf, rays->v0.sf), rays->last_z) / XRC_BRICK_SLICES;
  SCAN pixel = voxels + k * rays->plane_step + min(a, b) * rays->brick_step + cell * rays->column_step;
  for (int brick = min(a, b); brick <= max(a, b); ++brick, pixel += rays->brick_step) {
    prefetch_line(pixel);
    prefetch_line(pixel + rays->column_step);
  }
}

/* What lies around 16 rays in a plane: HU of the voxels below and above, each on this side across and on the
 * other, and where the rays are between them. */
typedef struct {
  float16 here_below, beside_below, here_above, beside_above, along_u, along_v;
} Cells;

/* The cells in plane k, wherever the rays are: voxel by voxel. */
static inline Cells cells_anywhere(SCAN voxels, const Rays* rays, const int k) {
  prefetch_plane(voxels, rays, k + PLANES_AHEAD);
  const float16 u = clamp(fma((float16)(float)k, rays->du, rays->u0), 0.0f, (float)rays->last_u);
  const float16 v = clamp(fma((float16)(float)k, rays->dv, rays->v0), 0.0f, (float)rays->last_z);
  const int16 at_u = clamp(convert_int16(u), 0, rays->last_u),
              at_v = clamp(convert_int16(v), 0, rays->last_z);
  SCAN plane = voxels + k * rays->plane_step;
  const int16 next_v = min(at_v + 1, rays->last_z);
  const long16 cell = convert_long16(at_u) * rays->column_step;
  const long16 lower = cell + convert_long16(at_v / XRC_BRICK_SLICES) * rays->brick_step +
                       convert_long16(at_v % XRC_BRICK_SLICES),
               upper = cell + convert_long16(next_v / XRC_BRICK_SLICES) * rays->brick_step +
                       convert_long16(next_v % XRC_BRICK_SLICES);
  Cells cells;
  cells.here_below = pick_voxels(plane, lower);
  cells.beside_below = pick_voxels(plane + rays->column_step, lower);
  cells.here_above = pick_voxels(plane, upper);
  cells.beside_above = pick_voxels(plane + rays->column_step, upper);
  cells.along_u = u - convert_float16(at_u);
  cells.along_v = v - convert_float16(at_v);
  return cells;
}

/* HU of 16 rays in plane k, wherever they are. */
static inline float16 sample_any(SCAN voxels, const Rays* rays, const int k) {
  const Cells cells = cells_anywhere(voxels, rays, k);
  return mix(mix(cells.here_below, cells.beside_below, cells.along_u),
             mix(cells.here_above, cells.beside_above, cells.along_u), cells.along_v);
}

#ifdef HAS_PERMUTE

/* Of one pixel of an even and an odd brick, for every ray the slice that is the lower half of its `picks`,
 * and the one that is the upper half, all modulo 32; in the same halves. */
#ifdef HALVES

/* Of 8 rays, from 32 slices as pairs that begin at even slices and at odd ones. */
static inline int8 pick_half(const int16 even_pairs, const int16 odd_pairs, const int8 slice) {
  const int8 at = slice >> 1, is_high = (at & 8) != 0, is_odd = (slice & 1) != 0;
  const int8 even = select(__builtin_shufflevector(even_pairs.lo, at),
                           __builtin_shufflevector(even_pairs.hi, at), is_high),
             odd = select(__builtin_shufflevector(odd_pairs.lo, at),
                          __builtin_shufflevector(odd_pairs.hi, at), is_high);
  return select(even, odd, is_odd);
}

static inline int16 pick_slices(SCAN even, SCAN odd, const int16 picks) {
  const int16 pairs =
                  (int16)(__builtin_astype(vload16(0, even), int8), __builtin_astype(vload16(0, odd), int8)),
              next =
                  __builtin_shufflevector(pairs, pairs, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 0);
  const int16 odd_pairs = __builtin_astype(__builtin_astype(pairs, uint16) >> 16, int16) | next << 16,
              slice = picks & 31;
  return (int16)(pick_half(pairs, odd_pairs, slice.lo), pick_half(pairs, odd_pairs, slice.hi));
}

#else

static inline int16 pick_slices(SCAN even, SCAN odd, const int16 picks) {
  typedef short short32 __attribute__((ext_vector_type(32)));
  typedef ushort ushort32 __attribute__((ext_vector_type(32)));
  const short32 slices =
      __builtin_shufflevector(vload16(0, even), vload16(0, odd), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13,
                              14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31);
  return __builtin_astype(__builtin_shufflevector(slices, __builtin_astype(picks, ushort32)), int16);
}

#endif

/* The cells of 16 rays in a core plane k, whose HU are 65536 times too large. Where rounding puts a ray a
 * hair outside, what it picks is wrong, but weighs no more than the hair. */
static inline Cells cells_in_core(SCAN voxels, const Rays* rays, const int k, const float16 at) {
  float16 u = fma(at, rays->du, rays->u0);
  const float16 v = fma(at, rays->dv, rays->v0);
  const float lowest = fma((float)k, rays->low_du, rays->low_u0);
  const int cell = index_at(lowest, rays->last_u);
  /* Between the border voxels' centres and their faces. */
  if (lowest < 0.0f || lowest > (float)(rays->last_u - 1)) u = clamp(u, 0.0f, (float)rays->last_u);
  const int brick = index_at(fma((float)k, rays->low_dv, rays->low_v0), rays->last_z) / XRC_BRICK_SLICES;
  SCAN lower = voxels + k * rays->plane_step + brick * rays->brick_step + cell * rays->column_step;
  SCAN upper = lower + (brick < rays->last_brick ? rays->brick_step : 0);
  prefetch_line(lower + rays->ahead);
  prefetch_line(upper + rays->ahead);

  const int16 slice = convert_int16(v);
  const float16 past_cell = u - convert_float16((int16)cell);
  const int16 is_next = past_cell >= 1.0f;

  const long second = rays->column_step, third = cell < rays->last_u ? 2 * second : second;
  const int16 picks = (slice | slice << 16) + 0x10000;
  SCAN even = brick & 1 ? upper : lower;
  SCAN odd = brick & 1 ? lower : upper;
  int16 pairs = pick_slices(even, odd, picks), pairs_2 = pick_slices(even + second, odd + second, picks),
        pairs_3 = pick_slices(even + third, odd + third, picks);
  if (rays->is_wide) { /* from the second brick and a third */
    const int16 is_beyond = slice > brick * XRC_BRICK_SLICES + 30, shifted = picks + 0x100010;
    SCAN top = upper + (brick + 1 < rays->last_brick ? rays->brick_step : 0);
    even = brick & 1 ? top : upper;
    odd = brick & 1 ? upper : top;
    pairs = select(pairs, pick_slices(even, odd, shifted), is_beyond);
    pairs_2 = select(pairs_2, pick_slices(even + second, odd + second, shifted), is_beyond);
    pairs_3 = select(pairs_3, pick_slices(even + third, odd + third, shifted), is_beyond);
  }
  const int16 here = select(pairs, pairs_2, is_next), beside = select(pairs_2, pairs_3, is_next);
  const int16 upper_half = (int)0xffff0000;
  Cells cells;
  cells.here_below = convert_float16(here << 16);
  cells.beside_below = convert_float16(beside << 16);
  cells.here_above = convert_float16(here & upper_half);
  cells.beside_above = convert_float16(beside & upper_half);
  cells.along_u = select(past_cell, past_cell - 1.0f, is_next);
  cells.along_v = v - convert_float16(slice);
  return cells;
}

/* HU of 16 rays in a core plane k. */
static inline float16 sample_core(SCAN voxels, const Rays* rays, const int k, const float16 at) {
  const Cells cells = cells_in_core(voxels, rays, k, at);
  const float16 weight_beside = cells.along_u * (1.0f / 65536), weight_here = 1.0f / 65536 - weight_beside;
  const float16 below = fma(weight_beside, cells.beside_below, weight_here * cells.here_below);
  const float16 above = fma(weight_beside, cells.beside_above, weight_here * cells.here_above);
  return fma(cells.along_v, above - below, below);
}

#endif

static inline void store_rows(const float16 depths, const int i, const int first_row,
                              const XrcDetector* detector, global float* tau) {
  float depth[ROWS];
  vstore16(depths, 0, depth);
  const int count = min(ROWS, detector->height - first_row);
  for (int r = 0; r < count; ++r) tau[(long)(first_row + r) * detector->width + i] = depth[r];
}

/* The integral over the planes, in planes. */
static inline float16 sum_of_planes(SCAN voxels, const Rays* rays, constant const XrcOpacity* opacity,
                                    global const float2* table) {
  float16 sum = 0.0f, at = (float)rays->first;
  for (int k = rays->first; k <= rays->last; ++k, at += 1.0f) {
#ifdef HAS_PERMUTE
    if (k >= rays->first_core && k <= rays->last_core) {
      sum += mu_of16(sample_core(voxels, rays, k, at), opacity, table);
      continue;
    }
#endif
    sum = fma(share_of(rays, k), mu_of16(sample_any(voxels, rays, k), opacity, table), sum);
  }
  return sum;
}

/* Which column of which picture a work-item takes, of pictures of one size. Columns come in tiles of
 * get_global_size(0). */
typedef struct {
  int picture, column;
} PictureColumn;

static inline PictureColumn picture_column(global const XrcDetector* detectors) {
  const int tile = (int)get_global_size(0), tiles = (detectors->width + tile - 1) / tile,
            id = (int)get_global_id(2);
  const PictureColumn at = {id / tiles, id % tiles * tile + (int)get_global_id(0)};
  return at;
}

/* 16 rows of column i, whatever their rays are like. */
static inline void project_16(SCAN voxels, const XrcScan* scan, const XrcDetector* detector, const int i,
                              const int first_row, constant const XrcOpacity* opacity,
                              global const float2* table, global float* tau) {
  Rays rays;
  if (prepare_rows(&rays, scan, detector, i, first_row)) {
    store_rows(sum_of_planes(voxels, &rays, opacity, table) * rays.plane_mm, i, first_row, detector, tau);
    return;
  }
  for (int j = first_row; j < min(first_row + ROWS, detector->height); ++j)
    tau[(long)j * detector->width + i] = joseph_pixel(voxels, scan, detector, i, j, opacity, table);
}

#endif
#endif
