#include "cylinder_ray.h"
#include "xraycast/kernels/params.h"

/* Adds the length of a sample to the two knots beside its HU; beyond the end knots, to the end knot. A knot
 * is its HU and 1 / the distance to the next, which is 0 for the last; behind it stands an infinite one.
 * below[i] is the last knot at or below XRC_PADDING_HU + i. Weights of neighbouring knots lie 16 floats
 * apart. */
static void weigh(const float hu, const float length_mm, global const float2* knots,
                  global const uchar* below, float* weights_mm) {
  const float held = fmax(hu, knots[0].x);
  int k = below[(int)floor(held) - XRC_PADDING_HU];
  while (held >= knots[k + 1].x) ++k; /* knots between two whole HU */
  const float upper_mm = length_mm * ((held - knots[k].x) * knots[k].y);
  weights_mm[k * XRC_BRICK_SLICES] += length_mm - upper_mm;
  weights_mm[(k + 1) * XRC_BRICK_SLICES] += upper_mm;
}

/* One work-item weighs one tile, from first_tile on. Its rows go to the beginning of its room for `count`
 * rows, in the order of the knots; bit k of `touched` says whether knot k has one.
 *
 * The running sum over the knots is rounded, not each weight: so the error does not add up, and that of an
 * optical depth is at most half a unit times the opacity's total variation over the knots; a constant opacity
 * is exact. */
kernel void weigh_tiles(SCAN voxels, const XrcScan scan, const XrcCylinder cylinder,
                        global const float2* centres, global const float2* directions,
                        global const float* scales, constant const XrcShell* shells,
                        global const float2* knots, global const uchar* below, const int count,
                        const long first_tile, const int tiles, global ulong* touched,
                        global ushort* weights MOVED_PARAMETERS) {
  const int item = (int)get_global_id(0);
  if (item >= tiles) return;
  const long tile = first_tile + item;
  const int column = (int)(tile % cylinder.map.width);
  const XrcShell shell = shells[tile / cylinder.map.width % cylinder.map.layers];
  const int brick = (int)(tile / cylinder.map.width / cylinder.map.layers);

  float weights_mm[(XRC_MAX_KNOTS + 1) * XRC_BRICK_SLICES];
  for (int i = 0; i < (count + 1) * XRC_BRICK_SLICES; ++i) weights_mm[i] = 0.0f;
  const int first = shell.head_mm > 0.0f ? shell.first - 1 : shell.first;
  const int last = shell.tail_mm > 0.0f ? shell.last + 1 : shell.last;
  for (int start = 0; start < XRC_BRICK_SLICES; start += SLICES) {
    const int run = (brick * XRC_BRICK_SLICES + start) / SLICES;
    if (run * SLICES >= scan.size_z) break;
    const float scale = scales[(scan.size_z - 1 - run * SLICES) * cylinder.map.scale_stride + column];
    const Ray ray =
        ray_along(centres[run * SLICES], directions[column] * scale, run, &cylinder, &scan MOVED_ARGUMENTS);
    for (int i = first; i < last; ++i) {
      const float length_mm = i < shell.first  ? shell.head_mm
                              : i < shell.last ? cylinder.map.step_mm
                                               : shell.tail_mm;
      float hu[SLICES];
      store(i < ray.inside ? hu_along(voxels, &scan, &ray, i) : (Slices)XRC_PADDING_HU, hu);
      for (int s = 0; s < SLICES; ++s) weigh(hu[s], length_mm, knots, below, weights_mm + start + s);
    }
  }

  float units_per_mm[XRC_BRICK_SLICES], sum_mm[XRC_BRICK_SLICES];
  int sum[XRC_BRICK_SLICES];
  for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
    float total_mm = 0.0f;
    for (int k = 0; k < count; ++k) total_mm += weights_mm[k * XRC_BRICK_SLICES + s];
    /* The padding of the last brick has no weight, nor has a shell without thickness. */
    const int counts = brick * XRC_BRICK_SLICES + s < scan.size_z && total_mm > 0.0f;
    units_per_mm[s] = counts ? XRC_WEIGHT_SUM / total_mm : 0.0f;
    sum_mm[s] = 0.0f;
    sum[s] = 0;
  }
  ulong mask = 0;
  global ushort* rows = weights + (long)item * count * XRC_BRICK_SLICES;
  for (int k = 0; k < count; ++k) {
    ushort row[XRC_BRICK_SLICES];
    int any = 0;
    for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
      sum_mm[s] += weights_mm[k * XRC_BRICK_SLICES + s];
      const int next = (int)(sum_mm[s] * units_per_mm[s] + 0.5f);
      row[s] = (ushort)(next - sum[s]);
      any |= next - sum[s];
      sum[s] = next;
    }
    if (any == 0) continue;
    mask |= (ulong)1 << k;
    vstore16(vload16(0, row), 0, rows);
    rows += XRC_BRICK_SLICES;
  }
  touched[item] = mask;
}

/* Counts the voxels of one row of pixels through 16 slices, into the histogram of these slices. */
kernel void count_hu(SCAN voxels, const XrcScan scan, const int stride, global uint* histograms) {
  const int y = (int)get_global_id(0) * stride, brick = (int)get_global_id(1);
  if (y >= scan.size_y) return;
  uint counts[XRC_HISTOGRAM_BINS];
  for (int i = 0; i < XRC_HISTOGRAM_BINS; ++i) counts[i] = 0;
  const int first = brick * XRC_BRICK_SLICES, last = min(first + XRC_BRICK_SLICES, scan.size_z);
  for (int x = 0; x < scan.size_x; x += stride) {
    for (int z = first; z < last; ++z) {
      const int bin = ((int)voxel_hu(voxels, &scan, x, y, z) - XRC_PADDING_HU) / XRC_HISTOGRAM_BIN_HU;
      ++counts[clamp(bin, 0, XRC_HISTOGRAM_BINS - 1)];
    }
  }
  for (int i = 0; i < XRC_HISTOGRAM_BINS; ++i)
    if (counts[i] > 0) atomic_add(histograms + brick * XRC_HISTOGRAM_BINS + i, counts[i]);
}
