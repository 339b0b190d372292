#include "classify.h"
#include "cylinder_ray.h"
#include "xraycast/kernels/params.h"

#if SLICES < 16

/* The sum of mu at samples [first, last), which lie within the slices. */
static Slices sum_of_mu(SCAN voxels, const XrcScan* scan, const Ray* ray, const int first, const int last,
                        constant const XrcOpacity* opacity, global const float2* table) {
  Slices sum = 0.0f;
#pragma unroll 4
  for (int i = first; i < last; ++i) sum += mu_of_slices(hu_along(voxels, scan, ray, i), opacity, table);
  return sum;
}

#elif defined(MOVED)

/* The same in 16 slices of the moved scan. */
static Slices sum_of_mu(SCAN voxels, const XrcScan* scan, const Ray* ray, const int first, const int last,
                        constant const XrcOpacity* opacity, global const float2* table) {
  Slices sum = 0.0f;
  if (first >= last) return sum;
  Offsets from = offsets_along(scan, ray, first - first % OFFSETS_STEP);
  for (int i = first; i < last;) {
    const int next = i - i % OFFSETS_STEP + OFFSETS_STEP;
    const Offsets to = offsets_along(scan, ray, next);
    for (; i < min(next, last); ++i)
      sum += mu_of16(hu_between(voxels, scan, ray, i, &from, &to), opacity, table);
    from = to;
  }
  return sum;
}

#else

/* The same in 16 slices. Where samples lie is found for a strip of 16 of them at once, one strip ahead, so
 * that what is left for each is the arithmetic on its slices, and what it reads was fetched a strip earlier.
 */
#define STRIP 16

typedef struct {
  int pixel[STRIP];
  float fx[STRIP], fy[STRIP];
} Strip;

static Strip strip_from(const int first, const Ray* ray, const XrcScan* scan) {
  const float16 at = (float)first + 0.5f + (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const float16 x = clamp(fma(at, (float16)ray->dx, (float16)ray->centre.x), 0.0f, (float)(scan->size_x - 1));
  const float16 y = clamp(fma(at, (float16)ray->dy, (float16)ray->centre.y), 0.0f, (float)(scan->size_y - 1));
  const int16 ix = convert_int16(x), iy = convert_int16(y);
  Strip strip;
  vstore16(iy * scan->pitch_x + ix, 0, strip.pixel);
  vstore16(x - convert_float16(ix), 0, strip.fx);
  vstore16(y - convert_float16(iy), 0, strip.fy);
  return strip;
}

static void fetch_pixels(SCAN row) { /* two neighbours, which may lie in two cache lines */
  prefetch_line(row);
  prefetch_line(row + 2 * XRC_BRICK_SLICES - 1);
}

static Slices sum_of_mu(SCAN voxels, const XrcScan* scan, const Ray* ray, const int first, const int last,
                        constant const XrcOpacity* opacity, global const float2* table) {
  const long row_step = (long)scan->pitch_x * XRC_BRICK_SLICES;
  SCAN brick = first_of_run(voxels, scan, ray->run);
  Slices sum = 0.0f;
  Strip strip = strip_from(first, ray, scan);
  for (int from = first; from < last; from += STRIP) {
    const Strip next = strip_from(from + STRIP, ray, scan);
    const int count = min(STRIP, last - from);
    for (int i = 0; i < count; ++i) {
      SCAN ahead = brick + (long)next.pixel[i] * XRC_BRICK_SLICES;
      fetch_pixels(ahead);
      fetch_pixels(ahead + row_step);
      SCAN upper = brick + (long)strip.pixel[i] * XRC_BRICK_SLICES;
      sum += mu_of16(bilinear(upper, upper + row_step, strip.fx[i], strip.fy[i]), opacity, table);
    }
    strip = next;
  }
  return sum;
}

#endif

#include "shell_loop.h"

/* One work-item follows the rays of one angle through SLICES slices of a brick and writes their texel of
 * every layer. Neighbours take the brick's other slices, which lie beside them in memory. `centres` holds
 * every slice's centre in voxels, `directions` the sine and cosine of every angle, `scales` by what the
 * texels' rays and their shells are longer (MapGeometry::outline_mm). */
kernel void cast_cylinder(SCAN voxels, const XrcScan scan, const XrcCylinder cylinder,
                          global const float2* centres, global const float2* directions,
                          global const float* scales, constant const XrcShell* shells,
                          constant const XrcOpacity* opacity, global const float2* table,
                          global float* tau MOVED_PARAMETERS) {
  const int part = (int)get_global_id(0), column = (int)get_global_id(1), brick = (int)get_global_id(2);
  const int run = brick * (XRC_BRICK_SLICES / SLICES) + part;
  if (column >= cylinder.map.width || run * SLICES >= scan.size_z) return;
  const int row = scan.size_z - 1 - run * SLICES; /* row 0 is the most superior slice */
  const float scale = scales[row * cylinder.map.scale_stride + column];
  const Ray ray =
      ray_along(centres[run * SLICES], directions[column] * scale, run, &cylinder, &scan MOVED_ARGUMENTS);
  cast_shells(voxels, &scan, &ray, &cylinder.map, column, row, scale, shells, opacity, table, tau);
}
