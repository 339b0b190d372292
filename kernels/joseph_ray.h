/* The optical depth along any one ray by Joseph's method; see projector.hpp. */
#ifndef XRAYCAST_JOSEPH_RAY_H
#define XRAYCAST_JOSEPH_RAY_H

#include "classify.h"
#include "scan_access.h"
#include "xraycast/kernels/params.h"

static inline float3 float3_of(const XRC_FLOAT* v) { return (float3)(v[0], v[1], v[2]); }

static inline float component(const float3 v, const int axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/* The axis that a ray runs along most. */
static inline int dominant_axis(const float3 along) {
  const float3 steep = fabs(along);
  return steep.x >= steep.y && steep.x >= steep.z ? 0 : steep.y >= steep.z ? 1 : 2;
}

/* The four voxels around a point of a plane of voxels, and where it lies between them: 0 at the first. */
typedef struct {
  float hu[4]; /* u fastest */
  float along_u, along_v;
} PlaneCell;

/* In plane k across `axis`; u and v are the other two coordinates, in ascending order of axis, held within
 * the voxels' centres. */
static inline PlaneCell plane_cell(SCAN voxels, const XrcScan* scan, const int axis, const int k,
                                   const float u, const float v) {
  const int last_u = (axis == 0 ? scan->size_y : scan->size_x) - 1;
  const int last_v = (axis == 2 ? scan->size_y : scan->size_z) - 1;
  const float cu = clamp(u, 0.0f, (float)last_u), cv = clamp(v, 0.0f, (float)last_v);
  const int u0 = (int)cu, v0 = (int)cv, u1 = min(u0 + 1, last_u), v1 = min(v0 + 1, last_v);
  PlaneCell cell;
  cell.along_u = cu - (float)u0;
  cell.along_v = cv - (float)v0;
#ifdef SCAN_IMAGE
  if (axis < 2) {
    const float2 left = axis == 0 ? voxel_pair(voxels, k, u0, v0) : voxel_pair(voxels, u0, k, v0),
                 right = axis == 0 ? voxel_pair(voxels, k, u1, v0) : voxel_pair(voxels, u1, k, v0);
    cell.hu[0] = left.x;
    cell.hu[1] = right.x;
    cell.hu[2] = left.y;
    cell.hu[3] = right.y;
    return cell;
  }
#endif
  for (int c = 0; c < 4; ++c) {
    const int iu = c & 1 ? u1 : u0, iv = c >> 1 ? v1 : v0;
    cell.hu[c] = axis == 0   ? voxel_hu(voxels, scan, k, iu, iv)
                 : axis == 1 ? voxel_hu(voxels, scan, iu, k, iv)
                             : voxel_hu(voxels, scan, iu, iv, k);
  }
  return cell;
}

/* Bilinear between a cell's voxels. */
static inline float interpolated_hu(const PlaneCell* cell) {
  return mix(mix(cell->hu[0], cell->hu[1], cell->along_u), mix(cell->hu[2], cell->hu[3], cell->along_u),
             cell->along_v);
}

/* Narrows [*low, *high], both in planes, to where start + slope * plane lies within [from, to]. Written so
 * that a NaN leaves an empty range or the one there was. */
static inline void clip(float* low, float* high, const float start, const float slope, const float from,
                        const float to) {
  if (fabs(slope) < 1e-7f) {
    if (!(start >= from && start <= to)) *high = *low - 1.0f;
    return;
  }
  const float a = (from - start) / slope, b = (to - start) / slope;
  *low = fmax(*low, fmin(a, b));
  *high = fmin(*high, fmax(a, b));
}

/* Optical depth from `start` to `end`, both in voxels. The ray is clipped to the scan's faces, and every
 * plane counts as far as the half-spacings around it lie on what is left. Loop bounds are integers within the
 * scan, whatever the floats are, so that no ray can hang a device. */
static inline float joseph(SCAN voxels, const XrcScan* scan, const float3 spacing_mm, const float3 start,
                           const float3 end, constant const XrcOpacity* opacity, global const float2* table) {
  const float3 along = end - start;
  const int axis = dominant_axis(along);
  const float planes = component(along, axis), origin = component(start, axis);
  if (!(fabs(planes) > 0.0f)) return 0.0f;

  const float3 per_plane = along / planes, at_0 = start - origin * per_plane;
  const float du = axis == 0 ? per_plane.y : per_plane.x, dv = axis == 2 ? per_plane.y : per_plane.z;
  const float u0 = axis == 0 ? at_0.y : at_0.x, v0 = axis == 2 ? at_0.y : at_0.z;

  /* Along the dominant axis the ray is its own parameter. */
  float low = fmin(origin, origin + planes), high = fmax(origin, origin + planes);
  clip(&low, &high, axis == 0 ? 0.0f : at_0.x, axis == 0 ? 1.0f : per_plane.x, -0.5f, scan->size_x - 0.5f);
  clip(&low, &high, axis == 1 ? 0.0f : at_0.y, axis == 1 ? 1.0f : per_plane.y, -0.5f, scan->size_y - 0.5f);
  clip(&low, &high, axis == 2 ? 0.0f : at_0.z, axis == 2 ? 1.0f : per_plane.z, -0.5f, scan->size_z - 0.5f);
  if (!(low < high)) return 0.0f;

  const int size = axis == 0 ? scan->size_x : axis == 1 ? scan->size_y : scan->size_z;
  const int first = clamp((int)floor(low + 0.5f), 0, size - 1),
            last = clamp((int)floor(high + 0.5f), 0, size - 1);
  float sum = 0.0f;
  for (int k = first; k <= last; ++k) {
    const float share = fmin((float)k + 0.5f, high) - fmax((float)k - 0.5f, low);
    const PlaneCell cell = plane_cell(voxels, scan, axis, k, fma((float)k, du, u0), fma((float)k, dv, v0));
    sum = fma(fmax(share, 0.0f), mu_of(interpolated_hu(&cell), opacity, table), sum);
  }
  return sum * length(per_plane * spacing_mm);
}

/* Narrows [*low, *high] to where start + t * along, both in voxels, is within the detector's cylinder.
 * Written around the line's nearest point to the axis, so that a chord is as exact as the radius. */
static inline void clip_to_cylinder(float* low, float* high, const XrcDetector* detector, const float2 start,
                                    const float2 along) {
  const float2 spacing_mm = (float2)(detector->spacing_mm[0], detector->spacing_mm[1]);
  const float2 from = (start - (float2)(detector->axis[0], detector->axis[1])) * spacing_mm,
               way = along * spacing_mm;
  const float way_2 = fmax(dot(way, way), 1e-12f);
  const float offset =
      way_2 > 1e-12f ? fabs(from.x * way.y - from.y * way.x) / sqrt(way_2) : length(from); /* or along z */
  const float nearest = -dot(from, way) / way_2;
  const float half_chord =
      sqrt(fmax((detector->radius_mm - offset) * (detector->radius_mm + offset), 0.0f) / way_2);
  *low = fmax(*low, nearest - half_chord);
  *high = fmin(*high, nearest + half_chord);
}

/* The ends, in voxels, of the ray to a detector's pixel (i, j). */
static inline void pixel_ray(const XrcDetector* detector, const int i, const int j, float3* start,
                             float3* end) {
  const float3 hit = float3_of(detector->corner) + (float)i * float3_of(detector->right) +
                     (float)j * float3_of(detector->down);
  *start = detector->is_cone ? float3_of(detector->source) : hit - float3_of(detector->beam);
  *end = detector->is_cone ? hit : hit + float3_of(detector->beam);
}

/* The optical depth along a pixel's ray, within the detector's cylinder. */
static inline float joseph_pixel(SCAN voxels, const XrcScan* scan, const XrcDetector* detector, const int i,
                                 const int j, constant const XrcOpacity* opacity,
                                 global const float2* table) {
  float3 start, end;
  pixel_ray(detector, i, j, &start, &end);
  const float3 along = end - start;
  float low = 0.0f, high = 1.0f;
  clip_to_cylinder(&low, &high, detector, start.xy, along.xy);
  if (!(low < high)) return 0.0f;
  return joseph(voxels, scan, float3_of(detector->spacing_mm), start + low * along, start + high * along,
                opacity, table);
}

#endif
