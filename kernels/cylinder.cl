#include "params.h"
#include "classify.h"

/* The same position in the 16 slices of a brick, interpolated bilinearly; (x, y) lies within the slice. */
static float16 sample_brick(global const short* brick, const int pitch_x, const float x, const float y) {
  const int ix = (int)x, iy = (int)y;
  const float fx = x - (float)ix, fy = y - (float)iy;
  global const short* upper = brick + ((long)iy * pitch_x + ix) * XRC_BRICK_SLICES;
  global const short* lower = upper + (long)pitch_x * XRC_BRICK_SLICES;
  const float16 a = convert_float16(vload16(0, upper)), b = convert_float16(vload16(1, upper));
  const float16 c = convert_float16(vload16(0, lower)), d = convert_float16(vload16(1, lower));
  const float16 ab = fma((float16)fx, b - a, a), cd = fma((float16)fx, d - c, c);
  return fma((float16)fy, cd - ab, ab);
}

/* How many samples of a ray, at centre + (i + 1/2) * step, lie within [0, last] along one axis. The centre does. */
static int samples_within(const float centre, const float step, const int last, const int samples) {
  const float room = step > 0.0f ? (float)last - centre : centre;
  const float count = fabs(step) > 0.0f ? floor(room / fabs(step) + 0.5f) : (float)samples;
  return clamp((int)fmin(count, (float)samples), 0, samples);
}

/* One work-item follows the rays of one angle through the 16 slices of one brick and writes their texel of every
 * layer. `directions` holds the sine and cosine of every angle. All layers share one sample grid; a sample that
 * straddles a shell's edge is taken once and split by length. Samples beyond the slice are air. */
kernel void cast_cylinder(global const short* bricks, const XrcScan scan, const XrcCylinder map, const float centre_x,
                          const float centre_y, global const float2* directions, constant const XrcShell* shells,
                          constant const XrcOpacity* opacity, global const float2* table, global float* tau) {
  const int column = (int)get_global_id(0), brick = (int)get_global_id(1);
  if (column >= map.width || brick >= scan.bricks) return;
  global const short* slices = bricks + (long)brick * scan.pitch_x * scan.pitch_y * XRC_BRICK_SLICES;
  const float dx = directions[column].x * map.step_x, dy = -directions[column].y * map.step_y;
  const int inside = min(samples_within(centre_x, dx, scan.size_x - 1, map.samples),
                         samples_within(centre_y, dy, scan.size_y - 1, map.samples));
  const float air_mu = mu_of(XRC_AIR_HU, opacity, table);

/* Rounding may carry the first or last sample a hair beyond the slice; the clamp keeps its address inside. */
#define MU_AT(i)                                                                                          \
  mu_of16(sample_brick(slices, scan.pitch_x,                                                              \
                       clamp(fma((float)(i) + 0.5f, dx, centre_x), 0.0f, (float)(scan.size_x - 1)),       \
                       clamp(fma((float)(i) + 0.5f, dy, centre_y), 0.0f, (float)(scan.size_y - 1))),      \
          opacity, table)

  float16 edge_mu = air_mu;
  if (shells[0].head_mm > 0.0f && shells[0].first - 1 < inside) edge_mu = MU_AT(shells[0].first - 1);
  for (int k = 0; k < map.layers; ++k) {
    const XrcShell shell = shells[k];
    const int last_inside = min(shell.last, inside);
    float16 sum = (float)max(0, shell.last - max(shell.first, inside)) * air_mu;
    for (int i = shell.first; i < last_inside; ++i) sum += MU_AT(i);
    float16 layer_tau = fma(sum, (float16)map.step_mm, edge_mu * shell.head_mm);
    if (shell.tail_mm > 0.0f) {
      edge_mu = air_mu;
      if (shell.last < inside) edge_mu = MU_AT(shell.last);
      layer_tau = fma(edge_mu, (float16)shell.tail_mm, layer_tau);
    }
    float texels[XRC_BRICK_SLICES];
    vstore16(layer_tau, 0, texels);
    for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
      const int row = scan.size_z - 1 - (brick * XRC_BRICK_SLICES + s); /* row 0 is the most superior slice */
      if (row >= 0) tau[((long)k * map.height + row) * map.width + column] = texels[s];
    }
  }
#undef MU_AT
}
