#include "joseph_rows.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* The pictures of flat detectors of one size, one behind the other, from bricks: one work-item takes 16 rows
 * of a column. Columns come in tiles of get_global_size(0), so that what they share of the scan stays in a
 * cache. */
kernel void project_rows(SCAN voxels, const XrcScan scan, global const XrcDetector* detectors,
                         constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const PictureColumn at = picture_column(detectors);
  const XrcDetector detector = detectors[at.picture];
  const int first_row = ROWS * (int)get_global_id(1);
  if (at.column >= detector.width || first_row >= detector.height) return;
  project_16(voxels, &scan, &detector, at.column, first_row, opacity, table,
             tau + (long)at.picture * detector.width * detector.height);
}
