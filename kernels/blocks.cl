#include "classify.h"
#include "scan_access.h"
#include "scan_layout.h"
#include "xraycast/kernels/params.h"

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

/* Every block under an opacity, from the blocks' ranges, and in each column of blocks the number of those
 * with one mu. A work-item takes a column, downwards. */
kernel void blocks_under(global const short2* ranges, const XrcScan scan, constant const XrcOpacity* opacity,
                         global const float2* table, constant const XrcPlateaus* plateaus,
                         global XrcBlock* blocks, global int* constants) {
  const int column = (int)get_global_id(0);
  if (column >= blocks_of(scan.size_x) * blocks_of(scan.size_y)) return;
  XrcBlock above = {0.0f, -1};
  int count = 0;
  for (int brick = scan.bricks - 1; brick >= 0; --brick) {
    const long i = (long)column * scan.bricks + brick;
    const float low = (float)ranges[i].x, high = (float)ranges[i].y;
    int is_constant = low == high;
    for (int p = 0; p < plateaus->count; ++p)
      is_constant |= low >= plateaus->from_hu[p] && high <= plateaus->to_hu[p];
    XrcBlock block = {0.0f, -1};
    if (is_constant) {
      block.mu = mu_of(low, opacity, table);
      block.last = above.last >= 0 && above.mu == block.mu ? above.last : brick;
      ++count;
    }
    blocks[i] = block;
    above = block;
  }
  constants[column] = count;
}
