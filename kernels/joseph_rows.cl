#include "joseph_rows.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

#ifndef SCAN_IMAGE

/* The picture of a flat detector, from bricks: one work-item takes 16 rows of a column. Columns come in tiles
 * of get_global_size(0), so that what they share of the scan stays in a cache. */
kernel void project_rows(SCAN voxels, const XrcScan scan, const XrcDetector detector,
                         constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const int i = (int)(get_global_id(2) * get_global_size(0) + get_global_id(0)),
            first_row = ROWS * (int)get_global_id(1);
  if (i >= detector.width || first_row >= detector.height) return;
  project_16(voxels, &scan, &detector, i, first_row, opacity, table, tau);
}

#endif
