#include "classify.h"
#include "rays.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

/* Trilinear, held at the border voxels' centres. */
static float sample(SCAN voxels, const XrcScan* scan, const float3 at) {
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

/* One work-item follows one ray and writes its texel of every layer, as in cast_cylinder. `azimuths` and
 * `polars` hold the sine and cosine of every column's phi and every row's theta. */
kernel void cast_sphere(SCAN voxels, const XrcScan scan, const XrcSphere map, global const float2* polars,
                        global const float2* azimuths, constant const XrcShell* shells,
                        constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const int column = (int)get_global_id(0), row = (int)get_global_id(1);
  if (column >= map.width || row >= map.height) return;
  const float2 azimuth = azimuths[column], polar = polars[row];
  const float3 centre = (float3)(map.centre[0], map.centre[1], map.centre[2]);
  const float3 step =
      (float3)(polar.x * azimuth.x * map.step[0], -polar.x * azimuth.y * map.step[1], polar.y * map.step[2]);
  const int inside = min(min(samples_within(centre.x, step.x, 0.0f, (float)(scan.size_x - 1), map.samples),
                             samples_within(centre.y, step.y, 0.0f, (float)(scan.size_y - 1), map.samples)),
                         samples_within(centre.z, step.z, -0.5f, (float)scan.size_z - 0.5f, map.samples));
  const float air_mu = mu_of(XRC_PADDING_HU, opacity, table);

#define MU_AT(i) mu_of(sample(voxels, &scan, fma((float3)((float)(i) + 0.5f), step, centre)), opacity, table)

  float edge_mu = air_mu;
  if (shells[0].head_mm > 0.0f && shells[0].first - 1 < inside) edge_mu = MU_AT(shells[0].first - 1);
  for (int k = 0; k < map.layers; ++k) {
    const XrcShell shell = shells[k];
    const int last_inside = min(shell.last, inside);
    float sum = (float)max(0, shell.last - max(shell.first, inside)) * air_mu;
    for (int i = shell.first; i < last_inside; ++i) sum += MU_AT(i);
    float layer_tau = fma(sum, map.step_mm, edge_mu * shell.head_mm);
    if (shell.tail_mm > 0.0f) {
      edge_mu = air_mu;
      if (shell.last < inside) edge_mu = MU_AT(shell.last);
      layer_tau = fma(edge_mu, shell.tail_mm, layer_tau);
    }
    tau[((long)k * map.height + row) * map.width + column] = layer_tau;
  }
#undef MU_AT
}
