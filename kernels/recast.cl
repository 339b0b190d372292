#include "xraycast/kernels/params.h"

/* See params.h for tiles. A work-item takes `run` tiles of one brick and layer, one column after the other,
 * so that neighbouring texels are written together. */

typedef struct {
  int layer, column, row; /* of the first slice; the row falls as the slices rise */
} TilePlace;

static TilePlace place_of(const long tile, const int width, const int height, const int layers) {
  TilePlace place;
  place.column = (int)(tile % width);
  place.layer = (int)(tile / width % layers);
  place.row = height - 1 - (int)(tile / width / layers) * XRC_BRICK_SLICES;
  return place;
}

/* tau = sum over the knots of mu * weight, times the scale of the texel's ray (see cast_cylinder). */
kernel void recast(global const ulong* touched, global const uint* first_row, global const ushort* weights,
                   const long tiles, const int run, const int width, const int height, const int layers,
                   constant const float* unit_mm, global const float* scales, const int scale_stride,
                   constant const float* mu, global float* tau) {
  const long first = (long)get_global_id(0) * run;
  for (long tile = first; tile < min(first + run, tiles); ++tile) {
    float16 sum = 0.0f;
    global const ushort* row = weights + (long)first_row[tile] * XRC_BRICK_SLICES;
    for (ulong left = touched[tile]; left != 0; left &= left - 1) {
      const int knot = (int)popcount((left & -left) - 1);
      sum = fma(convert_float16(vload16(0, row)), (float16)mu[knot], sum);
      row += XRC_BRICK_SLICES;
    }
    const TilePlace place = place_of(tile, width, height, layers);
    float texels[XRC_BRICK_SLICES];
    vstore16(sum * unit_mm[place.layer], 0, texels);
    global float* texel = tau + ((long)place.layer * height + place.row) * width + place.column;
    const int slices = min(XRC_BRICK_SLICES, place.row + 1);
    global const float* scale = scales + (long)place.row * scale_stride + place.column;
    for (int s = 0; s < slices; ++s) texel[-(long)s * width] = texels[s] * scale[-(long)s * scale_stride];
  }
}
