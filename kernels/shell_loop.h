/* The loop over the shells that a ray crosses, for maps of any rays. A file that includes this one has
 * defined:
 *
 *   Ray       a ray in voxels, whose first `inside` samples lie within the scan; those beyond are air
 *   Slices    values of the SLICES slices that a work-item takes at once, which `store` writes to an array
 *   hu_along  HU at a sample within the scan
 *   mu_of_slices  mu of these
 *   sum_of_mu the sum of mu at samples [first, last), all of them within the scan
 */
#ifndef XRAYCAST_SHELL_LOOP_H
#define XRAYCAST_SHELL_LOOP_H

#include "classify.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* Writes the texels of every layer: `row` is that of the lowest slice, whose neighbours have the rows above.
 * `scale` is by what the ray's samples are longer than the map's step.
 * All layers share one sample grid; a sample that straddles a shell's edge is taken once and split by length.
 */
INLINE void cast_shells(SCAN voxels, const XrcScan* scan, const Ray* ray, const XrcMap* map, const int column,
                        const int row, const float scale, constant const XrcShell* shells,
                        constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const float air_mu = mu_of(XRC_PADDING_HU, opacity, table);

#define MU_AT(i) mu_of_slices(hu_along(voxels, scan, ray, i), opacity, table)

  Slices edge_mu = air_mu;
  if (shells[0].head_mm > 0.0f && shells[0].first - 1 < ray->inside) edge_mu = MU_AT(shells[0].first - 1);
  for (int k = 0; k < map->layers; ++k) {
    const XrcShell shell = shells[k];
    Slices sum = (float)max(0, shell.last - max(shell.first, ray->inside)) * air_mu;
    sum += sum_of_mu(voxels, scan, ray, shell.first, min(shell.last, ray->inside), opacity, table);
    Slices layer_tau = fma(sum, (Slices)map->step_mm, edge_mu * shell.head_mm);
    if (shell.tail_mm > 0.0f) {
      edge_mu = air_mu;
      if (shell.last < ray->inside) edge_mu = MU_AT(shell.last);
      layer_tau = fma(edge_mu, (Slices)shell.tail_mm, layer_tau);
    }
    float texels[SLICES];
    store(layer_tau * scale, texels);
    for (int s = 0; s < SLICES; ++s)
      if (row - s >= 0) tau[((long)k * map->height + row - s) * map->width + column] = texels[s];
  }

#undef MU_AT
}

#endif
