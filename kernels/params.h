/* Types and constants that host and kernels share. Included by C++ and by OpenCL C; every struct is made of
 * 4-byte members only, so that both sides agree on its layout, and each has its size asserted on the host. */
#ifndef XRAYCAST_PARAMS_H
#define XRAYCAST_PARAMS_H

#ifdef __OPENCL_C_VERSION__
#define XRC_INT int
#define XRC_FLOAT float
#else
#include <stdint.h>
#define XRC_INT int32_t
#define XRC_FLOAT float
#endif

/* CT numbers at and below which there is nothing: what rays meet outside the scan. */
#define XRC_AIR_HU (-1024)

/* A scan on the device: bricks of 16 slices, interleaved voxel by voxel, so that one load takes the same pixel of
 * 16 slices. HU of voxel (x, y, z) is at ((z / 16 * pitch_y + y) * pitch_x + x) * 16 + z % 16. Slices have one more
 * column and row than the scan, and the last brick more slices, all of them air, so that the neighbour behind every
 * voxel can be read.
 *
 * Within a slice the scan ends at the centres of its border voxels: there is nothing to interpolate beyond (the
 * convention of RTK). Along z every slice stands for its thickness. */
#define XRC_BRICK_SLICES 16
typedef struct {
  XRC_INT size_x, size_y, size_z; /* voxels */
  XRC_INT pitch_x, pitch_y;       /* pixels of a stored slice */
  XRC_INT bricks;
} XrcScan;

/* One shell of a ray whose samples are step_mm long: the rest of the sample that the inner edge cuts, the whole
 * samples [first, last), and the part of sample `last` inside the outer edge. */
typedef struct {
  XRC_INT first, last;
  XRC_FLOAT head_mm, tail_mm;
} XrcShell;

typedef struct {
  XRC_INT width, height, layers;
  XRC_INT samples; /* of a whole ray */
  XRC_FLOAT step_mm;
  XRC_FLOAT step_x, step_y; /* voxels along x and y for step_mm */
} XrcCylinder;

/* mu(hu) = mu0 + sum of slope * max(0, hu - from) over the ramps. */
#define XRC_MAX_RAMPS 4
typedef struct {
  XRC_FLOAT mu0;
  XRC_FLOAT from[XRC_MAX_RAMPS], slope[XRC_MAX_RAMPS];
  /* Otherwise a table from first_hu on: entry i holds mu and its change to the next whole HU. */
  XRC_FLOAT first_hu;
  XRC_INT entries;
} XrcOpacity;

/* A flat detector in voxel coordinates. Pixel (i, j) is hit at corner + i right + j down. Under a cone all rays
 * start at `source`; without one they run along `beam`, from one side of the scan to the other. */
typedef struct {
  XRC_INT width, height, is_cone;
  XRC_FLOAT corner[3], right[3], down[3], source[3], beam[3];
  XRC_FLOAT spacing_mm[3];
} XrcDetector;

#endif
