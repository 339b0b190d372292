#include "classify.h"
#include "displaced.h"
#include "rays.h"
#include "scan_access.h"
#include "trilinear.h"
#include "xraycast/kernels/params.h"

#define SLICES 1
#define mu_of_slices mu_of
typedef float Slices;

/* In voxels. The first `inside` samples lie within the scan; those beyond are air. */
typedef struct {
  float3 centre, step;
  int inside;
#ifdef MOVED
  const XrcField* field;
  global const float4* nodes;
#endif
} Ray;

/* HU of sample i < inside. */
INLINE Slices hu_along(SCAN voxels, const XrcScan* scan, const Ray* ray, const int i) {
  const float3 at = fma((float3)((float)i + 0.5f), ray->step, ray->centre);
#ifdef MOVED
  const float3 last =
      (float3)((float)(scan->size_x - 1), (float)(scan->size_y - 1), (float)(scan->size_z - 1));
  return displaced_hu(voxels, scan, ray->field, ray->nodes, clamp(at, (float3)(0.0f), last));
#else
  return trilinear_hu(voxels, scan, at);
#endif
}

/* The sum of mu at samples [first, last), which lie within the scan. */
INLINE Slices sum_of_mu(SCAN voxels, const XrcScan* scan, const Ray* ray, const int first, const int last,
                        constant const XrcOpacity* opacity, global const float2* table) {
  Slices sum = 0.0f;
  for (int i = first; i < last; ++i) sum += mu_of(hu_along(voxels, scan, ray, i), opacity, table);
  return sum;
}

INLINE void store(const Slices value, float* values) { *values = value; }

#include "shell_loop.h"

/* The ray at the angles whose sine and cosine are `azimuth` and `polar`. */
INLINE Ray ray_along(const float2 azimuth, const float2 polar, const float scale, const XrcSphere* sphere,
                     const XrcScan* scan MOVED_POINTERS) {
  const int samples = sphere->map.samples;
  Ray ray;
  ray.centre = (float3)(sphere->centre[0], sphere->centre[1], sphere->centre[2]);
  ray.step = scale * (float3)(polar.x * azimuth.x * sphere->step[0], -polar.x * azimuth.y * sphere->step[1],
                              polar.y * sphere->step[2]);
  ray.inside = min(min(samples_within(ray.centre.x, ray.step.x, scan->size_x, samples),
                       samples_within(ray.centre.y, ray.step.y, scan->size_y, samples)),
                   samples_within(ray.centre.z, ray.step.z, scan->size_z, samples));
#ifdef MOVED
  ray.field = field;
  ray.nodes = nodes;
#endif
  return ray;
}

/* One work-item follows one ray and writes its texel of every layer, as in cast_cylinder. `azimuths` and
 * `polars` hold the sine and cosine of every column's phi and every row's theta, `scales` is as there. */
kernel void cast_sphere(SCAN voxels, const XrcScan scan, const XrcSphere sphere, global const float2* polars,
                        global const float2* azimuths, global const float* scales,
                        constant const XrcShell* shells, constant const XrcOpacity* opacity,
                        global const float2* table, global float* tau MOVED_PARAMETERS) {
  const int column = (int)get_global_id(0), row = (int)get_global_id(1);
  if (column >= sphere.map.width || row >= sphere.map.height) return;
  const float scale = scales[row * sphere.map.scale_stride + column];
  const Ray ray = ray_along(azimuths[column], polars[row], scale, &sphere, &scan MOVED_ARGUMENTS);
  cast_shells(voxels, &scan, &ray, &sphere.map, column, row, scale, shells, opacity, table, tau);
}
