/* Where the voxels of a resident scan are; see XrcScan. The host compiles this too, so that its tests can ask
 * for places in scans that are larger than any machine's memory. */
#ifndef XRAYCAST_SCAN_LAYOUT_H
#define XRAYCAST_SCAN_LAYOUT_H

#include "xraycast/kernels/params.h"

/* The place of pixel (x, y) of a brick, in pixels of 16 slices. */
static inline XRC_LONG brick_pixel(const XrcScan* scan, const XRC_INT brick, const XRC_INT x,
                                   const XRC_INT y) {
  const XRC_LONG first = brick;
  return (first * scan->pitch_y + y) * scan->pitch_x + x;
}

/* Blocks along an axis of so many voxels (XRC_BLOCK). */
static inline XRC_INT blocks_of(const XRC_INT size) { return (size + XRC_BLOCK - 1) / XRC_BLOCK; }

/* The place of a voxel. */
static inline XRC_LONG voxel_at(const XrcScan* scan, const XRC_INT x, const XRC_INT y, const XRC_INT z) {
  return brick_pixel(scan, z / XRC_BRICK_SLICES, x, y) * XRC_BRICK_SLICES + z % XRC_BRICK_SLICES;
}

#endif
