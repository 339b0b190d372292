#include "scan_layout.h"

/* Slices as they are in a file (x fastest) into bricks; see XrcScan. One work-item makes one pixel of one
 * brick. `first_brick` is where the slices go; slices beyond `count` become air. */
kernel void pack_bricks(global const short* slices, global short* bricks, const XrcScan scan,
                        const int first_brick, const int count) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), b = (int)get_global_id(2);
  if (x >= scan.pitch_x || y >= scan.pitch_y) return;
  const int in_slice = x < scan.size_x && y < scan.size_y;
  const long slice = (long)scan.size_x * scan.size_y;
  const long pixel = (long)y * scan.size_x + x;
  short hu[XRC_BRICK_SLICES];
  for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
    const int z = b * XRC_BRICK_SLICES + s;
    hu[s] = in_slice && z < count ? slices[z * slice + pixel] : (short)XRC_PADDING_HU;
  }
  vstore16(vload16(0, hu), brick_pixel(&scan, first_brick + b, x, y), bricks);
}

/* Pairs of voxels above each other (see scan_access.h), as they are in an image, x fastest, from slice
 * `first` on. */
kernel void pair_slices(global const short* bricks, const XrcScan scan, const int first,
                        global short2* pairs) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), slice = (int)get_global_id(2);
  const int z = first + slice;
  if (x >= scan.size_x || y >= scan.size_y || z >= scan.size_z) return;
  pairs[((long)slice * scan.size_y + y) * scan.size_x + x] =
      (short2)(bricks[voxel_at(&scan, x, y, z)], bricks[voxel_at(&scan, x, y, min(z + 1, scan.size_z - 1))]);
}
