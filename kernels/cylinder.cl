#include "classify.h"
#include "cylinder_ray.h"
#include "params.h"

#if SLICES == 1
#define mu_of_slices mu_of
#else
#define mu_of_slices mu_of16
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
  const Ray ray = ray_along(centres[run * SLICES], directions[column], &map, &scan);
  const float air_mu = mu_of(XRC_AIR_HU, opacity, table);

#define MU_AT(i) mu_of_slices(hu_along(voxels, &scan, &ray, run, i), opacity, table)

  Slices edge_mu = air_mu;
  if (shells[0].head_mm > 0.0f && shells[0].first - 1 < ray.inside) edge_mu = MU_AT(shells[0].first - 1);
  for (int k = 0; k < map.layers; ++k) {
    const XrcShell shell = shells[k];
    const int last_inside = min(shell.last, ray.inside);
    Slices sum = (float)max(0, shell.last - max(shell.first, ray.inside)) * air_mu;
    for (int i = shell.first; i < last_inside; ++i) sum += MU_AT(i);
    Slices layer_tau = fma(sum, (Slices)map.step_mm, edge_mu * shell.head_mm);
    if (shell.tail_mm > 0.0f) {
      edge_mu = air_mu;
      if (shell.last < ray.inside) edge_mu = MU_AT(shell.last);
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
