#include "classify.h"
#include "joseph_ray.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* The picture of a flat detector: one work-item per pixel. */
kernel void project_detector(SCAN voxels, const XrcScan scan, const XrcDetector detector,
                             constant const XrcOpacity* opacity, global const float2* table,
                             global float* tau) {
  const int i = (int)get_global_id(0), j = (int)get_global_id(1);
  if (i >= detector.width || j >= detector.height) return;
  tau[(long)j * detector.width + i] = joseph_pixel(voxels, &scan, &detector, i, j, opacity, table);
}

/* Arbitrary rays: start and end of each, in voxels. */
kernel void project_rays(SCAN voxels, const XrcScan scan, const float4 spacing_mm, const int count,
                         global const float4* segments, constant const XrcOpacity* opacity,
                         global const float2* table, global float* tau) {
  const int i = (int)get_global_id(0);
  if (i >= count) return;
  tau[i] =
      joseph(voxels, &scan, spacing_mm.xyz, segments[2 * i].xyz, segments[2 * i + 1].xyz, opacity, table);
}
