/* One voxel of a resident scan: from its bricks (see XrcScan), or with -DSCAN_IMAGE from a 3-D image whose
 * texels are pairs of voxels, one and the next above it, in the lower and the upper half of 32 bits. It is
 * read without a linear sampler, since those may weigh with 8 bits only. */
#ifndef XRAYCAST_SCAN_ACCESS_H
#define XRAYCAST_SCAN_ACCESS_H

#include "scan_layout.h"

/* Asks for the cache line of an address that will be read soon. A processor's compiler has a built-in, which
 * takes pointers without an address space, where PoCL's own `prefetch` does nothing. */
#if defined(__x86_64__) || defined(__aarch64__)
#define prefetch_line(address) __builtin_prefetch((const void*)(size_t)(address))
#else
#define prefetch_line(address) prefetch(address, 1)
#endif

#ifdef SCAN_IMAGE

#define SCAN read_only image3d_t
constant sampler_t kNearest = CLK_NORMALIZED_COORDS_FALSE | CLK_ADDRESS_CLAMP_TO_EDGE | CLK_FILTER_NEAREST;

/* A voxel and the next above it; above the uppermost slice that slice again. */
static inline float2 voxel_pair(SCAN voxels, const int x, const int y, const int z) {
  return convert_float2(as_short2(read_imagei(voxels, kNearest, (int4)(x, y, z, 0)).x));
}

static inline float voxel_hu(SCAN voxels, const XrcScan* scan, const int x, const int y, const int z) {
  (void)scan;
  return voxel_pair(voxels, x, y, z).x;
}

#else

#define SCAN global const short*

static inline float voxel_hu(SCAN voxels, const XrcScan* scan, const int x, const int y, const int z) {
  return (float)voxels[voxel_at(scan, x, y, z)];
}

#endif
#endif
