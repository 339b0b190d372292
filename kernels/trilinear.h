/* A voxel's value between its neighbours. */
#ifndef XRAYCAST_TRILINEAR_H
#define XRAYCAST_TRILINEAR_H

#include "scan_access.h"

/* At a place in voxels, held at the border voxels' centres. */
static inline float trilinear_hu(SCAN voxels, const XrcScan* scan, const float3 at) {
  const float3 last =
      (float3)((float)(scan->size_x - 1), (float)(scan->size_y - 1), (float)(scan->size_z - 1));
  const float3 held = clamp(at, (float3)(0.0f), last);
  const int x = (int)held.x, y = (int)held.y, z = (int)held.z;
  const int x1 = min(x + 1, scan->size_x - 1), y1 = min(y + 1, scan->size_y - 1),
            z1 = min(z + 1, scan->size_z - 1);
  const float fx = held.x - (float)x, fy = held.y - (float)y, fz = held.z - (float)z;
  const float lower = mix(mix(voxel_hu(voxels, scan, x, y, z), voxel_hu(voxels, scan, x1, y, z), fx),
                          mix(voxel_hu(voxels, scan, x, y1, z), voxel_hu(voxels, scan, x1, y1, z), fx), fy);
  const float upper = mix(mix(voxel_hu(voxels, scan, x, y, z1), voxel_hu(voxels, scan, x1, y, z1), fx),
                          mix(voxel_hu(voxels, scan, x, y1, z1), voxel_hu(voxels, scan, x1, y1, z1), fx), fy);
  return mix(lower, upper, fz);
}

#endif
