#include "classify.h"
#include "scan_access.h"
#include "scan_layout.h"
#include "xraycast/kernels/params.h"

#ifndef SCAN_IMAGE

static inline short least_of(const short16 v) {
  const short8 a = min(v.lo, v.hi);
  const short4 b = min(a.lo, a.hi);
  return min(min(b.x, b.y), min(b.z, b.w));
}

/* The least and the largest CT number of every block, with the columns and rows behind it that samples
 * between voxels reach. */
kernel void block_ranges(SCAN voxels, const XrcScan scan, global short2* ranges) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), brick = (int)get_global_id(2);
  const int blocks_x = blocks_of(scan.size_x);
  if (x >= blocks_x || y >= blocks_of(scan.size_y) || brick >= scan.bricks) return;
  const int last_x = min((x + 1) * XRC_BLOCK, scan.size_x - 1),
            last_y = min((y + 1) * XRC_BLOCK, scan.size_y - 1);
  short16 low = SHRT_MAX, high = SHRT_MIN;
  for (int j = y * XRC_BLOCK; j <= last_y; ++j) {
    SCAN row = voxels + brick_pixel(&scan, brick, x * XRC_BLOCK, j) * XRC_BRICK_SLICES;
    for (int i = 0; i <= last_x - x * XRC_BLOCK; ++i) {
      const short16 hu = vload16(i, row);
      low = min(low, hu);
      high = max(high, hu);
    }
  }
  ranges[((long)y * blocks_x + x) * scan.bricks + brick] =
      (short2)(least_of(low), (short)(-1 - least_of((short16)(-1) - high)));
}

/* mu of every block in which it is the same everywhere, and NaN for the others. */
kernel void block_mu(global const short2* ranges, const int count, constant const XrcOpacity* opacity,
                     global const float2* table, constant const XrcPlateaus* plateaus, global float* mu) {
  const int block = (int)get_global_id(0);
  if (block >= count) return;
  const float low = (float)ranges[block].x, high = (float)ranges[block].y;
  int is_constant = low == high;
  for (int i = 0; i < plateaus->count; ++i)
    is_constant |= low >= plateaus->from_hu[i] && high <= plateaus->to_hu[i];
  mu[block] = is_constant ? mu_of(low, opacity, table) : NAN;
}

#endif
