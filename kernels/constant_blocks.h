/* Blocks of a scan in which mu is the same everywhere, for rays that lie side by side; see Rays. */
#ifndef XRAYCAST_CONSTANT_BLOCKS_H
#define XRAYCAST_CONSTANT_BLOCKS_H

#include "joseph_rows.h"
#include "scan_layout.h"
#include "xraycast/kernels/params.h"

/* The blocks as rays of one dominant axis cross them. */
typedef struct {
  global const XrcBlock* first;
  long per_k, per_u; /* to the next block along the planes' axis, and across */
  int last_u, last_z;
} Blocks;

static inline Blocks blocks_along(global const XrcBlock* blocks, const XrcScan* scan, const Rays* rays) {
  const int is_by_x = rays->plane_step == XRC_BRICK_SLICES;
  const long per_x = scan->bricks, per_y = blocks_of(scan->size_x) * per_x;
  const Blocks along = {blocks, is_by_x ? per_x : per_y, is_by_x ? per_y : per_x, rays->last_u, rays->last_z};
  return along;
}

/* Rays of neighbouring rows and columns of the detector: four of them enclose the others in every plane. */
typedef struct {
  float4 u0, du, v0, dv;     /* of these four */
  int first_core, last_core; /* planes that are in the core of all */
} Bundle;

/* From the first rows of the first and the last column to their last rows, which may be the same. */
static inline Bundle bundle_of(const Rays* top, const Rays* top_beside, const Rays* bottom,
                               const Rays* bottom_beside) {
  Bundle bundle;
  bundle.u0 = (float4)(top->u0.s0, top_beside->u0.s0, bottom->u0.sf, bottom_beside->u0.sf);
  bundle.du = (float4)(top->du.s0, top_beside->du.s0, bottom->du.sf, bottom_beside->du.sf);
  bundle.v0 = (float4)(top->v0.s0, top_beside->v0.s0, bottom->v0.sf, bottom_beside->v0.sf);
  bundle.dv = (float4)(top->dv.s0, top_beside->dv.s0, bottom->dv.sf, bottom_beside->dv.sf);
  bundle.first_core = INT_MIN;
  bundle.last_core = INT_MAX;
  return bundle;
}

static inline void keep_to_planes(Bundle* bundle, const int first, const int last) {
  bundle->first_core = max(bundle->first_core, first);
  bundle->last_core = min(bundle->last_core, last);
}

static inline float least4(const float4 v) {
  const float2 a = fmin(v.lo, v.hi);
  return fmin(a.x, a.y);
}

/* mu of all samples of a bundle in planes k to k + XRC_BLOCK - 1, of which the first is a multiple of
 * XRC_BLOCK, if the blocks around them have one mu; else NaN. */
static inline float mu_within(const Blocks* blocks, const Bundle* bundle, const int k) {
  if (k < bundle->first_core || k + XRC_BLOCK - 1 > bundle->last_core) return NAN;
  /* Rays between the four are enclosed but for rounding, which is below 1e-4 voxels. */
  const float rounding = 1e-3f, behind = (float)(XRC_BLOCK - 1);
  const float4 u = fma((float4)(float)k, bundle->du, bundle->u0), u_behind = fma(behind, bundle->du, u);
  const float4 v = fma((float4)(float)k, bundle->dv, bundle->v0), v_behind = fma(behind, bundle->dv, v);
  const int low_u = index_at(least4(fmin(u, u_behind)) - rounding, blocks->last_u) / XRC_BLOCK,
            high_u = index_at(rounding - least4(fmin(-u, -u_behind)), blocks->last_u) / XRC_BLOCK;
  const int low_z = index_at(least4(fmin(v, v_behind)) - rounding, blocks->last_z) / XRC_BRICK_SLICES,
            high_z =
                index_at(1.0f + rounding - least4(fmin(-v, -v_behind)), blocks->last_z) / XRC_BRICK_SLICES;
  global const XrcBlock* block =
      blocks->first + k / XRC_BLOCK * blocks->per_k + low_u * blocks->per_u + low_z;
  const float mu = block->mu;
  for (int i = low_u; i <= high_u; ++i, block += blocks->per_u)
    if (block->last < high_z || block->mu != mu) return NAN;
  return mu;
}

#endif
