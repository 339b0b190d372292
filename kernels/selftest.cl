#include "xraycast/kernels/params.h"

/* A known value for every element, so that a device that computes or copies wrongly is caught. */
kernel void selftest_buffer(global const float* in, global float* out, const int n) {
  const int i = (int)get_global_id(0);
  if (i >= n) return;
  out[i] = fma(in[i], 2.0f, 1.0f);
}

/* Some drivers return zeros from 3-D read_imagef; the host compares these samples with the values it wrote.
 */
kernel void selftest_image(read_only image3d_t image, global float* out) {
  const sampler_t nearest = CLK_NORMALIZED_COORDS_FALSE | CLK_ADDRESS_CLAMP_TO_EDGE | CLK_FILTER_NEAREST;
  const int x = (int)get_global_id(0), y = (int)get_global_id(1), z = (int)get_global_id(2);
  const int w = get_image_width(image), h = get_image_height(image), d = get_image_depth(image);
  if (x >= w || y >= h || z >= d) return;
  out[(z * h + y) * w + x] = read_imagef(image, nearest, (int4)(x, y, z, 0)).x;
}
