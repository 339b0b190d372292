#include "cylinder_ray.h"
#include "params.h"

/* Knots, ascending. upto[i] of them lie at or below XRC_AIR_HU + i. */
typedef struct {
  constant const float* hu;
  global const uchar* upto;
  int count;
} Knots;

/* Adds the length of a sample to the two knots beside it; beyond the end knots, to the end knot. */
static void weigh(const float hu, const float length_mm, const Knots* knots, float* weights_mm) {
  const int cell = clamp((int)floor(hu) - XRC_AIR_HU, 0, 32767 - XRC_AIR_HU);
  int above = knots->upto[cell];
  while (above < knots->count && knots->hu[above] <= hu) ++above; /* between two whole HU */
  if (above == 0 || above == knots->count) {
    weights_mm[max(above - 1, 0) * XRC_BRICK_SLICES] += length_mm;
  } else {
    const float lower = knots->hu[above - 1];
    const float upper_mm = length_mm * (hu - lower) / (knots->hu[above] - lower);
    weights_mm[(above - 1) * XRC_BRICK_SLICES] += length_mm - upper_mm;
    weights_mm[above * XRC_BRICK_SLICES] += upper_mm;
  }
}

/* One work-item weighs one tile, from first_tile on. Its rows go to the beginning of its room for `count`
 * rows, in the order of the knots; bit k of `touched` says whether knot k has one.
 *
 * The running sum over the knots is rounded, not each weight: so the error does not add up, and that of an
 * optical depth is at most half a unit times the opacity's total variation over the knots; a constant opacity
 * is exact. */
kernel void weigh_tiles(SCAN voxels, const XrcScan scan, const XrcCylinder map, global const float2* centres,
                        global const float2* directions, constant const XrcShell* shells,
                        constant const float* knots_hu, global const uchar* upto, const int count,
                        const long first_tile, const int tiles, global ulong* touched,
                        global ushort* weights) {
  const int item = (int)get_global_id(0);
  if (item >= tiles) return;
  const long tile = first_tile + item;
  const int column = (int)(tile % map.width);
  const XrcShell shell = shells[tile / map.width % map.layers];
  const int brick = (int)(tile / map.width / map.layers);
  const Knots knots = {knots_hu, upto, count};

  float weights_mm[XRC_MAX_KNOTS * XRC_BRICK_SLICES];
  for (int i = 0; i < count * XRC_BRICK_SLICES; ++i) weights_mm[i] = 0.0f;
  const int first = shell.head_mm > 0.0f ? shell.first - 1 : shell.first;
  const int last = shell.tail_mm > 0.0f ? shell.last + 1 : shell.last;
  for (int start = 0; start < XRC_BRICK_SLICES; start += SLICES) {
    const int run = (brick * XRC_BRICK_SLICES + start) / SLICES;
    if (run * SLICES >= scan.size_z) break;
    const Ray ray = ray_along(centres[run * SLICES], directions[column], &map, &scan);
    for (int i = first; i < last; ++i) {
      const float length_mm = i < shell.first ? shell.head_mm : i < shell.last ? map.step_mm : shell.tail_mm;
      float hu[SLICES];
      store(i < ray.inside ? hu_along(voxels, &scan, &ray, run, i) : (Slices)XRC_AIR_HU, hu);
      for (int s = 0; s < SLICES; ++s) weigh(hu[s], length_mm, &knots, weights_mm + start + s);
    }
  }

  float units_per_mm[XRC_BRICK_SLICES], sum_mm[XRC_BRICK_SLICES];
  int sum[XRC_BRICK_SLICES];
  for (int s = 0; s < XRC_BRICK_SLICES; ++s) {
    float total_mm = 0.0f;
    for (int k = 0; k < count; ++k) total_mm += weights_mm[k * XRC_BRICK_SLICES + s];
    units_per_mm[s] = total_mm > 0.0f ? XRC_WEIGHT_SUM / total_mm : 0.0f; /* 0 beyond the last slice */
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
kernel void count_hu(SCAN voxels, const XrcScan scan, global uint* histograms) {
  const int y = (int)get_global_id(0), brick = (int)get_global_id(1);
  if (y >= scan.size_y) return;
  uint counts[XRC_HISTOGRAM_BINS];
  for (int i = 0; i < XRC_HISTOGRAM_BINS; ++i) counts[i] = 0;
  const int first = brick * XRC_BRICK_SLICES, last = min(first + XRC_BRICK_SLICES, scan.size_z);
  for (int x = 0; x < scan.size_x; ++x) {
    for (int z = first; z < last; ++z) {
      const int bin = ((int)voxel_hu(voxels, &scan, x, y, z) - XRC_AIR_HU) / XRC_HISTOGRAM_BIN_HU;
      ++counts[clamp(bin, 0, XRC_HISTOGRAM_BINS - 1)];
    }
  }
  for (int i = 0; i < XRC_HISTOGRAM_BINS; ++i)
    if (counts[i] > 0) atomic_add(histograms + brick * XRC_HISTOGRAM_BINS + i, counts[i]);
}
