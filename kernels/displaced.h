/* A scan that is displaced while rays pass through it, with -DMOVED: see XrcField. Kernels take the
 * displacement as their last parameters, a `Ray` keeps it. */
#ifndef XRAYCAST_DISPLACED_H
#define XRAYCAST_DISPLACED_H

#ifdef MOVED

#include "trilinear.h"

#define MOVED_PARAMETERS , const XrcField field, global const float4 *nodes
#define MOVED_POINTERS , const XrcField *field, global const float4 *nodes
#define MOVED_ARGUMENTS , &field, nodes

/* Where a node or its neighbour is along an axis, and the share of the neighbour. */
typedef struct {
  int node;
  float share;
} NodePlace;

static inline NodePlace node_place(const float at, const int size) {
  NodePlace place;
  place.node = clamp((int)at, 0, size - 2);
  place.share = at - (float)place.node;
  return place;
}

/* At one of the grid's levels along z. */
static inline float4 displacement_in(const XrcField* field, global const float4* nodes, const NodePlace x,
                                     const NodePlace y, const int level) {
  global const float4* at = nodes + ((long)level * field->size_y + y.node) * field->size_x + x.node;
  const float4 upper = mix(at[0], at[1], x.share),
               lower = mix(at[field->size_x], at[field->size_x + 1], x.share);
  return mix(upper, lower, y.share);
}

/* At a place in voxels, which lies between the border voxels' centres. */
static inline float3 displacement_at(const XrcField* field, global const float4* nodes, const float3 at) {
  const NodePlace x = node_place(at.x * field->nodes_per_voxel[0], field->size_x),
                  y = node_place(at.y * field->nodes_per_voxel[1], field->size_y),
                  z = node_place(at.z * (1.0f / MOVED), field->size_z);
  return mix(displacement_in(field, nodes, x, y, z.node), displacement_in(field, nodes, x, y, z.node + 1),
             z.share)
      .xyz;
}

/* HU of the moved scan at a place in voxels: air where the place shows what lies beyond the scan's faces. */
static inline float displaced_hu(SCAN voxels, const XrcScan* scan, const XrcField* field,
                                 global const float4* nodes, const float3 at) {
  const float3 source = at + displacement_at(field, nodes, at),
               size = (float3)((float)scan->size_x, (float)scan->size_y, (float)scan->size_z);
  if (any(source < -0.5f) || any(source > size - 0.5f)) return XRC_PADDING_HU;
  return trilinear_hu(voxels, scan, source);
}

#else

#define MOVED_PARAMETERS
#define MOVED_POINTERS
#define MOVED_ARGUMENTS

#endif
#endif
