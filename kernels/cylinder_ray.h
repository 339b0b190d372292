/* The rays of a cylinder map: one sample grid for all kernels that follow them. */
#ifndef XRAYCAST_CYLINDER_RAY_H
#define XRAYCAST_CYLINDER_RAY_H

#include "rays.h"
#include "scan_access.h"

/* The rays differ only in the number of slices per work-item: the 16 of a brick, or one of an image or,
 * with -DONE_SLICE, where the centre differs from slice to slice. */
#if defined(SCAN_IMAGE) || defined(ONE_SLICE)

#define SLICES 1
typedef float Slices;

/* Position (x, y), between voxels' centres of slice z, interpolated bilinearly. */
static Slices sample(SCAN voxels, const XrcScan* scan, const int z, const float x, const float y) {
  const int ix = (int)x, iy = (int)y;
  const float fx = x - (float)ix, fy = y - (float)iy;
  const float a = voxel_hu(voxels, scan, ix, iy, z), b = voxel_hu(voxels, scan, ix + 1, iy, z);
  const float c = voxel_hu(voxels, scan, ix, iy + 1, z), d = voxel_hu(voxels, scan, ix + 1, iy + 1, z);
  const float ab = fma(fx, b - a, a), cd = fma(fx, d - c, c);
  return fma(fy, cd - ab, ab);
}

static void store(const Slices value, float* values) { *values = value; }

#else

#define SLICES XRC_BRICK_SLICES
typedef float16 Slices;

/* Between two pixels of a row and the two below them, in 16 slices. */
static Slices bilinear16(SCAN upper, SCAN lower, const float fx, const float fy) {
  const Slices a = convert_float16(vload16(0, upper)), b = convert_float16(vload16(1, upper));
  const Slices c = convert_float16(vload16(0, lower)), d = convert_float16(vload16(1, lower));
  const Slices ab = fma((Slices)fx, b - a, a), cd = fma((Slices)fx, d - c, c);
  return fma((Slices)fy, cd - ab, ab);
}

/* The same in the 16 slices of a brick. */
static Slices sample(SCAN voxels, const XrcScan* scan, const int brick, const float x, const float y) {
  const int ix = (int)x, iy = (int)y;
  SCAN upper = voxels + brick_pixel(scan, brick, ix, iy) * XRC_BRICK_SLICES;
  return bilinear16(upper, upper + (long)scan->pitch_x * XRC_BRICK_SLICES, x - (float)ix, y - (float)iy);
}

static void store(const Slices value, float* values) { vstore16(value, 0, values); }

#endif

/* In voxels, through run `run` of SLICES slices. The first `inside` samples lie within the slice; those
 * beyond are air. */
typedef struct {
  float2 centre;
  float dx, dy;
  int inside, run;
} Ray;

/* The ray from `centre` at the angle whose sine and cosine are `direction`. */
static Ray ray_along(const float2 centre, const float2 direction, const int run, const XrcCylinder* cylinder,
                     const XrcScan* scan) {
  const int samples = cylinder->map.samples;
  Ray ray;
  ray.centre = centre;
  ray.dx = direction.x * cylinder->step_x;
  ray.dy = -direction.y * cylinder->step_y;
  ray.inside = min(samples_within(centre.x, ray.dx, scan->size_x, samples),
                   samples_within(centre.y, ray.dy, scan->size_y, samples));
  ray.run = run;
  return ray;
}

/* HU of sample i < inside, held at the border voxels' centres. */
static Slices hu_along(SCAN voxels, const XrcScan* scan, const Ray* ray, const int i) {
  const float at = (float)i + 0.5f;
  return sample(voxels, scan, ray->run,
                clamp(fma(at, ray->dx, ray->centre.x), 0.0f, (float)(scan->size_x - 1)),
                clamp(fma(at, ray->dy, ray->centre.y), 0.0f, (float)(scan->size_y - 1)));
}

#endif
