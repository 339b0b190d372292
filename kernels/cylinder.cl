#include "classify.h"
#include "params.h"
#include "rays.h"
#include "scan_access.h"

/* A ray's work differs only in how many slices it takes at once: the 16 of a brick, or one of an image or,
 * with -DONE_SLICE, where the centre differs from slice to slice. */
#if defined(SCAN_IMAGE) || defined(ONE_SLICE)

#define SLICES 1
typedef float Slices;
#define mu_of_slices mu_of

/* Position (x, y), which lies within slice z, interpolated bilinearly. */
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
#define mu_of_slices mu_of16

/* The same position in the 16 slices of a brick, interpolated bilinearly; (x, y) lies within the slice. */
static Slices sample(SCAN voxels, const XrcScan* scan, const int brick, const float x, const float y) {
  const int ix = (int)x, iy = (int)y;
  const float fx = x - (float)ix, fy = y - (float)iy;
  SCAN upper = voxels + (((long)brick * scan->pitch_y + iy) * scan->pitch_x + ix) * XRC_BRICK_SLICES;
  SCAN lower = upper + (long)scan->pitch_x * XRC_BRICK_SLICES;
  const Slices a = convert_float16(vload16(0, upper)), b = convert_float16(vload16(1, upper));
  const Slices c = convert_float16(vload16(0, lower)), d = convert_float16(vload16(1, lower));
  const Slices ab = fma((Slices)fx, b - a, a), cd = fma((Slices)fx, d - c, c);
  return fma((Slices)fy, cd - ab, ab);
}

static void store(const Slices value, float* values) { vstore16(value, 0, values); }

#endif

/* One work-item follows the rays of one angle through SLICES slices and writes their texel of every layer.
 * `centres` holds every slice's centre in voxels, `directions` the sine and cosine of every angle. All layers
 * share one sample grid; a sample that straddles a shell's edge is taken once and split by length. Samples
 * beyond the slice are air. */
kernel void cast_cylinder(SCAN voxels, const XrcScan scan, const XrcCylinder map,
                          global const float2* centres, global const float2* directions,
                          constant const XrcShell* shells, constant const XrcOpacity* opacity,
                          global const float2* table, global float* tau) {
  const int column = (int)get_global_id(0), run = (int)get_global_id(1);
  if (column >= map.width || run * SLICES >= scan.size_z) return;
  const float2 centre = centres[run * SLICES];
  const float dx = directions[column].x * map.step_x, dy = -directions[column].y * map.step_y;
  const int inside = min(samples_within(centre.x, dx, 0.0f, (float)(scan.size_x - 1), map.samples),
                         samples_within(centre.y, dy, 0.0f, (float)(scan.size_y - 1), map.samples));
  const float air_mu = mu_of(XRC_AIR_HU, opacity, table);

/* Rounding may carry the first or last sample a hair beyond the slice; the clamp keeps its address inside. */
#define MU_AT(i)                                                                                    \
  mu_of_slices(sample(voxels, &scan, run,                                                           \
                      clamp(fma((float)(i) + 0.5f, dx, centre.x), 0.0f, (float)(scan.size_x - 1)),  \
                      clamp(fma((float)(i) + 0.5f, dy, centre.y), 0.0f, (float)(scan.size_y - 1))), \
               opacity, table)

  Slices edge_mu = air_mu;
  if (shells[0].head_mm > 0.0f && shells[0].first - 1 < inside) edge_mu = MU_AT(shells[0].first - 1);
  for (int k = 0; k < map.layers; ++k) {
    const XrcShell shell = shells[k];
    const int last_inside = min(shell.last, inside);
    Slices sum = (float)max(0, shell.last - max(shell.first, inside)) * air_mu;
    for (int i = shell.first; i < last_inside; ++i) sum += MU_AT(i);
    Slices layer_tau = fma(sum, (Slices)map.step_mm, edge_mu * shell.head_mm);
    if (shell.tail_mm > 0.0f) {
      edge_mu = air_mu;
      if (shell.last < inside) edge_mu = MU_AT(shell.last);
      layer_tau = fma(edge_mu, (Slices)shell.tail_mm, layer_tau);
    }
    float texels[SLICES];
    store(layer_tau, texels);
    for (int s = 0; s < SLICES; ++s) {
      const int row = scan.size_z - 1 - (run * SLICES + s); /* row 0 is the most superior slice */
      if (row >= 0) tau[((long)k * map.height + row) * map.width + column] = texels[s];
    }
  }
#undef MU_AT
}
